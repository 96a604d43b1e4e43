"""What a control law goes by: the gains of the chosen controller, its limits, and the weight of the arm."""

from __future__ import annotations

import math
from typing import NamedTuple

from services.arm import ArmParameters


class Gains(NamedTuple):
    """N m per degree, degree second, and degree per second; ``weight`` is the reference's share in the derivative.

    The set-point controller acts on the rate of the arm alone: a jump of the reference is no kick. The tracking one
    acts on the rate of the error: it would lag by kd / kp seconds without. ``torque`` [N m] is 0 where the weight of
    the arm is not fed forward, ``rest`` [deg] where it hangs; ``inertia`` [kg m2] is 0 where its motion is not.
    """

    kp: float
    ki: float
    kd: float
    weight: float
    saturation: float
    filter: float
    torque: float
    rest: float
    inertia: float

    def holding(self, angle: float) -> float:
        """The effort [N m] that holds the arm at ``angle`` [deg] against its weight, as far as that is fed forward."""
        return self.torque * math.sin(math.radians(angle - self.rest))

    def moving(self, acceleration: float) -> float:
        """The effort [N m] that an ``acceleration`` [deg/s2] takes, as far as that is fed forward."""
        return self.inertia * math.radians(acceleration)


def gains_of(p: ArmParameters) -> Gains:
    """The gains of the controller that ``p`` chooses."""
    tracking = p.controller_type == "tr"
    kp, ki, kd = (p.tr_Kp, p.tr_Ki, p.tr_Kd) if tracking else (p.ss_Kp, p.ss_Ki, p.ss_Kd)
    torque, inertia = (p.gravity_torque, p.inertia * tracking) if p.gravity else (0.0, 0.0)
    return Gains(kp, ki, kd, float(tracking), p.saturation, p.derivative_filter, torque, p.gravity_rest, inertia)
