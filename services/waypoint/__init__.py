"""The waypoint service: drives one robot through a list of points, or to a goal given at run time."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.base import Metres, Radians
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, STATUS
from services.runtime.service import Parameters, Service

PLAN_LEVEL = 2
"""Bit of ``Context.params_changed`` for changes of the plan."""
_PLAN = {"level": PLAN_LEVEL}


def _number(low: float, high: float, unit: str, text: str) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit})


class WaypointParameters(Parameters, frozen=True, kw_only=True):
    """Parameters of the waypoint controller. Defaults suit a TurtleBot3 burger; bounds keep each law stable at 25 Hz.

    All are live: changing goals, laps or the final heading starts a new plan; others take effect at the next tick.
    """

    law: Annotated[
        Literal["steady", "tutorial"],
        Meta(
            description="Control law: 'steady' is limited and stops at each point; "
            "'tutorial' is v = 0.1 D, w = 0.7 e without limits."
        ),
    ] = "steady"
    goals: Annotated[
        tuple[tuple[Metres, Metres], ...],
        Meta(description="Points to drive through, as [x, y] in the odom frame.", extra=_PLAN),
    ] = ()
    laps: Annotated[
        int,
        Meta(
            ge=0, le=10_000, description="Number of times to drive through the list; 0 repeats it forever.", extra=_PLAN
        ),
    ] = 1
    final_yaw: Annotated[
        Radians | None, Meta(description="Heading at the last point; any heading if not set.", extra=_PLAN)
    ] = None
    max_linear: Annotated[float, _number(0.02, 2.0, "m/s", "Maximum speed.")] = 0.22
    max_angular: Annotated[float, _number(0.1, 3.0, "rad/s", "Maximum turn rate.")] = 1.5
    acceleration: Annotated[float, _number(0.1, 1.0, "m/s^2", "Maximum rate at which the speed command rises.")] = 0.5
    deceleration: Annotated[
        float, _number(0.1, 1.0, "m/s^2", "Maximum rate at which the speed command falls; also used to plan the stop.")
    ] = 0.5
    angular_acceleration: Annotated[
        float, _number(0.5, 6.0, "rad/s^2", "Maximum rate at which the turn command changes.")
    ] = 3.0
    tolerance: Annotated[float, _number(0.005, 0.5, "m", "Distance at which a point counts as reached.")] = 0.01
    heading_tolerance: Annotated[float, _number(0.005, 0.5, "rad", "Largest error of the final heading.")] = 0.02
    lookahead: Annotated[
        float, _number(0.1, 2.0, "m", "Distance over which an offset from the straight path is corrected.")
    ] = 0.3
    lag: Annotated[
        float, _number(0.15, 1.0, "s", "Time constant of the final approach; must exceed the loop's delay.")
    ] = 0.2
    odometry_timeout: Annotated[float, _number(0.1, 5.0, "s", "Stop the robot when odometry is older than this.")] = 0.5


SERVICE = Service(
    name="waypoint",
    about="Drives a robot through a list of points, or to a goal_pose.",
    run="services.waypoint.loop:run",
    reads=(ODOM, GOAL_POSE),
    writes=(CMD_VEL, PLAN, STATUS),
    rate=25,
    parameters=WaypointParameters,
)
