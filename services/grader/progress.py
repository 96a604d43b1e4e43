"""A robot's progress along its plan, judged by where it truly is."""

from __future__ import annotations

import math

from messages.elea import GoalStatus
from services.grader.reference import Point, Reference


class Progress:
    """Which goal is pursued, which were reached and when, and the distance from the reference path.

    The robot's status says which goal it pursues. A robot that reports none is taken to pursue its goals in turn. That
    a goal was reached is never taken from the robot: ground truth must come within ``tolerance`` [m].
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._goals: tuple[Point, ...] = ()
        self._here: Point | None = None
        self._index = 0
        self._reports = False
        self._squares, self._count = 0.0, 0
        self.reference: Reference | None = None
        self.reached_at: list[float | None] = []
        self.closest: list[float] = []
        self.largest = 0.0
        self.finished_at: float | None = None

    @property
    def rms(self) -> float | None:
        """Root mean square of the cross-track error [m] from the plan's start to its end; None before."""
        return math.sqrt(self._squares / self._count) if self._count else None

    def plan(self, goals: tuple[Point, ...]) -> None:
        """A new plan begins where the robot is; the same one again (its driver was restarted) changes nothing."""
        if goals == self._goals:
            return
        self._goals, self._index, self.finished_at = goals, 0, None
        self.reached_at, self.closest = [None] * len(goals), [math.inf] * len(goals)
        self.reference = Reference(self._here, goals) if self._here and goals else None

    def status(self, status: GoalStatus) -> None:
        """The robot says which goal it pursues, or that it has finished."""
        self._reports = True
        self._index = min(status.index, max(0, len(self._goals) - 1))
        finished = status.state == "finished"
        self.finished_at = (self.finished_at or status.header.stamp.ns / 1e9) if finished else None

    def at(self, time: float, here: Point) -> float:
        """The robot is truly ``here`` [m] at ``time`` [s]; returns the cross-track error [m], nan without a plan."""
        self._here = here
        if self.reference is None:
            if not self._goals:
                return math.nan
            self.reference = Reference(here, self._goals)
        index = self._index
        off = self.reference.cross_track(index, *here)
        if self.finished_at is None:
            self._squares, self._count = self._squares + off * off, self._count + 1
            self.largest = max(self.largest, off)
        self._approach(index, time, math.hypot(here[0] - self._goals[index][0], here[1] - self._goals[index][1]))
        return off

    def _approach(self, index: int, time: float, distance: float) -> None:
        self.closest[index] = min(self.closest[index], distance)
        if distance > self._tolerance:
            return
        if self.reached_at[index] is None:
            self.reached_at[index] = time
        if self._reports:
            return
        if index + 1 < len(self._goals):
            self._index = index + 1
        elif self.finished_at is None:
            self.finished_at = time
