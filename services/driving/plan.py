"""The plan of a robot: goals to reach in order, the progress on it, and both as messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from messages.elea import GoalStatus
from messages.errors import BadInput
from messages.geometry import Pose, PoseStamped
from messages.nav import Odometry, Path
from messages.se2 import Pose2, Twist2
from messages.std import Header


@dataclass(frozen=True, slots=True)
class Goal:
    """A point [m] to stop at, and the final heading [rad]; None for any heading."""

    x: float
    y: float
    yaw: float | None = None


NO_GOAL = Goal(0.0, 0.0)
"""Placeholder when there is no goal."""

MAX_PUBLISHED = 20_000
"""Maximum number of published goals, which take 3 MB. A longer plan is driven to its end, but published up to here."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Goals to reach in order; an endless plan restarts after the last."""

    goals: tuple[Goal, ...] = ()
    endless: bool = False

    @classmethod
    def through(cls, points: Sequence[tuple[float, float]], laps: int = 1, final_yaw: float | None = None) -> Plan:
        """Return the plan through ``points`` [m]: all laps in full, with the final heading [rad] on the last goal.

        ``laps`` = 0 makes the plan endless.
        """
        goals = tuple(Goal(x, y) for x, y in points) * max(1, laps)
        if goals and final_yaw is not None and laps:
            goals = (*goals[:-1], Goal(goals[-1].x, goals[-1].y, final_yaw))
        return cls(goals, endless=laps == 0)

    def next_index(self, index: int) -> int | None:
        """Return the index of the goal after ``index``; None after the last."""
        if index + 1 < len(self.goals):
            return index + 1
        return 0 if self.endless else None

    def previous_goal(self, index: int) -> Goal | None:
        """Return the goal before ``index``; None for the first."""
        return self.goals[index - 1] if index > 0 or self.endless else None


State = Literal["idle", "driving", "reached", "finished", "waiting"]


@dataclass(frozen=True, slots=True)
class Progress:
    """Result of one tick. ``command`` is None without a plan: an idle controller leaves the base to others."""

    state: State
    command: Twist2 | None
    index: int = 0
    count: int = 0
    goal: Goal = NO_GOAL
    distance: float = 0.0


def pose_and_twist(odometry: Odometry) -> tuple[Pose2, Twist2]:
    """Return the planar pose and velocity of an odometry message."""
    return Pose2.from_msg(odometry.pose.pose), Twist2.from_msg(odometry.twist.twist)


class PlanReporter:
    """Publishes the plan when it changes, and the status when the state or the goal does.

    Args:
        publish_plan: Publishes on PLAN.
        publish_status: Publishes on STATUS.
    """

    def __init__(self, publish_plan: Callable[[Path], object], publish_status: Callable[[GoalStatus], object]) -> None:
        self._publish_plan, self._publish_status = publish_plan, publish_status
        self._plan: Plan | None = None
        self._shown: tuple[State, int] | None = None

    def reset(self) -> None:
        """Publish the next plan even if it is the same."""
        self._plan = None

    def report_plan(self, plan: Plan, header: Header) -> None:
        """Publish the plan if it is new; its first status follows in any case."""
        if plan is not self._plan:
            self._plan, self._shown = plan, None
            self._publish_plan(path_message(plan, header))

    def report_status(self, progress: Progress, header: Header) -> bool:
        """Publish the status if it changed; return whether it did."""
        if self._shown == (progress.state, progress.index):
            return False
        self._shown = progress.state, progress.index
        self._publish_status(status_message(progress, header))
        return True


def plan_to_pose(goal_pose: PoseStamped, frame: str) -> Plan:
    """Return the plan to a pose with its heading; raises BadInput unless it is in the world or the odom ``frame``."""
    if goal_pose.header.frame_id not in ("", "world", frame):
        raise BadInput(f"goal refused: its frame {goal_pose.header.frame_id!r} is neither 'world' nor {frame!r}")
    return Plan((Goal(goal_pose.pose.position.x, goal_pose.pose.position.y, goal_pose.pose.orientation.yaw),))


def path_message(plan: Plan, header: Header) -> Path:
    """Return the plan as a message of at most MAX_PUBLISHED goals; goals with any heading have yaw 0."""
    goals = plan.goals[:MAX_PUBLISHED]
    return Path(header=header, poses=tuple(PoseStamped(header=header, pose=_pose(goal)) for goal in goals))


def status_message(progress: Progress, header: Header) -> GoalStatus:
    """Return the progress as a message."""
    return GoalStatus(
        header=header,
        state=progress.state,
        index=progress.index,
        count=progress.count,
        goal=_pose(progress.goal),
        distance=progress.distance,
    )


def _pose(goal: Goal) -> Pose:
    return Pose.planar(goal.x, goal.y, goal.yaw or 0.0)
