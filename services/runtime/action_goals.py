"""The goals of an action server and their states, with actionlib's semantics; sends no messages."""

from __future__ import annotations

from dataclasses import dataclass, field

from messages.actionlib import GoalID, GoalStatus, Status
from messages.std import SECOND, Time

FORGET_AFTER_NS = 5 * SECOND
"""Simulation time [ns] that an ended goal stays in the list; actionlib's ``status_list_timeout``."""
MAX_GOALS = 200
"""Maximum goals in the list; beyond that, those that ended first are removed early."""


@dataclass
class _Goal:
    id: GoalID
    status: Status
    text: str = ""
    ended: int = 0


@dataclass
class Goals:
    """The received goals by id. Times are simulation time [ns].

    ``changed`` is set by every change of a state, until its owner publishes the list.
    """

    changed: bool = False
    _goals: dict[str, _Goal] = field(default_factory=dict)
    _cancelled_upto: int = 0
    _received: int = 0
    _now: int = 0

    def receive(self, asked: GoalID, name: str, now: int) -> GoalID | None:
        """Add a received goal; returns None if it is known already.

        The goal becomes PENDING, or RECALLED at once if it was cancelled before it arrived. A goal without an id gets
        one made of ``name``, a number and the time; one without a stamp gets the present time.
        """
        self._follow_time(now)
        self._received += 1
        goal = GoalID(
            stamp=asked.stamp if asked.stamp.ns else Time.of(now),
            id=asked.id or f"{name}-{self._received}-{now / SECOND:.3f}",
        )
        known = self._goals.get(goal.id)
        if known is not None and known.status is not Status.RECALLING:
            return None
        recalled = known is not None or (0 < asked.stamp.ns <= self._cancelled_upto)
        self._goals[goal.id] = _Goal(goal, Status.PENDING)
        self.changed = True
        if recalled:
            self.end(goal.id, Status.RECALLED, now, "it was cancelled before it arrived")
        self._forget(now)
        return goal

    def accept(self, goal: str) -> None:
        """Set a pending goal to ACTIVE."""
        assert self._goals[goal].status is Status.PENDING
        self._goals[goal].status, self._goals[goal].text = Status.ACTIVE, "it was accepted"
        self.changed = True

    def end(self, goal: str, status: Status, now: int, text: str) -> GoalStatus:
        """Set a goal to a terminal state; returns its status for the result message."""
        assert status.terminal
        each = self._goals[goal]
        assert not each.status.terminal
        each.status, each.text, each.ended = status, text, now
        self.changed = True
        return self.status(goal)

    def cancel(self, asked: GoalID, now: int) -> list[str]:
        """Process a cancel request; returns the goals to cancel that have not ended yet.

        By actionlib's policy, neither id nor stamp cancels all goals; a stamp cancels all goals up to it, also those
        yet to arrive; an id cancels that goal, also if it is yet to arrive; both cancel the goal and all up to the
        stamp.
        """
        self._follow_time(now)
        stamp = asked.stamp.ns
        everything = not asked.id and not stamp
        meant = [
            goal
            for goal, each in self._goals.items()
            if not each.status.terminal
            and each.status is not Status.RECALLING
            and (everything or goal == asked.id or (stamp and each.id.stamp.ns <= stamp))
        ]
        if asked.id and asked.id not in self._goals:
            self._goals[asked.id] = _Goal(asked, Status.RECALLING, "it was cancelled before it arrived", now)
            self.changed = True
        self._cancelled_upto = max(self._cancelled_upto, stamp)
        self._forget(now)
        return meant

    def state(self, goal: str) -> Status | None:
        """Return the state of a goal; None if it is unknown."""
        return self._goals[goal].status if goal in self._goals else None

    def status(self, goal: str) -> GoalStatus:
        """Return the status message of a known goal."""
        each = self._goals[goal]
        return GoalStatus(goal_id=each.id, status=each.status.value, text=each.text)

    def list(self, now: int) -> tuple[GoalStatus, ...]:
        """Return the status of all goals, without those that ended more than FORGET_AFTER_NS ago, oldest first."""
        self._follow_time(now)
        self._forget(now)
        return tuple(self.status(each) for each in self._goals)

    def _follow_time(self, now: int) -> None:
        """Drop ended goals and past cancellations if simulation time was set back."""
        if now < self._now:
            self._goals = {goal: each for goal, each in self._goals.items() if not _over(each)}
            self._cancelled_upto = 0
        self._now = now

    def _forget(self, now: int) -> None:
        ended = [(each.ended, goal) for goal, each in self._goals.items() if _over(each)]
        old = [goal for at, goal in ended if now - at > FORGET_AFTER_NS]
        kept = len(self._goals) - len(old)
        spare = [goal for _, goal in sorted(ended) if goal not in old]
        for goal in (*old, *spare[: max(0, kept - MAX_GOALS)]):
            del self._goals[goal]


def _over(goal: _Goal) -> bool:
    return goal.status.terminal or goal.status is Status.RECALLING
