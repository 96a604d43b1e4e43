"""The waypoint service: one per robot, it drives the robot through a list of points or to a goal given at run time."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.base import Metres, Radians
from services.runtime import Parameters, Service, param

PLAN_LEVEL = 2
"""The bit of ``Context.params_changed`` that tells of other goals."""


class WaypointParameters(Parameters, frozen=True, kw_only=True):
    """Where to drive and how. The defaults suit a TurtleBot3 burger; the bounds keep every law stable at 25 Hz.

    All are live: other goals, laps or another final heading are a new plan, the rest counts from the next tick on.
    """

    law: Annotated[
        Literal["steady", "seed"],
        Meta(description="steady: limited, stops at each point; seed: v = 0.1 D, w = 0.7 e, unlimited, for comparison"),
    ] = "steady"
    goals: tuple[tuple[Metres, Metres], ...] = param(
        (), text="points to drive through, x and y in the frame of odom", level=PLAN_LEVEL
    )
    laps: int = param(1, 0, 10_000, "", "times through the list; 0 repeats it for ever", level=PLAN_LEVEL)
    final_yaw: Radians | None = param(
        None, text="heading at the end of the list; free when not given", level=PLAN_LEVEL
    )
    max_linear: float = param(0.22, 0.02, 2.0, "m/s", "top speed")
    max_angular: float = param(1.5, 0.1, 3.0, "rad/s", "top turn rate")
    acceleration: float = param(0.5, 0.1, 1.0, "m/s^2", "rise of the speed command")
    deceleration: float = param(0.5, 0.1, 1.0, "m/s^2", "fall of the speed command, plans the stop")
    angular_acceleration: float = param(3.0, 0.5, 6.0, "rad/s^2", "change of the turn command")
    tolerance: float = param(0.01, 0.005, 0.5, "m", "distance at which a point counts as reached")
    heading_tolerance: float = param(0.02, 0.005, 0.5, "rad", "error allowed in the final heading")
    lookahead: float = param(0.3, 0.1, 2.0, "m", "distance over which an offset from the leg is taken out")
    lag: float = param(0.2, 0.15, 1.0, "s", "time constant of the last approach; above the loop's delay")
    odometry_timeout: float = param(0.5, 0.1, 5.0, "s", "odometry older than this stops the robot")


SERVICE = Service(
    name="waypoint",
    about="drives a robot through a list of points, or to the goal of goal_pose",
    run="services.waypoint.loop:run",
    rate=25,
    parameters=WaypointParameters,
)
