"""The joint as its states tell it."""

from __future__ import annotations

import math

from messages.sensor import JointState


class Joint:
    """Takes the angle and the rate of one joint out of joint states."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.trouble = ""
        self._last: tuple[int, float] | None = None
        self._rate = 0.0

    def read(self, state: JointState) -> tuple[float, float] | None:
        """Angle [deg] and rate [deg/s]; None, with ``trouble``, when the states do not tell the joint's angle.

        Without a velocity the rate is the change since the states before.
        """
        if self.name not in state.name or not state.position:
            names = ", ".join(state.name) or "none"
            self.trouble = f"the joint states tell no angle of {self.name!r} (they have: {names})"
            return None
        index, stamp = state.name.index(self.name), state.header.stamp.ns
        angle = math.degrees(state.position[index])
        if state.velocity:
            return angle, math.degrees(state.velocity[index])
        if self._last is not None and stamp > self._last[0]:
            self._rate = (angle - self._last[1]) / ((stamp - self._last[0]) * 1e-9)
        if self._last is None or stamp > self._last[0]:
            self._last = stamp, angle
        return angle, self._rate
