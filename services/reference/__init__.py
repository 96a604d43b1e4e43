"""The reference service: where the arm should be, fifty times a second."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from messages.joints import LowerEnd, UpperEnd
from messages.topics import REFERENCE
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


def _number(low: float, high: float, unit: str, text: str) -> Meta:
    return Meta(ge=low, le=high, description=text, extra={"unit": unit})


class ReferenceParameters(Parameters, frozen=True, kw_only=True):
    """What to publish. Names as in the tutorial where it has one; its reference_type 0 is step here, its 1 is sine."""

    reference_type: Annotated[
        Literal["step", "sine", "ramp", "square", "chirp", "csv"],
        Meta(description="step: ref_angle at once; ramp: ref_angle at ramp_rate; csv: the table of the file"),
    ] = "step"
    ref_angle: Annotated[float, _number(-360, 360, "deg", "angle of step, and where ramp ends")] = 0.0
    sin_ref_gain: Annotated[float, _number(0, 360, "deg", "amplitude of sine, square and chirp")] = 30.0
    sin_ref_f: Annotated[float, _number(0, 10, "Hz", "frequency of sine and square")] = 0.2
    ramp_rate: Annotated[float, _number(0.1, 1000, "deg/s", "speed of ramp")] = 10.0
    chirp_from: Annotated[float, _number(0, 10, "Hz", "frequency at which chirp begins")] = 0.1
    chirp_to: Annotated[float, _number(0, 10, "Hz", "frequency that chirp reaches, evenly, and keeps")] = 1.0
    chirp_time: Annotated[float, _number(0.1, 3600, "s", "how long chirp takes to get there")] = 20.0
    csv: Annotated[
        str,
        Meta(
            max_length=4096,
            description="file of rows time [s], angle [deg], for csv; an absolute path, or one from the run's folder",
            extra={"live": False},
        ),
    ] = ""
    csv_repeat: Annotated[bool, Meta(description="begin the file again after its last row")] = False
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="reference",
    about="publishes the angle that the arm should take: step, sine, ramp, square, chirp or a file",
    run="services.reference.loop:run",
    writes=(REFERENCE,),
    rate=50,
    parameters=ReferenceParameters,
    parameter_set="/robot_control",
)
