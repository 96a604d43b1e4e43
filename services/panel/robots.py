"""Finds the robots in the graph, and keeps the latest messages of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from messages.elea import BaseStatus, GoalStatus
from messages.names import join
from messages.nav import Odometry, Path
from messages.se2 import IDENTITY, ZERO_TWIST, Pose2, Twist2
from messages.tf import TFMessage
from messages.topics import (
    BASE_STATUS,
    CMD_VEL,
    E_STOP,
    GOAL_POSE,
    GROUND_TRUTH,
    ODOM,
    PLAN,
    STATUS,
    TF_STATIC,
    TURTLE_POSE,
    Topic,
)
from messages.turtlesim import Pose as TurtlePose
from models.palette import Palette, hexadecimal, natural_order
from services.panel.graph import NodeGraph
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.tf.buffer import WORLD, TransformBuffer


@dataclass
class RobotState:
    """One robot by its absolute namespace. ``truth`` and ``estimate`` are poses in the world frame.

    ``frame`` is that of its odometry, which its controllers use. A ``turtle`` of turtlesim has only a pose.
    """

    namespace: str
    turtle: bool = False
    cmd_vel_type: str = ""
    accepts_goals: bool = False
    has_e_stop: bool = False
    truth: Pose2 | None = None
    estimate: Pose2 | None = None
    speed: Twist2 = ZERO_TWIST
    base: BaseStatus | None = None
    goal: GoalStatus | None = None
    plan: Path | None = None
    origin: Pose2 = IDENTITY
    frame: str = ""

    def topic_name(self, topic: Topic[Any]) -> str:
        """Return the absolute name of one of its topics."""
        return join(self.namespace, topic.name)


MAX_ORIGINS = 4096
"""Maximum frames fixed in the world whose poses are kept."""


class RobotTracker:
    """The robots in the graph; ``version`` counts changes of their state, ``pose_version`` new poses and gone robots.

    ``frames`` has the static transforms, such as those of the lasers on their bases.
    """

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph) -> None:
        self.by_namespace: dict[str, RobotState] = {}
        self.version = self.pose_version = 0
        self._subscriptions, self._graph = SubscriptionGroup(subscriptions), graph
        self._origins: dict[str, Pose2] = {}
        self.frames = TransformBuffer()
        self._reconciled = -1
        self._topics: tuple[Topic[Any], ...] = ()
        self._palette = Palette()
        self._pose_received = False

    def set_enabled(self, poses: bool, rest: bool) -> None:
        """Subscribe to poses, and to the ``rest``; what is disabled is unsubscribed from and its values are cleared."""
        topics = (*((GROUND_TRUTH, ODOM, TURTLE_POSE) if poses else ()), *((BASE_STATUS, STATUS, PLAN) if rest else ()))
        if topics != self._topics:
            for robot in self.by_namespace.values():
                if not poses:
                    robot.truth = robot.estimate = None
                if not rest:
                    robot.base = robot.goal = robot.plan = None
            self._topics, self._reconciled = topics, -1

    def colour(self, robot: RobotState) -> str:
        """Return the colour of a robot, the same as in the viewer and the report; later robots get the next ones."""
        return hexadecimal(self._palette.colour(robot.namespace.strip("/")))

    def free_colours(self, count: int) -> list[str]:
        """Return colours of the same palette that no robot has."""
        return [hexadecimal(each) for each in self._palette.next_colours(count)]

    def update(self) -> None:
        """Update from the graph and the new messages."""
        if self._reconciled != self._graph.version:
            self._reconciled = self._graph.version
            self._reconcile()
        for message, _ in self._subscriptions.messages(TF_STATIC.name, TFMessage.ROS_TYPE):
            self._update_origins(message)
        for robot in self.by_namespace.values():
            self._update_robot(robot)

    def _reconcile(self) -> None:
        """Find the robots in the graph: namespaces that publish a true pose, and turtles; and what they subscribe
        to."""
        drives = {each.name: each.record for each in self._graph.find_topics("sub", CMD_VEL.name)}
        goals = {each.name for each in self._graph.find_topics("sub", GOAL_POSE.name)}
        stops = {each.name for each in self._graph.find_topics("sub", E_STOP.name)}
        published = {each.name for each in self._graph.entities if each.kind == "pub"}
        found: dict[str, RobotState] = {}
        for each in self._graph.find_topics("pub", GROUND_TRUTH.name):
            namespace = each.name.rpartition("/")[0] or "/"
            robot = found[namespace] = self.by_namespace.get(namespace) or RobotState(namespace)
            robot.cmd_vel_type = drives.get(robot.topic_name(CMD_VEL), "")
            robot.cmd_vel_type = robot.cmd_vel_type if robot.topic_name(BASE_STATUS) in published else ""
            robot.has_e_stop = robot.topic_name(E_STOP) in stops
            robot.accepts_goals = robot.topic_name(GOAL_POSE) in goals
        for each in self._graph.find_topics("pub", TURTLE_POSE.name):
            namespace = each.name.rpartition("/")[0]
            if each.record == TurtlePose.ROS_TYPE and namespace and namespace not in found:
                turtle = found[namespace] = self.by_namespace.get(namespace) or RobotState(namespace, turtle=True)
                turtle.cmd_vel_type = drives.get(turtle.topic_name(CMD_VEL), "")
        if any(name not in found for name in self.by_namespace):
            self.pose_version += 1
        self.by_namespace = {name: found[name] for name in sorted(found, key=natural_order)}
        if not self._pose_received:  # before the first pose, robots of the fleet may still be missing
            self._palette = Palette(namespace.strip("/") for namespace in found)
        self.version += 1
        wanted = {(TF_STATIC.name, TFMessage.ROS_TYPE): TF_STATIC.quality.name} if self._topics else {}
        for robot in self.by_namespace.values():
            for topic in self._topics:
                if (name := robot.topic_name(topic)) in published and robot.turtle == (topic is TURTLE_POSE):
                    wanted[name, topic.record.ROS_TYPE] = topic.quality.name
        self._subscriptions.set_topics(wanted)

    def _update_origins(self, message: TFMessage) -> None:
        self.frames.add_static(message.transforms, b"")
        for each in message.transforms:
            known = each.child_frame_id in self._origins or len(self._origins) < MAX_ORIGINS
            if each.header.frame_id == WORLD and known:
                self._origins[each.child_frame_id] = Pose2.from_msg(each.transform)
        self.version += 1

    def _update_robot(self, robot: RobotState) -> None:
        for pose, _ in self._subscriptions.messages(robot.topic_name(TURTLE_POSE), TurtlePose.ROS_TYPE)[-1:]:
            robot.truth = robot.estimate = Pose2(pose.x, pose.y, pose.theta)
            self.pose_version, self._pose_received = self.pose_version + 1, True
            robot.speed = Twist2(pose.linear_velocity, pose.angular_velocity)
        for truth, _ in self._subscriptions.messages(robot.topic_name(GROUND_TRUTH), Odometry.ROS_TYPE)[-1:]:
            robot.truth = Pose2.from_msg(truth.pose.pose)
            self.pose_version, self._pose_received = self.pose_version + 1, True
            robot.speed = Twist2.from_msg(truth.twist.twist)
        for odometry, _ in self._subscriptions.messages(robot.topic_name(ODOM), Odometry.ROS_TYPE)[-1:]:
            robot.frame = odometry.header.frame_id
            robot.origin = self._origins.get(robot.frame, IDENTITY)
            robot.estimate = (robot.origin @ Pose2.from_msg(odometry.pose.pose)).wrapped
        for status, _ in self._subscriptions.messages(robot.topic_name(BASE_STATUS), BaseStatus.ROS_TYPE)[-1:]:
            if robot.base is None or _changed(robot.base, status):
                self.version += 1
            robot.base = status
        for goal, _ in self._subscriptions.messages(robot.topic_name(STATUS), GoalStatus.ROS_TYPE)[-1:]:
            robot.goal, self.version = goal, self.version + 1
        for plan, _ in self._subscriptions.messages(robot.topic_name(PLAN), Path.ROS_TYPE)[-1:]:
            robot.plan, self.version = plan, self.version + 1


def _changed(before: BaseStatus, after: BaseStatus) -> bool:
    """Return whether any displayed field has changed; counts and times change all the time."""
    return _shown_fields(before) != _shown_fields(after)


def _shown_fields(status: BaseStatus) -> tuple[object, ...]:
    s = status
    return s.model, s.source, s.timed_out, s.e_stopped, s.colliding, s.collisions, s.refused
