"""The arm controller: gains, the default PID, the tutorial's PID, and bumpless transfer between them.

In the tutorial's law, the derivative is that of the error, so that a step in the reference causes a torque spike that
only the saturation bounds. The windup guard bounds the summed error, not the integral term: 20 deg s times 0.3 are
6 N m, less than the arm's weight. Switching the controller changes the gains while the sums stay, which causes a bump.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from services.arm import ArmParameters


class Gains(NamedTuple):
    """Gains and limits of the PID controller.

    Attributes:
        kp: Proportional gain [N m/deg].
        ki: Integral gain [N m/(deg s)].
        kd: Derivative gain [N m s/deg].
        set_point_weight: Weight of the reference in the derivative. The set-point controller has 0, so that a step in
            the reference causes no torque spike; the tracking controller has 1, as it would lag by kd / kp otherwise.
        saturation: Largest effort [N m].
        derivative_filter: Time constant of the rate filter [s].
        gravity_torque: Weight of the arm times its lever [N m]; 0 disables the gravity feed-forward.
        gravity_rest: Angle at which the arm hangs [deg].
        inertia: Moment of inertia about the joint [kg m2]; 0 disables the inertia feed-forward.
    """

    kp: float
    ki: float
    kd: float
    set_point_weight: float
    saturation: float
    derivative_filter: float
    gravity_torque: float
    gravity_rest: float
    inertia: float

    def gravity_compensation(self, angle: float) -> float:
        """Return the effort [N m] that holds the arm at ``angle`` [deg]; 0 without gravity feed-forward."""
        return self.gravity_torque * math.sin(math.radians(angle - self.gravity_rest))

    def inertia_feedforward(self, acceleration: float) -> float:
        """Return the effort [N m] for an ``acceleration`` [deg/s2]; 0 without inertia feed-forward."""
        return self.inertia * math.radians(acceleration)


def select_gains(p: ArmParameters) -> Gains:
    """Return the gains of the selected controller."""
    tracking = p.controller_type == "tr"
    kp, ki, kd = (p.tr_Kp, p.tr_Ki, p.tr_Kd) if tracking else (p.ss_Kp, p.ss_Ki, p.ss_Kd)
    torque, inertia = (p.gravity_torque, p.inertia * tracking) if p.gravity else (0.0, 0.0)
    return Gains(kp, ki, kd, float(tracking), p.saturation, p.derivative_filter, torque, p.gravity_rest, inertia)


BLEND_S = 0.2
"""Time constant [s] with which the bump compensation after a change of gains decays."""


class ControlInput(NamedTuple):
    """Set-point and measurement at one instant: angles [deg], rates [deg/s], set-point acceleration [deg/s2].

    Both rates are averaged over the same time span before the instant.
    """

    set_point: float
    set_point_rate: float
    angle: float
    rate: float
    set_point_acceleration: float = 0.0

    @property
    def error(self) -> float:
        """Set-point minus angle [deg]."""
        return self.set_point - self.angle


class Pid:
    """The default PID: u = kp e + i + kd (w r' - q') + g(q) + m(r'') + b, within the saturation.

    e is the error, i the integral of ki e, r' and q' the rates of reference and arm after a first-order filter, w the
    set-point weight, g the gravity and m the inertia feed-forward. b compensates the bump that a change of gains would
    cause, and decays with BLEND_S. The integral is an effort, so that a new ki does not rescale it; if ki becomes 0, it
    moves into b. In saturation, back-calculation with the time constant sqrt(Ti Td) reduces the integral, at most to 0:
    saturation caused by the proportional and derivative terms alone winds nothing up, in either direction.
    """

    def __init__(self) -> None:
        self.integral = self.bump = 0.0
        self._filtered_rate: float | None = None
        self._filtered_set_point_rate = 0.0
        self._gains: Gains | None = None

    def step(self, gains: Gains, inputs: ControlInput, dt: float, last: float | None = None) -> float:
        """Return the effort [N m].

        Args:
            gains: The gains, which may change at every step.
            inputs: Set-point and measurement.
            dt: Time since the step before [s]; 0 if unknown.
            last: Effort of another control law at the step before [N m], for bumpless transfer.
        """
        self._filter(gains.derivative_filter, inputs, dt)
        self.bump *= math.exp(-dt / BLEND_S)
        if last is not None:
            self.bump += last - self._sum(gains, inputs)
        elif self._gains is not None and gains != self._gains:
            before = self._sum(self._gains, inputs)
            if gains.ki == 0:
                self.integral = 0.0
            self.bump += before - self._sum(gains, inputs)
        self._gains = gains
        unlimited = self._sum(gains, inputs)
        effort = max(-gains.saturation, min(gains.saturation, unlimited))
        self._integrate(gains, inputs.error, effort - unlimited, dt)
        return effort

    def _sum(self, gains: Gains, inputs: ControlInput) -> float:
        rate = gains.set_point_weight * self._filtered_set_point_rate - (self._filtered_rate or 0.0)
        ahead = gains.gravity_compensation(inputs.angle) + gains.inertia_feedforward(inputs.set_point_acceleration)
        return gains.kp * inputs.error + self.integral + gains.kd * rate + ahead + self.bump

    def _filter(self, constant: float, inputs: ControlInput, dt: float) -> None:
        if self._filtered_rate is None or dt <= 0:
            self._filtered_rate, self._filtered_set_point_rate = (
                inputs.rate,
                inputs.set_point_rate,
            )  # the filtered rates are from before a gap
        share = 1.0 - math.exp(-dt / constant) if constant > 0 else 1.0
        self._filtered_rate += share * (inputs.rate - self._filtered_rate)
        self._filtered_set_point_rate += share * (inputs.set_point_rate - self._filtered_set_point_rate)

    def _integrate(self, gains: Gains, error: float, cut: float, dt: float) -> None:
        if gains.ki == 0:
            return
        self.integral += gains.ki * error * dt
        if cut * self.integral < 0:
            constant = math.sqrt(gains.kd / gains.ki)  # sqrt(Ti Td), Ti = kp / ki and Td = kd / kp
            correction = cut * min(1.0, dt / constant) if constant > 0 else cut
            self.integral += math.copysign(min(abs(correction), abs(self.integral)), correction)
        self.integral = max(-gains.saturation, min(gains.saturation, self.integral))


class TutorialPid:
    """The tutorial's PID: u = kp e + ki s + kd de/dt, within the saturation; s sums e dt within the windup guard."""

    def __init__(self) -> None:
        self.error_sum = 0.0
        self._error: float | None = None

    def step(self, gains: Gains, guard: float, error: float, angle: float, dt: float) -> float:
        """Return the effort [N m].

        Args:
            gains: The gains.
            guard: Limit of the summed error [deg s].
            error: Set-point minus angle [deg].
            angle: Angle [deg], for the gravity feed-forward, which the tutorial does not have.
            dt: Time since the step before [s]; 0 if unknown.
        """
        slope = (error - self._error) / dt if self._error is not None and dt > 0 else 0.0
        self._error = error
        self.error_sum = max(-guard, min(guard, self.error_sum + error * dt))
        unlimited = gains.kp * error + gains.ki * self.error_sum + gains.kd * slope + gains.gravity_compensation(angle)
        return max(-gains.saturation, min(gains.saturation, unlimited))


class ArmController:
    """Computes the effort by the selected control law, with bumpless transfer between the laws."""

    def __init__(self) -> None:
        self._law = ""
        self._pid, self._tutorial_pid = Pid(), TutorialPid()
        self._effort: float | None = None

    @property
    def integral(self) -> float:
        """The integral of the error: N m in the default law, deg s in the tutorial's."""
        return self._tutorial_pid.error_sum if self._law == "tutorial" else self._pid.integral

    def step(self, p: ArmParameters, inputs: ControlInput, dt: float) -> float:
        """Return the effort [N m]; ``dt`` is the time since the step before [s], 0 if unknown."""
        gains = select_gains(p)
        changed = p.law != self._law
        self._law = p.law
        if p.law == "tutorial":
            self._tutorial_pid = TutorialPid() if changed else self._tutorial_pid
            self._effort = self._tutorial_pid.step(gains, p.windup_guard, inputs.error, inputs.angle, dt)
        else:
            last = self._effort if changed else None
            self._pid = Pid() if changed else self._pid
            self._effort = self._pid.step(gains, inputs, dt, last)
        return self._effort
