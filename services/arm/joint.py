"""The joint as its states tell it."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.sensor import JointState
from services.runtime.step import STEP_NS


class JointReading(NamedTuple):
    """Angle [deg], and rate [deg/s]: the mean over ``span`` [ns] until the angle was taken."""

    angle: float
    rate: float
    span: int


class JointReader:
    """Takes the angle and the rate of one joint out of joint states.

    The rate is the change of the angle since the states that were read before: a mean over a control period, in which
    nothing is left out, and so the first stage of the law's filter. It lies between the velocities that are told at
    both ends, so an arm that is put elsewhere has not moved fast. After a gap it is the velocity that is told, which is
    the mean over the engine's last step.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.error = ""
        self._last: tuple[int, JointReading] | None = None
        self._reported_rate = 0.0

    def read(self, state: JointState, longest: int) -> JointReading | None:
        """The joint; None, with ``trouble``, when the states do not tell its angle.

        States that are read more than ``longest`` [ns] after those before make a gap.
        """
        if self.name not in state.name or not state.position:
            names = ", ".join(state.name) or "none"
            self.error = f"the joint states have no position of {self.name!r} (only of: {names})"
            return None
        index, stamp = state.name.index(self.name), state.header.stamp.ns
        angle = math.degrees(state.position[index])
        told = math.degrees(state.velocity[index]) if state.velocity else None
        if self._last is None or stamp < self._last[0]:
            reading = JointReading(angle, told or 0.0, STEP_NS)
        elif stamp == self._last[0]:
            return self._last[1]
        elif (span := stamp - self._last[0]) <= longest or told is None:
            mean = (angle - self._last[1].angle) / (span * 1e-9)
            reading = JointReading(angle, mean if told is None else sorted((self._reported_rate, mean, told))[1], span)
        else:
            reading = JointReading(angle, told, STEP_NS)
        self._last, self._reported_rate = (stamp, reading), told or 0.0
        return reading
