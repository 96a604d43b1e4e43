"""The waypoint service: one per robot, it drives the robot through a list of points or to a goal given at run time."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.base import Metres, Radians
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, STATUS
from services.runtime.service import Parameters, Service

PLAN_LEVEL = 2
"""The bit of ``Context.params_changed`` that tells of other goals."""
_PLAN = {"level": PLAN_LEVEL}


def _number(low: float, high: float, unit: str, text: str) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit})


class WaypointParameters(Parameters, frozen=True, kw_only=True):
    """Where to drive and how. The defaults suit a TurtleBot3 burger; the bounds keep every law stable at 25 Hz.

    All are live: other goals, laps or another final heading are a new plan, the rest counts from the next tick on.
    """

    law: Annotated[
        Literal["steady", "tutorial"],
        Meta(description="steady: limited, stops at each point; seed: v = 0.1 D, w = 0.7 e, unlimited, for comparison"),
    ] = "steady"
    goals: Annotated[
        tuple[tuple[Metres, Metres], ...],
        Meta(description="points to drive through, x and y in the frame of odom", extra=_PLAN),
    ] = ()
    laps: Annotated[
        int, Meta(ge=0, le=10_000, description="times through the list; 0 repeats it for ever", extra=_PLAN)
    ] = 1
    final_yaw: Annotated[
        Radians | None, Meta(description="heading at the end of the list; free when not given", extra=_PLAN)
    ] = None
    max_linear: Annotated[float, _number(0.02, 2.0, "m/s", "top speed")] = 0.22
    max_angular: Annotated[float, _number(0.1, 3.0, "rad/s", "top turn rate")] = 1.5
    acceleration: Annotated[float, _number(0.1, 1.0, "m/s^2", "rise of the speed command")] = 0.5
    deceleration: Annotated[float, _number(0.1, 1.0, "m/s^2", "fall of the speed command, plans the stop")] = 0.5
    angular_acceleration: Annotated[float, _number(0.5, 6.0, "rad/s^2", "change of the turn command")] = 3.0
    tolerance: Annotated[float, _number(0.005, 0.5, "m", "distance at which a point counts as reached")] = 0.01
    heading_tolerance: Annotated[float, _number(0.005, 0.5, "rad", "error allowed in the final heading")] = 0.02
    lookahead: Annotated[float, _number(0.1, 2.0, "m", "distance over which an offset from the leg is taken out")] = 0.3
    lag: Annotated[float, _number(0.15, 1.0, "s", "time constant of the last approach; above the loop's delay")] = 0.2
    odometry_timeout: Annotated[float, _number(0.1, 5.0, "s", "odometry older than this stops the robot")] = 0.5


SERVICE = Service(
    name="waypoint",
    about="drives a robot through a list of points, or to the goal of goal_pose",
    run="services.waypoint.loop:run",
    reads=(ODOM, GOAL_POSE),
    writes=(CMD_VEL, PLAN, STATUS),
    rate=25,
    parameters=WaypointParameters,
)
