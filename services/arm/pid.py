"""The default law: PID with filtered rates, back-calculation against windup, and no bump at any change of its gains."""

from __future__ import annotations

import math
from typing import NamedTuple

from services.arm.gains import Gains

BLEND_S = 0.2
"""Time constant with which the difference that a change of gains makes is let in."""


class Sight(NamedTuple):
    """One instant: what is wanted, deg and deg/s, and what is, deg and deg/s; and the wanted acceleration, deg/s2.

    Both rates are means over the same time until now.
    """

    wanted: float
    wanted_rate: float
    angle: float
    rate: float
    wanted_acceleration: float = 0.0

    @property
    def error(self) -> float:
        """deg."""
        return self.wanted - self.angle


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
        self._damped: float | None = None
        self._damped_wanted = 0.0
        self._gains: Gains | None = None

    def step(self, gains: Gains, now: Sight, dt: float, last: float | None = None) -> float:
        """The effort [N m] at an instant, ``dt`` [s] after the one before; 0 when that is not known.

        ``last`` is the effort of another law at the instant before, to be taken over without a bump.
        """
        self._filter(gains.filter, now, dt)
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

    def _sum(self, gains: Gains, now: Sight) -> float:
        rate = gains.weight * self._damped_wanted - (self._damped or 0.0)
        ahead = gains.holding(now.angle) + gains.moving(now.wanted_acceleration)
        return gains.kp * now.error + self.integral + gains.kd * rate + ahead + self.bump

    def _filter(self, constant: float, now: Sight, dt: float) -> None:
        if self._damped is None or dt <= 0:
            self._damped, self._damped_wanted = now.rate, now.wanted_rate  # what was before is of another time
        share = 1.0 - math.exp(-dt / constant) if constant > 0 else 1.0
        self._damped += share * (now.rate - self._damped)
        self._damped_wanted += share * (now.wanted_rate - self._damped_wanted)

    def _integrate(self, gains: Gains, error: float, cut: float, dt: float) -> None:
        if gains.ki == 0:
            return
        self.integral += gains.ki * error * dt
        if cut * self.integral < 0:
            constant = math.sqrt(gains.kd / gains.ki)  # sqrt(Ti Td), Ti = kp / ki and Td = kd / kp
            draw = cut * min(1.0, dt / constant) if constant > 0 else cut
            self.integral += math.copysign(min(abs(draw), abs(self.integral)), draw)
        self.integral = max(-gains.saturation, min(gains.saturation, self.integral))
