"""The PID of wheels and joints, from an error to a command: the semantics of ROS's ``control_toolbox``."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple


@dataclass(frozen=True)
class PidGains:
    """Gains: ``p`` in units of the command per unit of error, ``i`` per unit and second, ``d`` per unit of its rate.

    ``i_min`` and ``i_max`` bound the integral term, ``limit`` the command. Without ``antiwindup``, only the term is
    clamped while the integral keeps growing; with it, the integral itself is clamped.
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
    gains: PidGains, state: PidState, error: float, dt: float, error_rate: float | None = None
) -> tuple[float, PidState]:
    """Return the command for ``error`` (desired minus measured) over ``dt`` [s], and the new state.

    The derivative is ``error_rate`` [1/s] if given, else the difference of the errors over ``dt``, 0 at the first. A
    non-finite error or a ``dt`` that is not positive yields 0 and leaves the state unchanged.
    """
    if not isfinite(error) or not isfinite(dt) or dt <= 0.0:
        return 0.0, state
    integral = state.integral + error * dt
    if gains.antiwindup and gains.i:
        low, high = sorted((gains.i_min / gains.i, gains.i_max / gains.i))
        integral = _clamp(low, integral, high)
    integral_term = gains.i * integral
    if not gains.antiwindup:
        integral_term = _clamp(gains.i_min, integral_term, gains.i_max)
    if error_rate is None:
        error_rate = 0.0 if state.error is None else (error - state.error) / dt
    command = gains.p * error + integral_term + gains.d * error_rate
    return _clamp(-gains.limit, command, gains.limit), PidState(integral, error)


def _clamp(low: float, value: float, high: float) -> float:
    return low if value < low else high if value > high else value
