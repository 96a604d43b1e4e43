"""Angle and rate of one joint, from joint states."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.sensor import JointState
from services.runtime.step import STEP_NS


class JointReading(NamedTuple):
    """Angle [deg], and rate [deg/s] averaged over the ``span`` [ns] before the angle was measured."""

    angle: float
    rate: float
    span: int


class JointReader:
    """Extracts the angle and rate of one joint from joint states.

    The rate is the change of the angle since the states read before: the mean over a control period, which serves as
    the first stage of the control law's filter. It is limited to the range of the velocities reported at both ends, so
    that an arm that is repositioned does not appear to move fast. After a gap, it is the reported velocity, the mean
    over the engine's last step.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.error = ""
        self._last: tuple[int, JointReading] | None = None
        self._reported_rate = 0.0

    def read(self, state: JointState, longest: int) -> JointReading | None:
        """Return the joint's reading; None, with the reason in ``error``, if the states do not contain its angle.

        Args:
            state: The latest joint states.
            longest: Time between two states [ns] beyond which it counts as a gap.
        """
        if self.name not in state.name or not state.position:
            names = ", ".join(state.name) or "none"
            self.error = f"the joint states have no position of {self.name!r} (only of: {names})"
            return None
        index, stamp = state.name.index(self.name), state.header.stamp.ns
        angle = math.degrees(state.position[index])
        reported = math.degrees(state.velocity[index]) if state.velocity else None
        if self._last is None or stamp < self._last[0]:
            reading = JointReading(angle, reported or 0.0, STEP_NS)
        elif stamp == self._last[0]:
            return self._last[1]
        elif (span := stamp - self._last[0]) <= longest or reported is None:
            mean = (angle - self._last[1].angle) / (span * 1e-9)
            reading = JointReading(
                angle, mean if reported is None else sorted((self._reported_rate, mean, reported))[1], span
            )
        else:
            reading = JointReading(angle, reported, STEP_NS)
        self._last, self._reported_rate = (stamp, reading), reported or 0.0
        return reading
