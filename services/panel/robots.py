"""Which robots there are, as the graph tells it, and what was last heard of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from messages.elea import BaseStatus, GoalStatus
from messages.nav import Odometry, Path
from messages.tf import TFMessage
from messages.topics import BASE_STATUS, CMD_VEL, E_STOP, GOAL_POSE, GROUND_TRUTH, ODOM, PLAN, STATUS, TF_STATIC, Topic
from models.palette import Palette, hexadecimal
from services.panel.feeds import Feeds, Hold
from services.panel.network import Network

WORLD = "world"


class Spot(NamedTuple):
    """A place on the ground: m, m, rad."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def of(self, there: Spot) -> Spot:
        """``there``, which is told in the frame at this spot, as this spot's own frame tells it."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        yaw = math.remainder(self.yaw + there.yaw, math.tau)
        return Spot(self.x + c * there.x - s * there.y, self.y + s * there.x + c * there.y, yaw)

    def inside(self, there: Spot) -> Spot:
        """The inverse of ``of``: ``there`` as the frame at this spot tells it."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        dx, dy = there.x - self.x, there.y - self.y
        return Spot(c * dx + s * dy, c * dy - s * dx, math.remainder(there.yaw - self.yaw, math.tau))


@dataclass
class Robot:
    """One robot by its namespace. ``truth`` and ``estimate`` lie in the world."""

    namespace: str
    drives: str = ""
    takes_goals: bool = False
    stops: bool = False
    truth: Spot | None = None
    estimate: Spot | None = None
    speed: tuple[float, float] = (0.0, 0.0)
    base: BaseStatus | None = None
    goal: GoalStatus | None = None
    plan: Path | None = None
    origin: Spot = field(default_factory=Spot)

    @property
    def frame(self) -> str:
        """The frame of its odometry, by which its controllers know it."""
        return f"{self.namespace.strip('/')}/{ODOM.name}"


MOST_ORIGINS = 4096
"""Frames that stand in the world, of which the place is remembered."""


class Robots:
    """Follows the robots of the world; ``version`` grows with what is told of them, ``moves`` with their motion."""

    def __init__(self, feeds: Feeds, network: Network) -> None:
        self.found: dict[str, Robot] = {}
        self.version = self.moves = 0
        self._hold, self._network = Hold(feeds), network
        self._origins: dict[str, Spot] = {}
        self._followed = -1
        self._topics: tuple[Topic[Any], ...] = ()
        self._palette = Palette()
        self._seen = False

    def follow(self, poses: bool, rest: bool) -> None:
        """Listen to where they are, and to the rest, or know their names alone; what was heard is then forgotten."""
        topics = (*((GROUND_TRUTH, ODOM) if poses else ()), *((BASE_STATUS, STATUS, PLAN) if rest else ()))
        if topics != self._topics:
            for robot in self.found.values():
                if not poses:
                    robot.truth = robot.estimate = None
                if not rest:
                    robot.base = robot.goal = robot.plan = None
            self._topics, self._followed = topics, -1

    def colour(self, robot: Robot) -> str:
        """The colour of a robot, as the viewer and the report have it: of those that come later, the next ones."""
        return hexadecimal(self._palette.colour(robot.namespace.strip("/")))

    def turn(self) -> None:
        """Take in what has come."""
        if self._followed != self._network.version:
            self._followed = self._network.version
            self._reconcile()
        for message, _ in self._hold.batch(TF_STATIC.name, TFMessage.ROS_TYPE):
            self._place(message)
        for robot in self.found.values():
            self._hear(robot)

    def _reconcile(self) -> None:
        """Robots are those whose true pose is told; who takes their commands, stops and goals is seen beside."""
        drives = {each.name: each.record for each in self._network.ending("sub", CMD_VEL.name)}
        goals = {each.name for each in self._network.ending("sub", GOAL_POSE.name)}
        stops = {each.name for each in self._network.ending("sub", E_STOP.name)}
        told = {each.name for each in self._network.entities if each.kind == "pub"}
        found: dict[str, Robot] = {}
        for each in self._network.ending("pub", GROUND_TRUTH.name):
            namespace = each.name.rpartition("/")[0]
            robot = found[namespace] = self.found.get(namespace) or Robot(namespace)
            robot.drives = drives.get(f"{namespace}/{CMD_VEL.name}", "")
            robot.drives = robot.drives if f"{namespace}/{BASE_STATUS.name}" in told else ""
            robot.stops = f"{namespace}/{E_STOP.name}" in stops
            robot.takes_goals = f"{namespace}/{GOAL_POSE.name}" in goals
        self.found = dict(sorted(found.items()))
        if not self._seen:  # before the first pose, robots of the fleet may still be missing
            self._palette = Palette(namespace.strip("/") for namespace in found)
        self.version += 1
        wanted = {(TF_STATIC.name, TFMessage.ROS_TYPE): TF_STATIC.quality.name} if self._topics else {}
        for namespace in self.found:
            for topic in self._topics:
                if (name := f"{namespace}/{topic.name}") in told:
                    wanted[name, topic.record.ROS_TYPE] = topic.quality.name
        self._hold.want(wanted)

    def _place(self, message: TFMessage) -> None:
        for each in message.transforms:
            if each.header.frame_id == WORLD:
                place, turn = each.transform.translation, each.transform.rotation
                if each.child_frame_id in self._origins or len(self._origins) < MOST_ORIGINS:
                    self._origins[each.child_frame_id] = Spot(place.x, place.y, turn.yaw)
        self.version += 1

    def _hear(self, robot: Robot) -> None:
        space = robot.namespace
        for truth, _ in self._hold.batch(f"{space}/{GROUND_TRUTH.name}", Odometry.ROS_TYPE)[-1:]:
            robot.truth, self.moves, self._seen = _spot(truth), self.moves + 1, True
            robot.speed = truth.twist.twist.linear.x, truth.twist.twist.angular.z
        for odometry, _ in self._hold.batch(f"{space}/{ODOM.name}", Odometry.ROS_TYPE)[-1:]:
            robot.origin = self._origins.get(odometry.header.frame_id, Spot())
            robot.estimate = robot.origin.of(_spot(odometry))
        for status, _ in self._hold.batch(f"{space}/{BASE_STATUS.name}", BaseStatus.ROS_TYPE)[-1:]:
            if robot.base is None or _differs(robot.base, status):
                self.version += 1
            robot.base = status
        for goal, _ in self._hold.batch(f"{space}/{STATUS.name}", GoalStatus.ROS_TYPE)[-1:]:
            robot.goal, self.version = goal, self.version + 1
        for plan, _ in self._hold.batch(f"{space}/{PLAN.name}", Path.ROS_TYPE)[-1:]:
            robot.plan, self.version = plan, self.version + 1


def _spot(odometry: Odometry) -> Spot:
    pose = odometry.pose.pose
    return Spot(pose.position.x, pose.position.y, pose.orientation.yaw)


def _differs(before: BaseStatus, after: BaseStatus) -> bool:
    """Whether anything that people look at has changed; counts and times do all the time."""
    return _looked_at(before) != _looked_at(after)


def _looked_at(status: BaseStatus) -> tuple[object, ...]:
    s = status
    return s.model, s.source, s.timed_out, s.e_stopped, s.colliding, s.collisions, s.refused
