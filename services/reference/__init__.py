"""The reference service: where the arm should be, fifty times a second."""

from __future__ import annotations

from typing import Literal

from messages.joints import LowerEnd, UpperEnd
from services.runtime import Parameters, Service, param


class ReferenceParameters(Parameters, frozen=True, kw_only=True):
    """What to publish. Names as in the tutorial where it has one; its reference_type 0 is step here, its 1 is sine."""

    reference_type: Literal["step", "sine", "ramp", "square", "chirp", "csv"] = param(
        "step", text="step: ref_angle at once; ramp: ref_angle at ramp_rate; csv: the table of the file"
    )
    ref_angle: float = param(0.0, -360, 360, "deg", "angle of step, and where ramp ends")
    sin_ref_gain: float = param(30.0, 0, 360, "deg", "amplitude of sine, square and chirp")
    sin_ref_f: float = param(0.2, 0, 10, "Hz", "frequency of sine and square")
    ramp_rate: float = param(10.0, 0.1, 1000, "deg/s", "speed of ramp")
    chirp_from: float = param(0.1, 0, 10, "Hz", "frequency at which chirp begins")
    chirp_to: float = param(1.0, 0, 10, "Hz", "frequency that chirp reaches, evenly, and keeps")
    chirp_time: float = param(20.0, 0.1, 3600, "s", "how long chirp takes to get there")
    csv: str = param(
        "",
        text="file of rows time [s], angle [deg], for csv; an absolute path, or one from the run's folder",
        max_length=4096,
        live=False,
    )
    csv_repeat: bool = param(False, text="begin the file again after its last row")
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="reference",
    about="publishes the angle that the arm should take: step, sine, ramp, square, chirp or a file",
    run="services.reference.loop:run",
    rate=50,
    parameters=ReferenceParameters,
    parameter_set="/robot_control",
)
