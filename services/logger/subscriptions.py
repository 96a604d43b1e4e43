"""The topics that the logger subscribes to: those of each robot, and all others that can be displayed."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from messages.records import RECORDS
from messages.se3 import Pose3
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import (
    CMD_VEL,
    CONTROL_STATE,
    GOAL_POSE,
    GROUND_TRUTH,
    JOINT_STATES,
    ODOM,
    PLAN,
    SCAN,
    STATUS,
    TF,
    WORLD_MARKERS,
    Quality,
    Topic,
    largest_of,
)
from services.logger import LoggerParameters
from services.logger.columns import RobotColumns
from services.logger.display_scene import SHOWN, DisplayScene
from services.markers.displays import DISPLAYED
from services.runtime.context import Context
from services.runtime.graph import Entity, token_pattern
from services.runtime.subscriber import Subscriber
from services.runtime.tf.buffer import TransformBuffer, pose_in_world
from services.runtime.tf.listener import TransformListener

SIMULATION = "/sim"
"""The node whose scans, images and transforms are displayed with its robots."""
MAX_TOPICS = 64


class RobotSubscriptions:
    """Subscribes to a robot's topics and passes their messages to its columns.

    Args:
        ctx: The logger's context.
        robot: The robot's name.
        namespace: The namespace of its topics.
        frames: Transforms of ``/tf_static``.
        state: Topic of an arm's controller state; empty without one.
        scans: Whether to subscribe to its laser, which the simulation only computes for subscribers.
    """

    def __init__(
        self,
        ctx: Context[LoggerParameters],
        robot: str,
        namespace: str,
        frames: TransformBuffer,
        state: str = "",
        scans: bool = False,
    ) -> None:
        self.robot, self.columns = robot, RobotColumns(frames=frames)
        self._truth = ctx.stream(GROUND_TRUTH.of(namespace))
        self._odometry = ctx.stream(ODOM.of(namespace))
        self._commands = ctx.stream(CMD_VEL.of(namespace))
        self._joints = ctx.stream(JOINT_STATES.of(namespace))
        self._plans = ctx.stream(PLAN.of(namespace))
        self._status = ctx.stream(STATUS.of(namespace))
        self._scans = ctx.stream(SCAN.of(namespace)) if scans else None
        self.topics = tuple(each.of(namespace).name for each in (PLAN, GOAL_POSE, SCAN))
        """Topics that are displayed with the robot."""
        self._control = ctx.stream(CONTROL_STATE.named(state)) if state else None

    def collect(self, now: int, dt: float) -> None:
        """Collect the messages of the ``dt`` [s] before ``now`` [ns]."""
        self.columns.add_truth(self._truth.drain())
        self.columns.add_odometry(self._odometry.drain())
        self.columns.add_commands(self._commands.drain(), now, dt)
        self.columns.add_joints(self._joints.drain())
        if self._scans is not None:
            self.columns.add_scans(self._scans.drain())
        if self._control is not None:
            self.columns.add_control(self._control.drain())
        for plan in self._plans.drain():
            self.columns.add_plan(plan)
        for status in self._status.drain():
            self.columns.add_status(status)

    def collect_remaining(self, now: int) -> None:
        """Collect the messages that arrived after the last tick."""
        streams = (self._truth, self._odometry, self._commands, self._joints, self._plans, self._status)
        for stream in streams:
            stream.refresh()
        for optional in (self._scans, self._control):
            if optional is not None:
                optional.refresh()
        self.collect(now, 0.0)


class DisplaySubscriptions:
    """Subscribes to all topics that can be displayed and are not published by the simulation; ``own`` are topics of
    robots, which are displayed differently.

    ``/tf`` is subscribed to once one of them may need it: the simulation computes it only for subscribers.
    """

    def __init__(self, ctx: Context[Any], own: Collection[str]) -> None:
        self._ctx, self._own = ctx, {WORLD_MARKERS.name, *own}
        self._watch = ctx.node.transport.watch(token_pattern("pub"))
        self._tokens: dict[str, Entity] = {}
        self._subscribers: dict[tuple[str, str], Subscriber[Any]] = {}
        self._frames: TransformListener = ctx.transforms(moving=False)

    def frame(self, header: Header) -> Pose3:
        """Return the pose of a frame in the world; the identity if no transform connects it with the world."""
        return pose_in_world(self._frames.buffer, header)

    def collect(self, scene: DisplayScene, now: int) -> None:
        """Display the messages received up to ``now`` [ns]."""
        self._follow(scene, now)
        for (name, _), subscriber in self._subscribers.items():
            for message, _ in subscriber.messages:
                scene.add(name, message, now)
        scene.update(now)

    def _follow(self, scene: DisplayScene, now: int) -> None:
        changed = False
        while (event := self._watch.poll()) is not None:
            entity = Entity.parse(event.key)
            if entity is None or entity.node == SIMULATION:
                continue
            if event.alive and (entity.record in SHOWN or entity.record == TFMessage.ROS_TYPE):
                self._tokens[event.key], changed = entity, True
            elif self._tokens.pop(event.key, None) is not None:
                changed = True
        if changed:
            self._reconcile(scene, now)

    def _reconcile(self, scene: DisplayScene, now: int) -> None:
        found = [each for each in self._tokens.values() if each.name not in self._own]
        if any(each.name == TF.name or each.record in DISPLAYED for each in found):
            self._frames.read_moving()
        wanted = {(each.name, each.record): each.detail for each in found if each.record in SHOWN}
        for place in [each for each in self._subscribers if each not in wanted]:
            self._ctx.node.unregister(self._subscribers.pop(place))
            scene.remove(place[0], now)
        for (name, record), quality in list(wanted.items())[:MAX_TOPICS]:
            if (name, record) not in self._subscribers:
                kind = Quality.__members__.get(quality, Quality.SENSOR)
                topic: Topic[Any] = Topic(name, RECORDS[record], 0, kind, "", largest_of(name, record))
                self._subscribers[name, record] = self._ctx.node.subscribe(topic)
