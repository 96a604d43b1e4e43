"""The square service: drives one robot around a square that starts at its current pose."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.topics import CMD_VEL, GROUND_TRUTH, ODOM, PLAN, STATUS
from services.runtime.service import Parameters, Service

LOG_FILE = "p3dx_square_log.txt"
"""Name of the log file in the tutorial."""


_FIXED = {"live": False}
"""Law, size and log do not change while the square is driven."""


def _number(low: float, high: float, unit: str, text: str, live: bool = True) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit, "live": live})


class SquareParameters(Parameters, frozen=True, kw_only=True):
    """Parameters of the square. Defaults suit a Pioneer 3-DX; bounds keep the control laws stable at 50 Hz."""

    law: Annotated[
        Literal["profile", "tutorial"],
        Meta(
            description="Control law: 'profile' ramps to exact corners, settling at each; 'tutorial' is the original.",
            extra=_FIXED,
        ),
    ] = "profile"
    side: Annotated[float, _number(0.2, 50.0, "m", "Length of a side.", live=False)] = 1.0
    count: Annotated[
        int, Meta(ge=0, le=50, description="Number of squares to drive; 0 drives forever.", extra=_FIXED)
    ] = 1
    linear_speed: Annotated[float, _number(0.02, 2.0, "m/s", "Speed along a side.")] = 0.2
    angular_speed: Annotated[float, _number(0.05, 3.0, "rad/s", "Turn rate at a corner.")] = 0.5
    acceleration: Annotated[
        float, _number(0.05, 2.0, "m/s^2", "Acceleration along a side; at most what the base can do.")
    ] = 0.25
    deceleration: Annotated[
        float, _number(0.05, 2.0, "m/s^2", "Deceleration along a side; at most what the base can do.")
    ] = 0.25
    angular_acceleration: Annotated[
        float, _number(0.2, 6.0, "rad/s^2", "Angular acceleration at a corner; at most what the base can do.")
    ] = 1.5
    tolerance: Annotated[
        float, _number(0.001, 0.1, "m", "Distance along the side at which a corner counts as reached.")
    ] = 0.003
    heading_tolerance: Annotated[float, _number(0.001, 0.1, "rad", "Heading error at which a turn counts as done.")] = (
        0.003
    )
    patience: Annotated[
        float,
        _number(0.5, 60.0, "s", "Longest wait at a corner for the tolerances to be met; then the robot drives on."),
    ] = 3.0
    phase: Annotated[
        float, _number(0.0, 0.08, "s", "Delay of the 'tutorial' law's loop after each sample of its 10 Hz odometry.")
    ] = 0.06
    odometry_timeout: Annotated[float, _number(0.1, 5.0, "s", "Stop the robot when odometry is older than this.")] = 0.5
    log: Annotated[
        str,
        Meta(
            description="Path of the CSV log, relative to the working directory (a fleet's results); empty for none.",
            extra=_FIXED,
        ),
    ] = LOG_FILE


SERVICE = Service(
    name="square",
    about="Drives a robot around a square and logs desired, measured and true poses.",
    run="services.square.loop:run",
    reads=(ODOM, GROUND_TRUTH),
    writes=(CMD_VEL, PLAN, STATUS),
    rate=50,
    parameters=SquareParameters,
)
