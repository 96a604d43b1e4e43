"""What an arm is put through: its set-point taken apart into steps and motions, each measured in its own way."""

from __future__ import annotations

import math

from services.grader.records import StepFigures
from services.grader.response import Step

REST_S = 0.5
"""A set-point that keeps its value for so long rests; one that changes sooner is in motion."""
TRANSIENT_S = 1.0
"""Of each motion, so much of the beginning is left out."""
SMALLEST = 1.0
"""deg; a smaller change of a resting set-point is no step to measure."""


class Tracking:
    """Root mean square and maximum of the error in motion.

    A set-point that comes less often than the controller acts is a staircase, and within a stair nothing can follow it:
    the error is the mean over the ticks that share one set-point.
    """

    def __init__(self) -> None:
        self.largest = self._squares = 0.0
        self._count = 0
        self._stair: list[float] = []
        self._since = math.inf

    @property
    def rms(self) -> float | None:
        """deg; None when nothing moved."""
        return math.sqrt(self._squares / self._count) if self._count else None

    def begin(self, time: float) -> None:
        """A motion begins at ``time`` [s]."""
        self._since, self._stair = time, []

    def end(self) -> None:
        """The set-point rests; what came since its last change counts no more."""
        self._since, self._stair = math.inf, []

    def at(self, error: float) -> None:
        """The error [deg] at one tick of the present set-point."""
        self._stair.append(error)

    def stair(self, time: float) -> None:
        """The next set-point comes at ``time`` [s]."""
        if self._stair and time - self._since > TRANSIENT_S:
            error = sum(self._stair) / len(self._stair)
            self._squares, self._count = self._squares + error * error, self._count + 1
            self.largest = max(self.largest, abs(error))
        self._stair = []


class Exercise:
    """Takes set-point and true angle, tick by tick."""

    def __init__(self) -> None:
        self.tracking = Tracking()
        self._steps: list[Step] = []
        self._step: Step | None = None
        self._set_point: float | None = None
        self._changed = 0.0
        self._moving = False

    @property
    def steps(self) -> tuple[StepFigures, ...]:
        """The steps that could be measured, in order."""
        return tuple(found for each in self._steps if (found := each.figures()) is not None)

    @property
    def largest(self) -> StepFigures | None:
        """The largest of the steps, the first of equals."""
        return max(self.steps, key=lambda each: abs(each.to_deg - each.from_deg), default=None)

    def rests(self, time: float) -> float:
        """For how long the set-point has rested at ``time``, s."""
        return 0.0 if self._set_point is None or self._moving else time - self._changed

    def at(self, time: float, set_point: float, angle: float) -> None:
        """At ``time`` [s] the arm should be at ``set_point`` and truly is at ``angle`` [deg]."""
        if self._set_point is None:
            self._set_point, self._changed = set_point, time
        if set_point != self._set_point:
            self._change(time, self._set_point, set_point)
        elif self._moving and time - self._changed >= REST_S:
            self._moving = False
            self.tracking.end()
        if self._step is not None:
            self._step.add(time, angle)
        if self._moving:
            self.tracking.at(set_point - angle)

    def _change(self, time: float, before: float, after: float) -> None:
        if self._moving:
            self.tracking.stair(time)
        elif time - self._changed >= REST_S:
            self._step = Step(time, before, after) if abs(after - before) >= SMALLEST else None
            self._steps += [self._step] if self._step else []
        else:
            # The change before this one was the beginning of a motion, and no step.
            if self._step is not None and self._step.begin == self._changed:
                self._steps.remove(self._step)
            self._step, self._moving = None, True
            self.tracking.begin(self._changed)
        self._set_point, self._changed = after, time
