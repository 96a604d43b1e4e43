"""The action ``rotate_absolute`` of one turtle: turn to a heading, with the topics of actionlib."""

from __future__ import annotations

from messages.actionlib import GoalID, GoalStatusArray, Status
from messages.names import join
from messages.std import Header, Time
from messages.topics import Quality, Topic
from messages.turtlesim import (
    RotateAbsoluteActionFeedback,
    RotateAbsoluteActionGoal,
    RotateAbsoluteActionResult,
    RotateAbsoluteFeedback,
    RotateAbsoluteResult,
)
from services.runtime.action_goals import Goals
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.subscriber import Subscriber
from services.turtlesim.turtle import HEADING_TOLERANCE, TURN_RATE, Turtle, Velocity

ACTION = "rotate_absolute"
STATUS_PERIOD_NS = 200_000_000


class RotateAbsoluteServer:
    """The action server of the turtle ``name``; a new goal replaces the active one."""

    def __init__(self, node: Node, name: str) -> None:
        self._node, self._name, self._goals = node, node.identity.resolve(join(name, ACTION)), Goals()

        def topic(part: str, record: type, quality: Quality, about: str) -> Topic:  # type: ignore[type-arg]
            return Topic(f"{name}/{ACTION}/{part}", record, 0, quality, about)

        event = Quality.EVENT
        self._received: Subscriber[RotateAbsoluteActionGoal] = node.subscribe(
            topic("goal", RotateAbsoluteActionGoal, event, "heading to turn to")
        )
        self._cancelled: Subscriber[GoalID] = node.subscribe(topic("cancel", GoalID, event, "goals to cancel"))
        self._status: Publisher[GoalStatusArray] = node.advertise(
            topic("status", GoalStatusArray, Quality.LATCHED, "states of the goals")
        )
        self._feedback: Publisher[RotateAbsoluteActionFeedback] = node.advertise(
            topic("feedback", RotateAbsoluteActionFeedback, Quality.SENSOR, "remaining angle")
        )
        self._results: Publisher[RotateAbsoluteActionResult] = node.advertise(
            topic("result", RotateAbsoluteActionResult, event, "outcome of a goal")
        )
        self._active, self._heading, self._start, self._status_due = "", 0.0, 0.0, 0

    def close(self) -> None:
        """Close the topics."""
        self._node.unregister(self._received, self._cancelled, self._status, self._feedback, self._results)

    def step(self, turtle: Turtle, now: int, fresh: bool) -> Turtle:
        """Return the turtle under its goal's command; messages are ignored, as after a reset, unless ``fresh``."""
        for message, _ in self._received.messages if fresh else ():
            self._accept(message, turtle, now)
        for cancel, _ in self._cancelled.messages if fresh else ():
            if self._active in self._goals.cancel(cancel, now):
                self._end(Status.PREEMPTED, turtle, now, "it was cancelled")
                turtle = turtle.command(Velocity(), now)
        if self._active:
            turtle = self._turn(turtle, now)
        if self._goals.changed or now >= self._status_due:
            self._goals.changed, self._status_due = False, now + STATUS_PERIOD_NS
            header = Header(stamp=Time.of(now))
            self._status.publish(GoalStatusArray(header=header, status_list=self._goals.list(now)))
        return turtle

    def restart(self) -> None:
        """Restart without goals, after a reset of the turtles or of simulation time."""
        self._goals, self._active, self._status_due = Goals(), "", 0

    def _accept(self, message: RotateAbsoluteActionGoal, turtle: Turtle, now: int) -> None:
        goal = self._goals.receive(message.goal_id, self._name, now)
        if goal is None:
            return
        if self._goals.state(goal.id) is not Status.PENDING:
            status = self._goals.status(goal.id)
            self._results.publish(RotateAbsoluteActionResult(header=Header(stamp=Time.of(now)), status=status))
            return
        if self._active:
            self._end(Status.PREEMPTED, turtle, now, "it was replaced by a newer goal")
        self._goals.accept(goal.id)
        self._active, self._heading, self._start = goal.id, message.goal.theta, turtle.theta

    def _turn(self, turtle: Turtle, now: int) -> Turtle:
        remaining = turtle.remaining_turn(self._heading)
        feedback = RotateAbsoluteFeedback(remaining=remaining)
        status = self._goals.status(self._active)
        header = Header(stamp=Time.of(now))
        self._feedback.publish(RotateAbsoluteActionFeedback(header=header, status=status, feedback=feedback))
        if abs(remaining) < HEADING_TOLERANCE:
            self._end(Status.SUCCEEDED, turtle, now, "the heading is reached")
            return turtle.command(Velocity(), now)
        return turtle.command(Velocity(turn=TURN_RATE if remaining > 0 else -TURN_RATE), now)

    def _end(self, status: Status, turtle: Turtle, now: int, text: str) -> None:
        ended, self._active = self._active, ""
        final = self._goals.end(ended, status, now, text)
        result = RotateAbsoluteResult(delta=turtle.remaining_turn(self._start))
        self._results.publish(
            RotateAbsoluteActionResult(header=Header(stamp=Time.of(now)), status=final, result=result)
        )
