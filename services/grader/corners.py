"""Corners and closure: how well a robot keeps to a closed way that asks for a heading at each of its corners."""

from __future__ import annotations

import math
from dataclasses import dataclass

from messages.elea import GoalStatus
from messages.se2 import Pose2, wrap
from services.grader.records import CornerFigures

CLOSURE_TOLERANCE = 1e-6
"""m and rad by which a plan may miss being closed; it is made in double precision."""


@dataclass(frozen=True, slots=True)
class Closure:
    """How far from where its way began a robot ended, truly and by odometry, m and degrees; None before."""

    true_m: float | None = None
    true_deg: float | None = None
    odometry_m: float | None = None
    odometry_deg: float | None = None


def is_closed(goals: tuple[Pose2, ...]) -> bool:
    """Whether goals are corners: at least three, each with the heading of the leg to the next, the last to the first.

    A square does so. A list of points with free headings does not: their yaw is 0, and a closed way turns.
    """
    if len(goals) < 3:
        return False
    for here, there in zip(goals, (*goals[1:], goals[0]), strict=True):
        dx, dy = there.x - here.x, there.y - here.y
        if math.hypot(dx, dy) < CLOSURE_TOLERANCE or abs(wrap(math.atan2(dy, dx) - here.yaw)) > CLOSURE_TOLERANCE:
            return False
    return True


class CornerMetrics:
    """The corners of one robot's plan, if that is closed. All poses are in the world.

    A corner is measured where the robot says that it has reached it, the closure where it says that it has finished.
    """

    def __init__(self) -> None:
        self.corners: list[CornerFigures | None] = []
        self.closure = Closure()
        self._goals: tuple[Pose2, ...] = ()
        self._start: tuple[Pose2, Pose2] | None = None
        self._pending: list[GoalStatus] = []

    def set_plan(self, goals: tuple[Pose2, ...]) -> None:
        """A new plan; the same one again changes nothing."""
        if goals == self._goals:
            return
        self._goals, self._start, self._pending, self.closure = goals, None, [], Closure()
        self.corners = [None] * len(goals) if is_closed(goals) else []

    def add_status(self, status: GoalStatus) -> None:
        """The robot says that it has reached a corner, or finished."""
        if self.corners and status.state in ("reached", "finished"):
            self._pending.append(status)

    def add_poses(self, time: float, true: Pose2, odometry: Pose2) -> None:
        """The robot is truly at ``true`` at ``time`` [s], and by ``odometry``; the latter is nan when not known."""
        if not self.corners or math.isnan(odometry.x):
            return
        if self._start is None:
            self._start = true, odometry
        for status in self._pending:
            if status.state == "finished":
                if self.closure.true_m is None:
                    self.closure = _closure(_difference(true, self._start[0]), _difference(odometry, self._start[1]))
            elif status.index < len(self.corners) and self.corners[status.index] is None:
                goal = self._goals[status.index]
                self.corners[status.index] = _corner_figures(time, _difference(true, goal), _difference(odometry, goal))
        self._pending = []


def _difference(here: Pose2, goal: Pose2) -> Pose2:
    return Pose2(here.x - goal.x, here.y - goal.y, wrap(here.yaw - goal.yaw))


def _closure(true: Pose2, odometry: Pose2) -> Closure:
    return Closure(
        math.hypot(true.x, true.y),
        math.degrees(abs(true.yaw)),
        math.hypot(odometry.x, odometry.y),
        math.degrees(abs(odometry.yaw)),
    )


def _corner_figures(time: float, true: Pose2, odometry: Pose2) -> CornerFigures:
    return CornerFigures(
        at_s=time,
        true_m=math.hypot(true.x, true.y),
        true_deg=math.degrees(true.yaw),
        odometry_m=math.hypot(odometry.x, odometry.y),
        odometry_deg=math.degrees(odometry.yaw),
    )
