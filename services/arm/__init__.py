"""The arm service: controls one joint by effort so that it follows the reference."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.joints import LowerEnd, UpperEnd
from services.runtime import Parameters, Service, param


class ArmParameters(Parameters):
    """Parameters of the arm controller. Errors are in degrees and efforts in N m, so gains are in N m per degree."""

    controller_type: Literal["ss", "tr"] = param(
        "ss", text="Controller: 'ss' is the set-point PD (0 in the tutorial), 'tr' the tracking PID (1)."
    )
    ss_Kp: float = param(37.5, 0, 1000, "N m/deg", "Proportional gain of the set-point controller.")
    ss_Ki: float = param(0.0, 0, 1000, "N m/(deg s)", "Integral gain of the set-point controller.")
    ss_Kd: float = param(2.8, 0, 100, "N m s/deg", "Derivative gain of the set-point controller.")
    tr_Kp: float = param(38.5, 0, 1000, "N m/deg", "Proportional gain of the tracking controller.")
    tr_Ki: float = param(0.3, 0, 1000, "N m/(deg s)", "Integral gain of the tracking controller.")
    tr_Kd: float = param(1.3, 0, 100, "N m s/deg", "Derivative gain of the tracking controller.")
    law: Annotated[
        Literal["default", "tutorial"],
        Meta(description="Control law: 'default' is filtered, bumpless and limits windup; 'tutorial' is the original."),
    ] = "default"
    saturation: float = param(200.0, 0, 1000, "N m", "Largest effort.")
    windup_guard: float = param(20.0, 0, 10_000, "deg s", "Limit of the summed error in the 'tutorial' law.")
    derivative_filter: float = param(
        0.001, 0, 0.02, "s", "Time constant of the rate filter in the 'default' law; 0 disables it."
    )
    gravity: bool = param(False, text="Feed gravity forward; when tracking by the 'default' law, also inertia.")
    gravity_torque: float = param(
        27.148,
        0,
        100_000,
        "N m",
        "Weight of the arm times the distance of its centre of mass from the joint.",
        live=False,
    )
    gravity_rest: float = param(-1.4635, -360, 360, "deg", "Angle at which the arm hangs at rest.", live=False)
    inertia: float = param(3.8655, 0, 100_000, "kg m2", "Moment of inertia of the arm about the joint.", live=False)
    rate: float = param(
        100.0, 40, 200, "Hz", "Control rate; in lockstep, its period is a whole number of physics steps.", live=False
    )
    duration: float = param(
        0.1, 0.0, 1.0, "s", "How long an effort acts unless another follows; at least two control periods."
    )
    reference_timeout: float = param(
        0.5, 0.05, 10, "s", "Hold the last angle when no reference has arrived for this long."
    )
    state_timeout: float = param(0.1, 0.02, 1, "s", "Release the arm when no joint states have arrived for this long.")
    joint: str = param("bear_link", text="Joint to control.", max_length=255, live=False)
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="arm",
    about="Controls a joint by effort to follow the reference: set-point PD or tracking PID.",
    run="services.arm.loop:run",
    rate=100,
    rate_parameter="rate",
    parameters=ArmParameters,
    parameter_set="/robot_control",
)
