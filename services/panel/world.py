"""The world on the map: outlines of its bodies from above, including moving ones, and the laser scan of a robot."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from messages.gazebo import WorldStates
from messages.nav import Odometry
from messages.se3 import Pose3
from messages.sensor import LaserScan
from messages.topics import GROUND_TRUTH, SCAN, WORLD_MARKERS, WORLD_STATES
from messages.visualization import MarkerArray
from services.markers.displays import scan_points
from services.markers.footprint import Footprint, transformed
from services.markers.world_bodies import FIXED, GROUND, World, WorldBody, world_bodies
from services.panel.graph import NodeGraph
from services.panel.pages import Page
from services.panel.protocol import as_json
from services.panel.robots import RobotState, RobotTracker
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.errors import BadInput, NoTransform

MAX_PARTS = 20_000
"""Maximum displayed outlines; a page draws as many in 20 ms."""

Floats = NDArray[np.float64]


class WorldTracker:
    """The bodies of the world; ``version`` counts changes of their set, ``motion`` their movements.

    The markers are always subscribed to: they are latched, and published once.
    """

    def __init__(self, subscriptions: SharedSubscriptions) -> None:
        self.version = self.motion = 0
        self.bodies: World = ()
        self.outlines: dict[str, list[list[float]]] = {}
        self._markers, self._states = SubscriptionGroup(subscriptions), SubscriptionGroup(subscriptions)
        self._markers.set_topics({(WORLD_MARKERS.name, MarkerArray.ROS_TYPE): WORLD_MARKERS.quality.name})
        self._moving: dict[str, WorldBody] = {}
        self._poses: dict[str, Pose3] = {}

    def set_enabled(self, enabled: bool) -> None:
        """Subscribe to the poses of moving bodies, or leave them at their last poses."""
        place = WORLD_STATES.name, WorldStates.ROS_TYPE
        self._states.set_topics({place: WORLD_STATES.quality.name} if enabled else {})

    def update(self) -> None:
        """Update from the new messages."""
        for array, _ in self._markers.messages(WORLD_MARKERS.name, MarkerArray.ROS_TYPE)[-1:]:
            self._set_bodies(array)
        for states, _ in self._states.messages(WORLD_STATES.name, WorldStates.ROS_TYPE)[-1:]:
            for name, message in zip(states.name, states.pose, strict=False):
                self._move(name, Pose3.from_msg(message))

    def _set_bodies(self, array: MarkerArray) -> None:
        found: list[tuple[WorldBody, list[Footprint]]] = []
        count = 0
        for body in world_bodies(array):
            try:
                parts = body.footprints()
            except BadInput:
                continue  # the grader logs it
            count += len(parts)
            found.append((body, parts if count <= MAX_PARTS else []))
        self.bodies = tuple(found)
        self._moving = {body.name: body for body, _ in found if body.kind not in (FIXED, GROUND)}
        self._poses = {name: body.pose for name, body in self._moving.items()}
        self.outlines = {body.name: _outlines(parts) for body, parts in found if body.name in self._moving}
        self.version += 1
        self.motion += 1

    def _move(self, name: str, pose: Pose3) -> None:
        if name in self._moving and _differs(self._poses[name], pose):
            self._poses[name] = pose
            self.outlines[name] = _outlines(self._moving[name].footprints(pose))
            self.motion += 1


class WorldChannel:
    """Sends the bodies of the world: name, kind, colour and outlines, each ``[x, y, x, y, …]`` [m]."""

    period, streams = 0.5, False

    def __init__(self, world: WorldTracker) -> None:
        self._world = world

    @property
    def version(self) -> int:
        """The version of the world."""
        return self._world.version

    def set_enabled(self, enabled: bool) -> None:
        """Do nothing: the markers are always subscribed to."""

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the world."""

    def delta(self, since: int) -> str | None:
        bodies = [
            {
                "name": body.name,
                "kind": body.kind,
                "colour": "#{:02x}{:02x}{:02x}{:02x}".format(*(round(255 * each) for each in body.colour)),
                "outlines": _outlines(parts),
            }
            for body, parts in self._world.bodies
        ]
        return as_json("world", bodies=bodies)


