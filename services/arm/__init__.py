"""The arm service: controls one joint by effort so that it follows the reference."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.joints import LowerEnd, UpperEnd
from messages.topics import (
    CONTROL_ERROR,
    CONTROL_SIGNAL,
    CONTROL_STATE,
    JOINT_ANGLE,
    JOINT_EFFORT,
    JOINT_STATES,
    REFERENCE,
)
from services.runtime.service import Parameters, Service


def _number(low: float, high: float, unit: str, text: str, live: bool = True) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit, "live": live})


class ArmParameters(Parameters, frozen=True, kw_only=True):
    """Parameters of the arm controller. Errors are in degrees and efforts in N m, so gains are in N m per degree."""

    controller_type: Annotated[
        Literal["ss", "tr"],
        Meta(description="Controller: 'ss' is the set-point PD (0 in the tutorial), 'tr' the tracking PID (1)."),
    ] = "ss"
    ss_Kp: Annotated[float, _number(0, 1000, "N m/deg", "Proportional gain of the set-point controller.")] = 37.5
    ss_Ki: Annotated[float, _number(0, 1000, "N m/(deg s)", "Integral gain of the set-point controller.")] = 0.0
    ss_Kd: Annotated[float, _number(0, 100, "N m s/deg", "Derivative gain of the set-point controller.")] = 2.8
    tr_Kp: Annotated[float, _number(0, 1000, "N m/deg", "Proportional gain of the tracking controller.")] = 38.5
    tr_Ki: Annotated[float, _number(0, 1000, "N m/(deg s)", "Integral gain of the tracking controller.")] = 0.3
    tr_Kd: Annotated[float, _number(0, 100, "N m s/deg", "Derivative gain of the tracking controller.")] = 1.3
    law: Annotated[
        Literal["default", "tutorial"],
        Meta(description="Control law: 'default' is filtered, bumpless and limits windup; 'tutorial' is the original."),
    ] = "default"
    saturation: Annotated[float, _number(0, 1000, "N m", "Largest effort.")] = 200.0
    windup_guard: Annotated[float, _number(0, 10_000, "deg s", "Bound of the summed error in the 'tutorial' law.")] = (
        20.0
    )
    derivative_filter: Annotated[
        float,
        _number(0, 0.02, "s", "Time constant of the rate filter in the 'default' law; 0 disables it."),
    ] = 0.001
    gravity: Annotated[
        bool,
        Meta(description="Feed gravity forward; when tracking by the 'default' law, also inertia."),
    ] = False
    gravity_torque: Annotated[
        float,
        _number(
            0, 100_000, "N m", "Weight of the arm times the distance of its centre of mass from the joint.", live=False
        ),
    ] = 27.148
    gravity_rest: Annotated[
        float, _number(-360, 360, "deg", "Angle at which the arm hangs at rest.", live=False)
    ] = -1.4635
    inertia: Annotated[
        float, _number(0, 100_000, "kg m2", "Moment of inertia of the arm about the joint.", live=False)
    ] = 3.8655
    rate: Annotated[
        float,
        _number(40, 200, "Hz", "Control rate; in lockstep, its period is a whole number of physics steps.", live=False),
    ] = 100.0
    duration: Annotated[
        float, _number(0.0, 1.0, "s", "How long an effort acts unless another follows; at least two control periods.")
    ] = 0.1
    reference_timeout: Annotated[
        float, _number(0.05, 10, "s", "Hold the last angle when no reference has arrived for this long.")
    ] = 0.5
    state_timeout: Annotated[
        float, _number(0.02, 1, "s", "Release the arm when no joint states have arrived for this long.")
    ] = 0.1
    joint: Annotated[str, Meta(max_length=255, description="Joint to control.", extra={"live": False})] = "bear_link"
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="arm",
    about="Controls a joint by effort to follow the reference: set-point PD or tracking PID.",
    run="services.arm.loop:run",
    reads=(JOINT_STATES, REFERENCE),
    writes=(JOINT_EFFORT, CONTROL_SIGNAL, JOINT_ANGLE, CONTROL_ERROR, CONTROL_STATE),
    rate=100,
    parameters=ArmParameters,
    parameter_set="/robot_control",
)
