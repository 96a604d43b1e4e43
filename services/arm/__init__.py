"""The arm service: it takes one joint to where the reference is, by effort."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.joints import LowerEnd, UpperEnd
from services.runtime import Parameters, Service, param


class ArmParameters(Parameters, frozen=True, kw_only=True):
    """How to control. Errors are in degrees and efforts in N m, so gains are N m per degree, as in the tutorial."""

    controller_type: Literal["ss", "tr"] = param(
        "ss", text="ss: set-point PD, the tutorial's 0; tr: tracking PID, its 1"
    )
    ss_Kp: float = param(37.5, 0, 1000, "N m/deg", "set-point: effort per error")
    ss_Ki: float = param(0.0, 0, 1000, "N m/(deg s)", "set-point: effort per summed error")
    ss_Kd: float = param(2.8, 0, 100, "N m s/deg", "set-point: effort per rate")
    tr_Kp: float = param(38.5, 0, 1000, "N m/deg", "tracking: effort per error")
    tr_Ki: float = param(0.3, 0, 1000, "N m/(deg s)", "tracking: effort per summed error")
    tr_Kd: float = param(1.3, 0, 100, "N m s/deg", "tracking: effort per rate")
    law: Annotated[
        Literal["default", "seed"],
        Meta(description="default: filtered rates, back-calculation, no bumps; seed: the original's own, for teaching"),
    ] = "default"
    saturation: float = param(200.0, 0, 1000, "N m", "largest effort")
    windup_guard: float = param(20.0, 0, 10_000, "deg s", "seed: bound of the summed error")
    derivative_filter: float = param(
        0.001, 0, 0.02, "s", "default: time constant of the filter of the rate, a period's mean; 0 is none"
    )
    gravity: bool = param(
        False, text="feed forward what holds the arm's weight; in tracking, by the default law, also what moves it"
    )
    gravity_torque: float = param(
        27.148, 0, 100_000, "N m", "the arm's weight times the distance of its centre of mass", live=False
    )
    gravity_rest: float = param(-1.4635, -360, 360, "deg", "angle at which it hangs at rest", live=False)
    inertia: float = param(3.8655, 0, 100_000, "kg m2", "the arm's inertia about the joint", live=False)
    rate: float = param(100.0, 40, 200, "Hz", "control rate; in lockstep a whole number of physics steps", live=False)
    duration: float = param(0.1, 0.0, 1.0, "s", "how long an effort acts if no other follows; at least two periods")
    reference_timeout: float = param(0.5, 0.05, 10, "s", "without a reference for longer it is given up")
    state_timeout: float = param(0.1, 0.02, 1, "s", "without joint states for longer the arm is let go")
    joint: str = param("bear_link", text="the joint to move", max_length=255, live=False)
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="arm",
    about="takes a joint to where the reference is, by effort: set-point PD or tracking PID",
    run="services.arm.loop:run",
    rate=100,
    parameters=ArmParameters,
    parameter_set="/robot_control",
)
