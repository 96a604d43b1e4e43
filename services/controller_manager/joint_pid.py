"""The PID of one joint, whose gains can be set while it runs, as by control_toolbox's dynamic_reconfigure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from services.controller_manager.config import Gains
from services.driving.pid import INITIAL_PID_STATE, PidGains, pid_command
from services.runtime import Parameters, param


class PidParameters(Parameters, frozen=True, kw_only=True):
    """The gains of one joint, in units of its command per rad or m of error, or per rad/s or m/s."""

    p: float = param(0.0, -1e6, 1e6, text="Proportional gain.")
    i: float = param(0.0, -1e6, 1e6, text="Integral gain.")
    d: float = param(0.0, -1e6, 1e6, text="Derivative gain.")
    i_clamp_min: float = param(0.0, -1e6, 0, text="Lower bound of the integral term; 0, as in ROS, disables it.")
    i_clamp_max: float = param(0.0, 0, 1e6, text="Upper bound of the integral term; 0, as in ROS, disables it.")
    antiwindup: bool = param(False, text="Clamp the integral itself, not only its term.")
    ff_velocity_scale: float = param(0.0, -1e6, 1e6, text="Feed-forward gain on the trajectory's velocity.")

    @classmethod
    def of(cls, gains: Gains) -> PidParameters:
        """Those that the file states."""
        low, high = gains.bounds
        return cls(
            p=gains.p,
            i=gains.i,
            d=gains.d,
            i_clamp_min=low,
            i_clamp_max=high,
            antiwindup=gains.antiwindup,
            ff_velocity_scale=gains.ff_velocity_scale,
        )


class PidSource(Protocol):
    """Where the gains come from: a set of the parameter service, or a constant."""

    def __call__(self) -> PidParameters:
        """The gains as they stand."""


Announce = Callable[[str, PidParameters], PidSource]
"""Makes a set of parameters of a name, relative to the namespace, and returns where to read it."""


class JointPid:
    """A PID with the semantics of control_toolbox; ``last_error`` is the error of the last step."""

    def __init__(self, source: PidSource) -> None:
        self._source = source
        self.reset()

    @property
    def params(self) -> PidParameters:
        """The gains as they stand."""
        return self._source()

    def reset(self) -> None:
        """Forget the integral and the last error."""
        self._state, self.last_error = INITIAL_PID_STATE, 0.0

    def step(self, error: float, dt: float, error_rate: float | None = None) -> float:
        """The command against ``error`` after ``dt`` [s]; without an ``error_rate``, the errors' difference has it."""
        p = self.params
        gains = PidGains(p.p, p.i, p.d, p.i_clamp_min, p.i_clamp_max, p.antiwindup)
        command, self._state = pid_command(gains, self._state, error, dt, error_rate)
        self.last_error = error
        return command
