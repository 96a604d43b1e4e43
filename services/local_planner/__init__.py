"""The local planner: drives one robot to its goals, around the robots and obstacles that its laser detects."""

from __future__ import annotations

from messages.base import Metres, Radians
from services.runtime import Parameters, Service, param

PLAN_LEVEL = 2
"""Bit of ``Context.params_changed`` for changes of the plan."""


class LocalPlannerParameters(Parameters):
    """Parameters of the local planner. Defaults suit a TurtleBot3 burger among others.

    All are live: changing goals, laps or the final heading starts a new plan; others take effect at the next tick.
    """

    goals: tuple[tuple[Metres, Metres], ...] = param(
        (), text="Points to drive to in order, as [x, y] in the odom frame.", level=PLAN_LEVEL
    )
    laps: int = param(
        1, 0, 10_000, "", "Number of times to drive through the list; 0 repeats it forever.", level=PLAN_LEVEL
    )
    final_yaw: Radians | None = param(None, text="Heading at the last point; any heading if not set.", level=PLAN_LEVEL)
    max_linear: float = param(0.22, 0.02, 1.0, "m/s", "Maximum speed.")
    max_angular: float = param(1.5, 0.1, 3.0, "rad/s", "Maximum turn rate.")
    acceleration: float = param(0.5, 0.1, 2.0, "m/s^2", "Maximum rate at which the speed command rises.")
    deceleration: float = param(
        0.5, 0.1, 2.0, "m/s^2", "Maximum rate at which the speed command falls; also used to plan each stop."
    )
    angular_acceleration: float = param(3.0, 0.5, 6.0, "rad/s^2", "Maximum rate at which the turn command changes.")
    tolerance: float = param(0.02, 0.005, 0.5, "m", "Distance at which a point counts as reached.")
    heading_tolerance: float = param(0.05, 0.005, 0.5, "rad", "Largest error of the final heading.")
    radius: float = param(
        0.125, 0.01, 2.0, "m", "Radius of the circle around the wheels' axle in which the robot can turn."
    )
    seen_radius: float = param(
        0.055,
        0.005,
        1.0,
        "m",
        "Radius of other robots at the height of the laser; wider objects count as fixed obstacles.",
    )
    overhang: float = param(
        0.055, 0.0, 1.0, "m", "How far robots and obstacles may extend beyond their outline at the height of the laser."
    )
    clearance: float = param(0.05, 0.02, 1.0, "m", "Distance to keep from everything seen.")
    view: float = param(1.6, 0.3, 10.0, "m", "Distance up to which robots and obstacles are considered.")
    horizon: float = param(4.0, 0.5, 20.0, "s", "Look-ahead time; later contacts are ignored.")
    patience: float = param(
        6.0, 1.0, 60.0, "s", "Time without progress after which the robot tries another direction for a while."
    )
    lag: float = param(
        0.4,
        0.1,
        1.0,
        "s",
        "Maximum delay from a scan to the resulting motion; speeds near obstacles are limited accordingly.",
    )
    odometry_timeout: float = param(0.5, 0.1, 5.0, "s", "Stop the robot when odometry is older than this.")
    scan_timeout: float = param(0.5, 0.1, 5.0, "s", "Stop the robot when the laser scan is older than this.")


SERVICE = Service(
    name="local_planner",
    about="Drives a robot to its goals and avoids obstacles that its laser detects.",
    run="services.local_planner.loop:run",
    rate=10,
    parameters=LocalPlannerParameters,
)
