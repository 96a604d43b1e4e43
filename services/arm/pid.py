"""The controller of the arm: gains, the default and the tutorial's PID, bumpless change between them.

The derivative is that of the error, so a step of the reference is a kick that only the saturation bounds. The guard
bounds the summed error, not its share of the effort: 20 deg s times 0.3 are 6 N m, less than the arm's weight. Changing
the controller changes the gains under the sums as they stand, which is a bump.
"""

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
    set_point_weight: float
    saturation: float
    derivative_filter: float
    gravity_torque: float
    gravity_rest: float
    inertia: float

    def gravity_compensation(self, angle: float) -> float:
        """The effort [N m] that holds the arm at ``angle`` [deg] against its weight, as far as that is fed forward."""
        return self.gravity_torque * math.sin(math.radians(angle - self.gravity_rest))

    def inertia_feedforward(self, acceleration: float) -> float:
        """The effort [N m] that an ``acceleration`` [deg/s2] takes, as far as that is fed forward."""
        return self.inertia * math.radians(acceleration)


def select_gains(p: ArmParameters) -> Gains:
    """The gains of the controller that ``p`` chooses."""
    tracking = p.controller_type == "tr"
    kp, ki, kd = (p.tr_Kp, p.tr_Ki, p.tr_Kd) if tracking else (p.ss_Kp, p.ss_Ki, p.ss_Kd)
    torque, inertia = (p.gravity_torque, p.inertia * tracking) if p.gravity else (0.0, 0.0)
    return Gains(kp, ki, kd, float(tracking), p.saturation, p.derivative_filter, torque, p.gravity_rest, inertia)


BLEND_S = 0.2
"""Time constant with which the difference that a change of gains makes is let in."""


class ControlInput(NamedTuple):
    """One instant: what is wanted, deg and deg/s, and what is, deg and deg/s; and the wanted acceleration, deg/s2.

    Both rates are means over the same time until now.
    """

    set_point: float
    set_point_rate: float
    angle: float
    rate: float
    set_point_acceleration: float = 0.0

    @property
    def error(self) -> float:
        """deg."""
        return self.set_point - self.angle


class Pid:
    """u = kp e + i + kd (w r' - q') + g(q) + m(r'') + b, within the saturation.

    e is the error, i the integral of ki e, r' and q' the rates of reference and arm through a first-order filter, w the
    reference's share, g the effort that holds the weight, m the one that moves it as the reference does, both where
    they are fed forward. b is the bump that a change of gains would make, taken out
    at once and let in with BLEND_S. The integral is an effort, so a new ki does not rescale it; without ki it goes
    into b. In saturation it is drawn back by what is cut off, with the time constant sqrt(Ti Td), to 0 at most:
    saturation that proportional and derivative bring about alone winds nothing up, in neither sense.
    """

    def __init__(self) -> None:
        self.integral = self.bump = 0.0
        self._filtered_rate: float | None = None
        self._filtered_set_point_rate = 0.0
        self._gains: Gains | None = None

    def step(self, gains: Gains, now: ControlInput, dt: float, last: float | None = None) -> float:
        """The effort [N m] at an instant, ``dt`` [s] after the one before; 0 when that is not known.

        ``last`` is the effort of another law at the instant before, to be taken over without a bump.
        """
        self._filter(gains.derivative_filter, now, dt)
        self.bump *= math.exp(-dt / BLEND_S)
        if last is not None:
            self.bump += last - self._sum(gains, now)
        elif self._gains is not None and gains != self._gains:
            before = self._sum(self._gains, now)
            if gains.ki == 0:
                self.integral = 0.0
            self.bump += before - self._sum(gains, now)
        self._gains = gains
        asked = self._sum(gains, now)
        effort = max(-gains.saturation, min(gains.saturation, asked))
        self._integrate(gains, now.error, effort - asked, dt)
        return effort

    def _sum(self, gains: Gains, now: ControlInput) -> float:
        rate = gains.set_point_weight * self._filtered_set_point_rate - (self._filtered_rate or 0.0)
        ahead = gains.gravity_compensation(now.angle) + gains.inertia_feedforward(now.set_point_acceleration)
        return gains.kp * now.error + self.integral + gains.kd * rate + ahead + self.bump

    def _filter(self, constant: float, now: ControlInput, dt: float) -> None:
        if self._filtered_rate is None or dt <= 0:
            self._filtered_rate, self._filtered_set_point_rate = (
                now.rate,
                now.set_point_rate,
            )  # what was before is of another time
        share = 1.0 - math.exp(-dt / constant) if constant > 0 else 1.0
        self._filtered_rate += share * (now.rate - self._filtered_rate)
        self._filtered_set_point_rate += share * (now.set_point_rate - self._filtered_set_point_rate)

    def _integrate(self, gains: Gains, error: float, cut: float, dt: float) -> None:
        if gains.ki == 0:
            return
        self.integral += gains.ki * error * dt
        if cut * self.integral < 0:
            constant = math.sqrt(gains.kd / gains.ki)  # sqrt(Ti Td), Ti = kp / ki and Td = kd / kp
            draw = cut * min(1.0, dt / constant) if constant > 0 else cut
            self.integral += math.copysign(min(abs(draw), abs(self.integral)), draw)
        self.integral = max(-gains.saturation, min(gains.saturation, self.integral))


class TutorialPid:
    """u = kp e + ki s + kd de/dt, within the saturation; s sums up e dt within the guard."""

    def __init__(self) -> None:
        self.error_sum = 0.0
        self._error: float | None = None

    def step(self, gains: Gains, guard: float, error: float, angle: float, dt: float) -> float:
        """The effort [N m] at an ``error`` [deg], ``dt`` [s] after the last; 0 when that is not known.

        ``guard`` [deg s]; ``angle`` [deg] is for the weight, which the tutorial does not feed forward.
        """
        slope = (error - self._error) / dt if self._error is not None and dt > 0 else 0.0
        self._error = error
        self.error_sum = max(-guard, min(guard, self.error_sum + error * dt))
        asked = gains.kp * error + gains.ki * self.error_sum + gains.kd * slope + gains.gravity_compensation(angle)
        return max(-gains.saturation, min(gains.saturation, asked))


class ArmController:
    """What is wanted and what is go in, the effort comes out. One that is new has no past."""

    def __init__(self) -> None:
        self._law = ""
        self._pid, self._tutorial_pid = Pid(), TutorialPid()
        self._effort: float | None = None

    @property
    def integral(self) -> float:
        """What the summed error stands at: N m in the default law, deg s in the tutorial's."""
        return self._tutorial_pid.error_sum if self._law == "tutorial" else self._pid.integral

    def step(self, p: ArmParameters, now: ControlInput, dt: float) -> float:
        """The effort [N m], ``dt`` [s] after the step before; 0 when that is not known."""
        gains = select_gains(p)
        changed = p.law != self._law
        self._law = p.law
        if p.law == "tutorial":
            self._tutorial_pid = TutorialPid() if changed else self._tutorial_pid
            self._effort = self._tutorial_pid.step(gains, p.windup_guard, now.error, now.angle, dt)
        else:
            last = self._effort if changed else None
            self._pid = Pid() if changed else self._pid
            self._effort = self._pid.step(gains, now, dt, last)
        return self._effort
