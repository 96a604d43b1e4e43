"""The waypoint service: drives one robot through a list of points, or to a goal given at run time."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.base import Metres, Radians
from services.runtime import Parameters, Service, param

PLAN_LEVEL = 2
"""Bit of ``Context.params_changed`` for changes of the plan."""


class WaypointParameters(Parameters):
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
    goals: tuple[tuple[Metres, Metres], ...] = param(
        (), text="Points to drive through, as [x, y] in the odom frame.", level=PLAN_LEVEL
    )
    laps: int = param(
        1, 0, 10_000, "", "Number of times to drive through the list; 0 repeats it forever.", level=PLAN_LEVEL
    )
    final_yaw: Radians | None = param(None, text="Heading at the last point; any heading if not set.", level=PLAN_LEVEL)
    max_linear: float = param(0.22, 0.02, 2.0, "m/s", "Maximum speed.")
    max_angular: float = param(1.5, 0.1, 3.0, "rad/s", "Maximum turn rate.")
    acceleration: float = param(0.5, 0.1, 1.0, "m/s^2", "Maximum rate at which the speed command rises.")
    deceleration: float = param(
        0.5, 0.1, 1.0, "m/s^2", "Maximum rate at which the speed command falls; also used to plan the stop."
    )
    angular_acceleration: float = param(3.0, 0.5, 6.0, "rad/s^2", "Maximum rate at which the turn command changes.")
    tolerance: float = param(0.01, 0.005, 0.5, "m", "Distance at which a point counts as reached.")
    heading_tolerance: float = param(0.02, 0.005, 0.5, "rad", "Largest error of the final heading.")
    lookahead: float = param(0.3, 0.1, 2.0, "m", "Distance over which an offset from the straight path is corrected.")
    lag: float = param(0.2, 0.15, 1.0, "s", "Time constant of the final approach; must exceed the loop's delay.")
    odometry_timeout: float = param(0.5, 0.1, 5.0, "s", "Stop the robot when odometry is older than this.")


SERVICE = Service(
    name="waypoint",
    about="Drives a robot through a list of points, or to a goal_pose.",
    run="services.waypoint.loop:run",
    rate=25,
    parameters=WaypointParameters,
)
