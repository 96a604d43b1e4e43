"""The PID of wheels and joints, from an error to a command: the semantics of ROS's ``control_toolbox``."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple


@dataclass(frozen=True)
class PidGains:
    """``p`` is in units of the command per unit of the error, ``i`` per unit and second, ``d`` per unit of its rate.

    ``i_min`` and ``i_max`` bound the integral's share of the command, ``limit`` clamps the command. Without
    ``antiwindup`` the share is clamped while the integral goes on growing; with it, the integral itself is.
    """

    p: float
    i: float = 0.0
    d: float = 0.0
    i_min: float = 0.0
    i_max: float = 0.0
    antiwindup: bool = False
    limit: float = inf


class PidState(NamedTuple):
    """The integral of the error over time, and the last error; None before the first."""

    integral: float = 0.0
    error: float | None = None


INITIAL_PID_STATE = PidState()


def pid_command(
    gains: PidGains, memory: PidState, error: float, dt: float, error_rate: float | None = None
) -> tuple[float, PidState]:
    """The command against ``error`` (wanted less measured) over ``dt`` [s], and what is remembered.

    The derivative is ``error_rate`` [1/s], or else the difference of the errors over ``dt``, 0 at the first. An error
    that is not finite, or no time, gives 0 and changes nothing.
    """
    if not isfinite(error) or not isfinite(dt) or dt <= 0.0:
        return 0.0, memory
    integral = memory.integral + error * dt
    if gains.antiwindup and gains.i:
        low, high = sorted((gains.i_min / gains.i, gains.i_max / gains.i))
        integral = _clamp(low, integral, high)
    share = gains.i * integral
    if not gains.antiwindup:
        share = _clamp(gains.i_min, share, gains.i_max)
    slope = error_rate
    if slope is None:
        slope = 0.0 if memory.error is None else (error - memory.error) / dt
    command = gains.p * error + share + gains.d * slope
    return _clamp(-gains.limit, command, gains.limit), PidState(integral, error)


def _clamp(low: float, value: float, high: float) -> float:
    return low if value < low else high if value > high else value
