"""The reference service: publishes the arm's set-point at 50 Hz."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.joints import LowerEnd, UpperEnd
from messages.topics import REFERENCE
from services.runtime.service import Parameters, Service


def _number(low: float, high: float, unit: str, text: str) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit})


class ReferenceParameters(Parameters, frozen=True, kw_only=True):
    """Parameters of the reference, named as in the tutorial, whose reference_type 0 is step here and 1 is sine."""

    reference_type: Annotated[
        Literal["step", "sine", "ramp", "square", "chirp", "csv"],
        Meta(description="Waveform: step jumps to ref_angle, ramp moves there at ramp_rate, csv reads a file."),
    ] = "step"
    ref_angle: Annotated[float, _number(-360, 360, "deg", "Angle of the step, and final angle of the ramp.")] = 0.0
    sin_ref_gain: Annotated[float, _number(0, 360, "deg", "Amplitude of sine, square and chirp.")] = 30.0
    sin_ref_f: Annotated[float, _number(0, 10, "Hz", "Frequency of sine and square.")] = 0.2
    ramp_rate: Annotated[float, _number(0.1, 1000, "deg/s", "Rate of the ramp.")] = 10.0
    chirp_from: Annotated[float, _number(0, 10, "Hz", "Start frequency of the chirp.")] = 0.1
    chirp_to: Annotated[float, _number(0, 10, "Hz", "End frequency of the chirp, reached linearly and then kept.")] = (
        1.0
    )
    chirp_time: Annotated[float, _number(0.1, 3600, "s", "Time the chirp takes to reach its end frequency.")] = 20.0
    csv: Annotated[
        str,
        Meta(
            max_length=4096,
            description="CSV file with rows of time [s], angle [deg]; relative to the run's folder.",
            extra={"live": False},
        ),
    ] = ""
    csv_repeat: Annotated[bool, Meta(description="Start the file again after its last row.")] = False
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="reference",
    about="Publishes the arm's set-point: step, sine, ramp, square, chirp or a file.",
    run="services.reference.loop:run",
    writes=(REFERENCE,),
    rate=50,
    parameters=ReferenceParameters,
    parameter_set="/robot_control",
)
