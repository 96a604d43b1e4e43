"""The PID of one joint, whose gains can change at run time, like control_toolbox's with dynamic_reconfigure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from services.controller_manager.config import Gains
from services.driving.pid import INITIAL_PID_STATE, PidGains, pid_command
from services.runtime import Parameters, param


class PidParameters(Parameters, frozen=True, kw_only=True):
    """The gains of one joint, in units of the command per rad or m of error, or per rad/s or m/s."""

    p: float = param(0.0, -1e6, 1e6, text="Proportional gain.")
    i: float = param(0.0, -1e6, 1e6, text="Integral gain.")
    d: float = param(0.0, -1e6, 1e6, text="Derivative gain.")
    i_clamp_min: float = param(0.0, -1e6, 0, text="Lower bound of the integral term; 0, as in ROS, disables it.")
    i_clamp_max: float = param(0.0, 0, 1e6, text="Upper bound of the integral term; 0, as in ROS, disables it.")
    antiwindup: bool = param(False, text="Clamp the integral itself, not only its term.")
    ff_velocity_scale: float = param(0.0, -1e6, 1e6, text="Feed-forward gain on the trajectory's velocity.")

    @classmethod
    def of(cls, gains: Gains) -> PidParameters:
        """Return the gains of the configuration file."""
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
    """Source of the gains: a set of the parameter service, or a constant."""

    def __call__(self) -> PidParameters:
        """Return the current gains."""


Announce = Callable[[str, PidParameters], PidSource]
"""Announces a parameter set by its name, relative to the namespace, and returns the source of its values."""


class JointPid:
    """A PID with the semantics of control_toolbox."""

    def __init__(self, source: PidSource) -> None:
        self._source = source
        self.reset()

    @property
    def params(self) -> PidParameters:
        """The current gains."""
        return self._source()

    def reset(self) -> None:
        """Reset the integral and the last error."""
        self._state = INITIAL_PID_STATE

    def step(self, error: float, dt: float, error_rate: float | None = None) -> float:
        """Return the command for ``error`` after ``dt`` [s]; without ``error_rate``, the errors are differentiated."""
        p = self.params
        gains = PidGains(p.p, p.i, p.d, p.i_clamp_min, p.i_clamp_max, p.antiwindup)
        command, self._state = pid_command(gains, self._state, error, dt, error_rate)
        return command