class BodiesChannel:
    """Sends the present outlines of the movable bodies, by name."""

    period, streams = 0.04, False

    def __init__(self, world: WorldTracker) -> None:
        self._world = world

    @property
    def version(self) -> int:
        """The number of movements of the bodies."""
        return self._world.motion

    def set_enabled(self, enabled: bool) -> None:
        """Enable the subscription to their poses."""
        self._world.set_enabled(enabled)

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the world."""

    def delta(self, since: int) -> str | None:
        return as_json("bodies", outlines=self._world.outlines)


SCAN_PERIOD_S = 0.1
"""Minimum wall time [s] between two scans sent to a page."""
MAX_POINTS = 720
"""Maximum drawn points of a scan; of more, evenly spaced ones."""
MAX_POSES = 128
"""Maximum true poses kept per robot, to interpolate its pose at the stamp of a scan."""


class ScanSender:
    """Sends each page the laser scan of one robot, as points in the world; subscribes only to scans that are shown."""

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph, robots: RobotTracker) -> None:
        self._subscriptions, self._graph, self._robots = SubscriptionGroup(subscriptions), graph, robots
        self._requested: dict[Page, str] = {}
        self._poses: dict[str, deque[tuple[int, str, Pose3]]] = {}
        self._due: dict[str, float] = {}
        self._reconciled: tuple[int, int] = (-1, -1)
        self._changes = 0

    def set_subscription(self, page: Page, robot: str) -> None:
        """Set the robot whose scan a page shows; empty for none, or if the page has closed."""
        if self._requested.get(page, "") != robot:
            self._requested.pop(page, None)
            if robot:
                self._requested[page] = robot
            self._changes += 1

    def update(self, now: float) -> None:
        """Read the new messages and send the scans to the pages; ``now`` is wall time [s]."""
        if self._reconciled != (self._graph.version, self._changes):
            self._reconciled = self._graph.version, self._changes
            self._reconcile()
        for namespace, poses in self._poses.items():
            robot = self._robots.by_namespace.get(namespace)
            if robot is not None:
                self._update_robot(robot, poses, now)

    def _reconcile(self) -> None:
        wanted: dict[tuple[str, str], str] = {}
        robots = [each for each in set(self._requested.values()) if each in self._robots.by_namespace]
        for namespace in robots:
            for topic in (GROUND_TRUTH, SCAN):
                name = self._robots.by_namespace[namespace].topic_name(topic)
                if self._graph.publication(name) is not None:
                    wanted[name, topic.record.ROS_TYPE] = topic.quality.name
        self._subscriptions.set_topics(wanted)
        self._poses = {each: self._poses.get(each, deque(maxlen=MAX_POSES)) for each in robots}

    def _update_robot(self, robot: RobotState, poses: deque[tuple[int, str, Pose3]], now: float) -> None:
        for truth, _ in self._subscriptions.messages(robot.topic_name(GROUND_TRUTH), Odometry.ROS_TYPE):
            stamp = truth.header.stamp.ns
            if poses and stamp <= poses[-1][0]:
                poses.clear()
            poses.append((stamp, truth.child_frame_id, Pose3.from_msg(truth.pose.pose)))
        for scan, _ in self._subscriptions.messages(robot.topic_name(SCAN), LaserScan.ROS_TYPE)[-1:]:
            if now < self._due.get(robot.namespace, 0.0) or (points := self._place(scan, poses)) is None:
                continue
            self._due[robot.namespace] = now + SCAN_PERIOD_S
            text = as_json("scan", ns=robot.namespace, points=points)
            for page, namespace in self._requested.items():
                if namespace == robot.namespace:
                    page.set_state("scan", text)

    def _place(self, scan: LaserScan, poses: deque[tuple[int, str, Pose3]]) -> list[float] | None:
        """Return the scan's points in the world, alternating x and y [m]; None if the laser's pose is unknown."""
        stamp = scan.header.stamp.ns
        before = next((each for each in reversed(poses) if each[0] <= stamp), None)
        if before is None:
            return None
        after = next((each for each in poses if each[0] >= stamp), before)
        share = (stamp - before[0]) / (after[0] - before[0]) if after[0] > before[0] else 0.0
        base = before[2].interpolate(after[2], share)
        try:
            mount = self._robots.frames.lookup(before[1], scan.header.frame_id).transform
        except NoTransform:
            return None
        points = scan_points(scan)
        points = points[:: max(1, -(-len(points) // MAX_POINTS))]
        flat: list[float] = np.round(transformed(base @ mount, points)[:, :2], 3).ravel().tolist()
        return flat


def _outlines(parts: list[Footprint]) -> list[list[float]]:
    return [np.round(part.polygon(), 3).ravel().tolist() for part in parts]


def _differs(before: Pose3, after: Pose3) -> bool:
    return any(
        abs(a - b) > 5e-4
        for a, b in zip((*before.position, *before.orientation), (*after.position, *after.orientation), strict=True)
    )
