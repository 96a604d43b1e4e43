"""The arm service: it takes one joint to where the reference is, by effort."""

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
    """How to control. Errors are in degrees and efforts in N m, so gains are N m per degree, as in the tutorial."""

    controller_type: Annotated[
        Literal["ss", "tr"],
        Meta(description="ss: set-point PD, the tutorial's 0; tr: tracking PID, its 1"),
    ] = "ss"
    ss_Kp: Annotated[float, _number(0, 1000, "N m/deg", "set-point: effort per error")] = 37.5
    ss_Ki: Annotated[float, _number(0, 1000, "N m/(deg s)", "set-point: effort per summed error")] = 0.0
    ss_Kd: Annotated[float, _number(0, 100, "N m s/deg", "set-point: effort per rate")] = 2.8
    tr_Kp: Annotated[float, _number(0, 1000, "N m/deg", "tracking: effort per error")] = 38.5
    tr_Ki: Annotated[float, _number(0, 1000, "N m/(deg s)", "tracking: effort per summed error")] = 0.3
    tr_Kd: Annotated[float, _number(0, 100, "N m s/deg", "tracking: effort per rate")] = 1.3
    law: Annotated[
        Literal["default", "tutorial"],
        Meta(description="default: filtered rates, back-calculation, no bumps; seed: the original's own, for teaching"),
    ] = "default"
    saturation: Annotated[float, _number(0, 1000, "N m", "largest effort")] = 200.0
    windup_guard: Annotated[float, _number(0, 10_000, "deg s", "seed: bound of the summed error")] = 20.0
    derivative_filter: Annotated[
        float,
        _number(0, 0.02, "s", "default: time constant of the filter of the rate, a period's mean; 0 is none"),
    ] = 0.001
    gravity: Annotated[
        bool,
        Meta(
            description="feed forward what holds the arm's weight; in tracking, by the default law, also what moves it"
        ),
    ] = False
    gravity_torque: Annotated[
        float, _number(0, 100_000, "N m", "the arm's weight times the distance of its centre of mass", live=False)
    ] = 27.148
    gravity_rest: Annotated[float, _number(-360, 360, "deg", "angle at which it hangs at rest", live=False)] = -1.4635
    inertia: Annotated[float, _number(0, 100_000, "kg m2", "the arm's inertia about the joint", live=False)] = 3.8655
    rate: Annotated[
        float, _number(40, 200, "Hz", "control rate; in lockstep a whole number of physics steps", live=False)
    ] = 100.0
    duration: Annotated[
        float, _number(0.0, 1.0, "s", "how long an effort acts if no other follows; at least two periods")
    ] = 0.1
    reference_timeout: Annotated[float, _number(0.05, 10, "s", "without a reference for longer it is given up")] = 0.5
    state_timeout: Annotated[float, _number(0.02, 1, "s", "without joint states for longer the arm is let go")] = 0.1
    joint: Annotated[str, Meta(max_length=255, description="the joint to move", extra={"live": False})] = "bear_link"
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="arm",
    about="takes a joint to where the reference is, by effort: set-point PD or tracking PID",
    run="services.arm.loop:run",
    reads=(JOINT_STATES, REFERENCE),
    writes=(JOINT_EFFORT, CONTROL_SIGNAL, JOINT_ANGLE, CONTROL_ERROR, CONTROL_STATE),
    rate=100,
    parameters=ArmParameters,
    parameter_set="/robot_control",
)
