"""The square service: drives one robot around a square that starts at its current pose."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime import Parameters, Service, param

LOG_FILE = "p3dx_square_log.txt"
"""Name of the log file in the tutorial."""


_FIXED = {"live": False}
"""Law, size and log are fixed while the square is driven."""


class SquareParameters(Parameters):
    """Parameters of the square. Defaults suit a Pioneer 3-DX; bounds keep the control laws stable at 50 Hz."""

    law: Annotated[
        Literal["profile", "tutorial"],
        Meta(
            description="Control law: 'profile' ramps to exact corners, settling at each; 'tutorial' is the original.",
            extra=_FIXED,
        ),
    ] = "profile"
    side: float = param(1.0, 0.2, 50.0, "m", "Length of a side.", live=False)
    count: int = param(1, 0, 50, "", "Number of squares to drive; 0 drives forever.", live=False)
    linear_speed: float = param(0.2, 0.02, 2.0, "m/s", "Speed along a side.")
    angular_speed: float = param(0.5, 0.05, 3.0, "rad/s", "Turn rate at a corner.")
    acceleration: float = param(0.25, 0.05, 2.0, "m/s^2", "Acceleration along a side; at most what the base can do.")
    deceleration: float = param(0.25, 0.05, 2.0, "m/s^2", "Deceleration along a side; at most what the base can do.")
    angular_acceleration: float = param(
        1.5, 0.2, 6.0, "rad/s^2", "Angular acceleration at a corner; at most what the base can do."
    )
    tolerance: float = param(0.003, 0.001, 0.1, "m", "Distance along the side at which a corner counts as reached.")
    heading_tolerance: float = param(0.003, 0.001, 0.1, "rad", "Heading error at which a turn counts as done.")
    patience: float = param(
        3.0, 0.5, 60.0, "s", "Longest wait at a corner for the tolerances to be met; then the robot drives on."
    )
    phase: float = param(
        0.06, 0.0, 0.08, "s", "Delay of the 'tutorial' law's loop after each sample of its 10 Hz odometry."
    )
    odometry_timeout: float = param(0.5, 0.1, 5.0, "s", "Stop the robot when odometry is older than this.")
    log: str = param(
        LOG_FILE,
        text="Path of the CSV log, relative to the working directory (a fleet's results); empty for none.",
        live=False,
    )


SERVICE = Service(
    name="square",
    about="Drives a robot around a square and logs desired, measured and true poses.",
    run="services.square.loop:run",
    rate=50,
    parameters=SquareParameters,
)
