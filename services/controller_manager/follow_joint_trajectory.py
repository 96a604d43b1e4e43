"""The topics of the action ``follow_joint_trajectory``: goals and cancellations in; status, feedback, results out."""

from __future__ import annotations

from messages.actionlib import GoalID, GoalStatus, GoalStatusArray, Status
from messages.control import (
    FollowJointTrajectoryActionFeedback,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryActionResult,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
    TrajectoryError,
)
from messages.std import Header, Time
from messages.topics import Quality, Topic
from services.controller_manager.controller import Due, Ports
from services.runtime.action_goals import Goals

MAX_TRAJECTORY_BYTES = 1 << 20
"""Maximum size of a trajectory [bytes]."""
STATUS_RATE = 5.0
"""Status rate [Hz], as actionlib's ``status_frequency``; a change is published at once."""


class FollowJointTrajectoryServer:
    """The action server of one controller; ``goals`` holds the goal states, ``active`` is the ID of the active goal."""

    def __init__(self, controller: str, feedback_rate: float, ports: Ports) -> None:
        def topic(name: str, record: type, quality: Quality, about: str, largest: int = 1 << 16) -> Topic:  # type: ignore[type-arg]
            return Topic(f"{controller}/follow_joint_trajectory/{name}", record, 0, quality, about, largest)

        self._name, self.goals = f"{controller}/follow_joint_trajectory", Goals()
        self._goals_in = ports.stream(
            topic("goal", FollowJointTrajectoryActionGoal, Quality.EVENT, "trajectory to follow", MAX_TRAJECTORY_BYTES)
        )
        self._cancels = ports.stream(topic("cancel", GoalID, Quality.EVENT, "goals to cancel"))
        self._status = ports.advertise(topic("status", GoalStatusArray, Quality.LATCHED, "states of the goals"))
        self._feedback = ports.advertise(
            topic("feedback", FollowJointTrajectoryActionFeedback, Quality.SENSOR, "progress of the active goal")
        )
        self._results = ports.advertise(
            topic("result", FollowJointTrajectoryActionResult, Quality.EVENT, "outcome of a goal")
        )
        self._status_due, self._feedback_due = Due(STATUS_RATE), Due(feedback_rate)
        self.active = ""

    def cancelled(self, now: int) -> list[str]:
        """Process the received cancellations; return the IDs of the goals to cancel."""
        return list(dict.fromkeys(goal for each in self._cancels.drain() for goal in self.goals.cancel(each, now)))

    def received(self, now: int) -> list[tuple[GoalID, FollowJointTrajectoryActionGoal]]:
        """Return the received pending goals with their IDs, oldest first."""
        pending = []
        for message in self._goals_in.drain():
            goal = self.goals.receive(message.goal_id, f"/{self._name}", now)
            if goal is None:
                continue
            if self.goals.state(goal.id) is Status.PENDING:
                pending.append((goal, message))
            else:
                self._publish_result(self.goals.status(goal.id), TrajectoryError.SUCCESSFUL, "", now)
        return pending

    def accept(self, goal: str, now: int) -> None:
        """Accept a pending goal; the active one is preempted."""
        if self.active:
            self.end(Status.PREEMPTED, now, "preempted by a newer trajectory")
        self.goals.accept(goal)
        self.active = goal

    def reject(self, goal: str, now: int, code: TrajectoryError, text: str) -> None:
        """Reject a pending goal."""
        self._publish_result(self.goals.end(goal, Status.REJECTED, now, text), code, text, now)

    def end(self, status: Status, now: int, text: str = "", code: TrajectoryError = TrajectoryError.SUCCESSFUL) -> None:
        """End the active goal, if there is one."""
        if self.active:
            ended, self.active = self.active, ""
            self._publish_result(self.goals.end(ended, status, now, text), code, text, now)

    def publish(self, now: int, feedback: FollowJointTrajectoryFeedback | None) -> None:
        """Publish status and feedback if they are due."""
        due = self._status_due(now)
        if due or self.goals.changed:
            self.goals.changed = False
            header = Header(stamp=Time.of(now))
            self._status.publish(GoalStatusArray(header=header, status_list=self.goals.list(now)))
        if self.active and feedback is not None and self._feedback_due(now):
            status = self.goals.status(self.active)
            self._feedback.publish(
                FollowJointTrajectoryActionFeedback(header=feedback.header, status=status, feedback=feedback)
            )

    def _publish_result(self, status: GoalStatus, code: TrajectoryError, text: str, now: int) -> None:
        result = FollowJointTrajectoryResult(error_code=code.value, error_string=text)
        header = Header(stamp=Time.of(now))
        self._results.publish(FollowJointTrajectoryActionResult(header=header, status=status, result=result))
