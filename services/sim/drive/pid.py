"""The wheel's PID, from a speed error to a torque: the semantics of ROS's ``control_toolbox``."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple


@dataclass(frozen=True)
class PidGains:
    """``p`` [N m s/rad], ``i`` [N m/rad], ``d`` [N m s2/rad]; ``i_min`` and ``i_max`` [N m] bound the integral's share.

    Without ``antiwindup`` the share is clamped while the integral goes on growing; with it, the integral itself is.
    ``limit`` [N m] clamps the torque.
    """

    p: float
    i: float = 0.0
    d: float = 0.0
    i_min: float = 0.0
    i_max: float = 0.0
    antiwindup: bool = False
    limit: float = inf


class PidState(NamedTuple):
    """The integral of the error [rad], and the last error [rad/s]; None before the first."""

    integral: float = 0.0
    error: float | None = None


INITIAL_PID_STATE = PidState()


def pid_torque(gains: PidGains, memory: PidState, error: float, dt: float) -> tuple[float, PidState]:
    """The torque [N m] against ``error`` (wanted less measured, rad/s) over ``dt`` [s], and what is remembered.

    The derivative is that of the error, 0 at the first sample. An error that is not finite, or no time, gives 0 and
    changes nothing.
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
    slope = 0.0 if memory.error is None else (error - memory.error) / dt
    effort = gains.p * error + share + gains.d * slope
    return _clamp(-gains.limit, effort, gains.limit), PidState(integral, error)


def _clamp(low: float, value: float, high: float) -> float:
    return low if value < low else high if value > high else value
