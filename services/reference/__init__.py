"""The reference service: publishes the arm's set-point at 50 Hz."""

from __future__ import annotations

from typing import Literal

from messages.joints import LowerEnd, UpperEnd
from services.runtime import Parameters, Service, param


class ReferenceParameters(Parameters):
    """Parameters of the reference, named as in the tutorial, whose reference_type 0 is step here and 1 is sine."""

    reference_type: Literal["step", "sine", "ramp", "square", "chirp", "csv"] = param(
        "step", text="Waveform: step jumps to ref_angle, ramp moves there at ramp_rate, csv reads a file."
    )
    ref_angle: float = param(0.0, -360, 360, "deg", "Angle of the step, and final angle of the ramp.")
    sin_ref_gain: float = param(30.0, 0, 360, "deg", "Amplitude of sine, square and chirp.")
    sin_ref_f: float = param(0.2, 0, 10, "Hz", "Frequency of sine and square.")
    ramp_rate: float = param(10.0, 0.1, 1000, "deg/s", "Rate of the ramp.")
    chirp_from: float = param(0.1, 0, 10, "Hz", "Start frequency of the chirp.")
    chirp_to: float = param(1.0, 0, 10, "Hz", "End frequency of the chirp, reached linearly and then kept.")
    chirp_time: float = param(20.0, 0.1, 3600, "s", "Time the chirp takes to reach its end frequency.")
    csv: str = param(
        "",
        text="CSV file with rows of time [s], angle [deg]; relative to the run's folder.",
        max_length=4096,
        live=False,
    )
    csv_repeat: bool = param(False, text="Start the file again after its last row.")
    lower: LowerEnd = -90.0
    upper: UpperEnd = 90.0


SERVICE = Service(
    name="reference",
    about="Publishes the arm's set-point: step, sine, ramp, square, chirp or a file.",
    run="services.reference.loop:run",
    rate=50,
    parameters=ReferenceParameters,
    parameter_set="/robot_control",
)
