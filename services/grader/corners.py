"""Corner and closure errors of a robot on a closed path with a heading at each corner."""

from __future__ import annotations

import math
from dataclasses import dataclass

from messages.elea import GoalStatus
from messages.se2 import Pose2, wrap
from services.grader.records import CornerFigures

CLOSURE_TOLERANCE = 1e-6
"""Tolerance [m, rad] for a plan to count as closed; plans have double precision."""


@dataclass(frozen=True, slots=True)
class Closure:
    """Distance [m] and angle [deg] between start and end, by ground truth and by odometry; None before the end."""

    true_m: float | None = None
    true_deg: float | None = None
    odometry_m: float | None = None
    odometry_deg: float | None = None


def is_closed(goals: tuple[Pose2, ...]) -> bool:
    """Whether goals form a closed path: at least three, each heading to the next, the last to the first.

    A square does; a list of points without headings does not, since their yaw is 0 while a closed path turns.
    """
    if len(goals) < 3:
        return False
    for here, there in zip(goals, (*goals[1:], goals[0]), strict=True):
        dx, dy = there.x - here.x, there.y - here.y
        if math.hypot(dx, dy) < CLOSURE_TOLERANCE or abs(wrap(math.atan2(dy, dx) - here.yaw)) > CLOSURE_TOLERANCE:
            return False
    return True


class CornerMetrics:
    """Corner errors of one robot, if its plan is closed. All poses are in the world frame.

    A corner is measured when the robot reports reaching it, the closure when it reports finishing.
    """

    def __init__(self) -> None:
        self.corners: list[CornerFigures | None] = []
        self.closure = Closure()
        self._goals: tuple[Pose2, ...] = ()
        self._start: tuple[Pose2, Pose2] | None = None
        self._pending: list[GoalStatus] = []

    def set_plan(self, goals: tuple[Pose2, ...]) -> None:
        """Set the plan; setting the same one again has no effect."""
        if goals == self._goals:
            return
        self._goals, self._start, self._pending, self.closure = goals, None, [], Closure()
        self.corners = [None] * len(goals) if is_closed(goals) else []

    def add_status(self, status: GoalStatus) -> None:
        """Process the robot's report that it has reached a corner, or finished."""
        if self.corners and status.state in ("reached", "finished"):
            self._pending.append(status)

    def add_poses(self, time: float, true: Pose2, odometry: Pose2) -> None:
        """Add the true pose at ``time`` [s] and the pose by ``odometry``, which is nan if unknown."""
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
