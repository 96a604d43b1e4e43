"""The limits of an axis and the gains of a wheel, from parameters in ROS's words."""

from __future__ import annotations

from math import inf

from services.runtime.errors import BadInput
from services.sim.base.parameters import AxisParameters, PidParameters
from services.sim.diffdrive.limiter import Axis
from services.sim.diffdrive.pid import Gains


def axis_of(
    name: str, given: AxisParameters | None, fastest: float | None, rise: float | None, ros1_jerk: bool = False
) -> Axis:
    """The limits of the axis ``name``; raises BadInput for a deceleration of 0.

    The hardware's speed ``fastest`` bounds what is given; ``rise`` is the acceleration where none is given.
    """
    asked = given or AxisParameters()
    most = inf if fastest is None else fastest
    high = _or(asked.max_velocity, inf)
    low = _or(asked.min_velocity, -high)
    up = _or(asked.max_acceleration, inf if rise is None else rise)
    down = -_or(asked.min_acceleration, -up)
    jerk = _or(asked.max_jerk, inf)
    return Axis(
        min_velocity=max(low, -most),
        max_velocity=min(high, most),
        accelerate=up,
        decelerate=_size(name, "max_deceleration", asked.max_deceleration, down),
        accelerate_reverse=_size(name, "max_acceleration_reverse", asked.max_acceleration_reverse, down),
        decelerate_reverse=_size(name, "max_deceleration_reverse", asked.max_deceleration_reverse, up),
        min_jerk=_or(asked.min_jerk, -jerk),
        max_jerk=jerk,
        ros1_jerk=ros1_jerk,
    )


def gains_of(given: PidParameters | None, limit: float) -> Gains | None:
    """The gains of a wheel whose torque is at most ``limit`` [N m]; None for one that is driven by speed."""
    if given is None:
        return None
    low = -given.i_clamp if given.i_clamp_min is None else given.i_clamp_min
    high = given.i_clamp if given.i_clamp_max is None else given.i_clamp_max
    return Gains(given.p, given.i, given.d, low, high, given.antiwindup, limit)


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _size(axis: str, name: str, value: float | None, default: float) -> float:
    if value == 0:
        raise BadInput(f"{axis}.{name} = 0: a base with this limit could never change its speed")
    return default if value is None else abs(value)
