"""The square service: one per robot, it drives the robot once or more around a square that begins where it stands."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime import Parameters, Service, param

LOG_FILE = "p3dx_square_log.txt"
"""The log's name in the tutorial that the square comes from."""


_FIXED = {"live": False}
"""A square under way keeps its law, its size and its log."""


class SquareParameters(Parameters, frozen=True, kw_only=True):
    """The square and how to drive it. The defaults suit a Pioneer 3-DX; the bounds keep the laws stable at 50 Hz."""

    law: Annotated[
        Literal["profile", "seed"],
        Meta(
            description="profile: ramps to absolute corners, settles at each; seed: the original, for teaching",
            extra=_FIXED,
        ),
    ] = "profile"
    side: float = param(1.0, 0.2, 50.0, "m", "side of the square", live=False)
    count: int = param(1, 0, 50, "", "squares to drive; 0 drives on for ever", live=False)
    linear_speed: float = param(0.2, 0.02, 2.0, "m/s", "speed along a side")
    angular_speed: float = param(0.5, 0.05, 3.0, "rad/s", "turn rate at a corner")
    acceleration: float = param(0.25, 0.05, 2.0, "m/s^2", "rise of the speed; at most what the base does")
    deceleration: float = param(0.25, 0.05, 2.0, "m/s^2", "fall of the speed; at most what the base does")
    angular_acceleration: float = param(1.5, 0.2, 6.0, "rad/s^2", "change of the turn rate; at most what the base does")
    tolerance: float = param(0.003, 0.001, 0.1, "m", "distance along the side at which a corner is reached")
    heading_tolerance: float = param(0.003, 0.001, 0.1, "rad", "error at which a turn is done")
    patience: float = param(3.0, 0.5, 60.0, "s", "longest wait for the tolerances at a corner; then the robot goes on")
    phase: float = param(0.06, 0.0, 0.08, "s", "seed: how long after a sample of its 10 Hz odometry the loop acts")
    odometry_timeout: float = param(0.5, 0.1, 5.0, "s", "odometry older than this stops the robot")
    log: str = param(
        LOG_FILE, text="the CSV log, by default in the working directory (a fleet's results); empty: none", live=False
    )


SERVICE = Service(
    name="square",
    about="drives a robot around a square and logs what it should do, does, and truly did",
    run="services.square.loop:run",
    rate=50,
    parameters=SquareParameters,
)
