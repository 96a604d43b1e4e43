"""Displays of nodes on the map, from above: markers, paths, poses, maps and scans on any topic."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.base import Message
from messages.nav import OccupancyGrid
from messages.se3 import Pose3
from messages.sensor import LaserScan
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import GOAL_POSE, PLAN, SCAN, TF, TF_STATIC, WORLD_MARKERS
from messages.visualization import Marker
from services.markers.displays import DISPLAYED, MarkerSet, markers_of
from services.markers.footprint import (
    box_footprint,
    cylinder_footprint,
    points_footprint,
    sphere_footprint,
    transformed,
    triangle_footprints,
)
from services.markers.world_bodies import MAX_TRIANGLES, marker_triangles
from services.panel.clock import SimTimeMap
from services.panel.graph import NodeGraph
from services.panel.protocol import as_json
from services.panel.robots import RobotTracker
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.errors import BadInput
from services.runtime.tf.buffer import TransformBuffer, pose_in_world

PERIODS_S = {LaserScan.ROS_TYPE: 0.2, OccupancyGrid.ROS_TYPE: 2.0}
"""Wall time [s] between two drawn messages of a topic, for types that are frequent or expensive."""
MAX_TOPICS = 32
MAX_GONE = 10_000
"""Maximum removed markers remembered, so that pages can remove them."""
MAX_MARKERS = 5000
"""Maximum displayed markers of a topic; beyond that, the oldest are dropped."""


Floats = NDArray[np.float64]
Outline = list[float]
"""Corners as x, y, x, y, … [m]."""

MAX_POINTS = 20_000
"""Maximum drawn points of a marker."""
HEAD = 0.3
"""Length of an arrow's head as a fraction of the arrow's length."""


class MarkerTracker:
    """The markers of all topics with a displayable type; ``version`` is incremented by each change.

    Topics stay subscribed once a page has shown them, since most publishers do not repeat their markers. The plans,
    goals and scans of this project's robots are drawn elsewhere.
    """

    def __init__(
        self, subscriptions: SharedSubscriptions, graph: NodeGraph, robots: RobotTracker, time: SimTimeMap
    ) -> None:
        self.version = 0
        self.outlines: dict[tuple[str, str, int], tuple[int, dict[str, Any]]] = {}
        """By topic, namespace and id: the version in which a marker changed last, and its drawing."""
        self.gone: dict[tuple[str, str, int], int] = {}
        self._graph, self._robots, self._time = graph, robots, time
        self._epoch = time.epoch
        self._subscriptions, self._moving = SubscriptionGroup(subscriptions), SubscriptionGroup(subscriptions)
        self._frames = TransformBuffer()
        self._sets: dict[str, MarkerSet] = {}
        self._enabled = False
        self._reconciled: tuple[int, int] = (-1, -1)
        self._due: dict[str, float] = {}
        self._held: dict[str, Message] = {}
        """By topic, the newest message that is not due yet."""

    def enable(self) -> None:
        """Subscribe from now on; called when a page shows markers."""
        self._enabled = True

    @property
    def subscribed(self) -> bool:
        """Whether any topic is subscribed to."""
        return bool(self._subscriptions.topics())

    def update(self, now: float) -> None:
        """Update from the new messages; ``now`` is wall time [s]."""
        if not self._enabled:
            return
        if self._reconciled != (self._graph.version, self._robots.version):
            self._reconciled = self._graph.version, self._robots.version
            self._reconcile()
        self._end_lifetimes()
        for message, _ in self._moving.messages(TF.name, TFMessage.ROS_TYPE):
            self._frames.add(message.transforms, b"")
        self._add_static([message for message, _ in self._moving.messages(TF_STATIC.name, TFMessage.ROS_TYPE)])
        for name, record in self._subscriptions.topics():
            messages = [message for message, _ in self._subscriptions.messages(name, record)]
            if record not in PERIODS_S:
                for message in messages:
                    self._add(name, message)
                continue
            if messages:
                self._held[name] = messages[-1]
            if name in self._held and now >= self._due.get(name, 0.0):
                self._due[name] = now + PERIODS_S[record]
                self._add(name, self._held.pop(name))

    def _add_static(self, messages: list[TFMessage]) -> None:
        """Add static transforms, and redraw the markers in frames that they move: those drawn before are not sent
        again."""
        if not messages:
            return
        drawn = [
            ((topic, *place), marker)
            for topic, shown in self._sets.items()
            for place, (_, marker) in shown.shown.items()
        ]
        frames = {marker.header.frame_id: Header(frame_id=marker.header.frame_id) for _, marker in drawn}
        before = {name: pose_in_world(self._frames, header) for name, header in frames.items()}
        for message in messages:
            self._frames.add_static(message.transforms, b"")
        moved = {name for name, header in frames.items() if pose_in_world(self._frames, header) != before[name]}
        self.version += bool(moved)
        for place, marker in drawn:
            if marker.header.frame_id in moved:
                self._draw(place, marker)

    def _end_lifetimes(self) -> None:
        if self._epoch != self._time.epoch:
            self._epoch = self._time.epoch
            self._frames.clear()
            for shown in self._sets.values():
                shown.restart()
        for topic, shown in self._sets.items():
            self._remove([(topic, *place) for place in shown.expire(self._time.now)])

    def _reconcile(self) -> None:
        own = {WORLD_MARKERS.name}
        for robot in self._robots.by_namespace.values():
            own |= {robot.topic_name(topic) for topic in (PLAN, GOAL_POSE, SCAN)}
        wanted = {
            (each.name, each.record): each.detail
            for each in self._graph.entities
            if each.kind == "pub" and each.record in DISPLAYED and each.name not in own
        }
        self._subscriptions.set_topics(dict(list(wanted.items())[:MAX_TOPICS]))
        self._moving.set_topics(
            {(each.name, TFMessage.ROS_TYPE): each.quality.name for each in (TF, TF_STATIC) if wanted}
        )
        for name in [each for each in self._sets if each not in {topic for topic, _ in wanted}]:
            self._remove([place for place in self.outlines if place[0] == name])
            del self._sets[name]
            self._held.pop(name, None)

    def _add(self, topic: str, message: Message) -> None:
        shown, came = self._sets.setdefault(topic, MarkerSet()), self.version + 1
        try:
            shown.add(markers_of(message), came, self._time.now)
        except BadInput:
            return
        self.version = came
        while len(shown.shown) > MAX_MARKERS:
            oldest = next(iter(shown.shown))
            del shown.shown[oldest]
            shown.gone[oldest] = came
        self._remove([(topic, *place) for place in shown.gone])
        shown.gone.clear()
        for place, (version, marker) in shown.shown.items():
            if version == came:
                self._draw((topic, *place), marker)

    def _draw(self, place: tuple[str, str, int], marker: Marker) -> None:
        try:
            outline = marker_outline(marker, pose_in_world(self._frames, marker.header))
        except BadInput:
            self._remove([place])
            return
        self.outlines.pop(place, None)
        self.outlines[place] = self.version, outline
        self.gone.pop(place, None)

    def _remove(self, places: list[tuple[str, str, int]]) -> None:
        for place in places:
            if self.outlines.pop(place, None) is not None:
                self.gone[place] = self.version = self.version + 1
        while len(self.gone) > MAX_GONE:
            del self.gone[next(iter(self.gone))]


class MarkersChannel:
    """Sends the markers that have changed, and the ids of removed ones."""

    period, streams = 0.1, True

    def __init__(self, markers: MarkerTracker) -> None:
        self._markers = markers

    @property
    def version(self) -> int:
        """The version of the markers."""
        return self._markers.version

    def set_enabled(self, enabled: bool) -> None:
        """Subscribe to the markers; they stay subscribed."""
        self._markers.enable()

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the markers."""

    def delta(self, since: int) -> str | None:
        markers = self._markers
        changed = [
            {"id": " ".join(map(str, place)), "topic": place[0], **outline}
            for place, (version, outline) in markers.outlines.items()
            if version > since
        ]
        gone = [" ".join(map(str, place)) for place, version in markers.gone.items() if version > since >= 0]
        return as_json("markers", first=since < 0, shapes=changed, gone=gone)


def marker_outline(marker: Marker, frame: Pose3) -> dict[str, Any]:
    """Return a marker's drawing for the page; ``frame`` is the pose of its frame in the world.

    Returns:
        Its ``kind`` (``area``, ``line`` or ``text``), ``colour`` and ``outlines``, the ``width`` [m] of a line, and the
        ``text`` with its height [m] as ``width``.

    Raises:
        BadInput: It cannot be drawn.
    """
    pose, size = frame @ Pose3.from_msg(marker.pose), marker.scale
    shape: dict[str, Any] = {"kind": "area", "colour": _colour(marker)}
    match marker.type:
        case Marker.LINE_STRIP:
            return {**shape, "kind": "line", "width": size.x, "outlines": [_flat(_points(marker, pose))]}
        case Marker.LINE_LIST:
            ends = _points(marker, pose)
            pairs = ends[: len(ends) // 2 * 2].reshape(-1, 2, 3)
            return {**shape, "kind": "line", "width": size.x, "outlines": [_flat(each) for each in pairs]}
        case Marker.TEXT_VIEW_FACING:
            at = _flat(np.array([pose.position]))
            return {**shape, "kind": "text", "text": marker.text[:200], "width": size.z, "outlines": [at]}
    return {**shape, "outlines": _areas(marker, pose)}


def _areas(marker: Marker, pose: Pose3) -> list[Outline]:
    size = marker.scale.x, marker.scale.y, marker.scale.z
    match marker.type:
        case Marker.ARROW:
            return [_arrow(marker, pose)]
        case Marker.CUBE:
            return [_flat(box_footprint(pose, size).polygon())]
        case Marker.SPHERE:
            return [_flat(sphere_footprint(pose, max(size[0], size[1])).polygon())]
        case Marker.CYLINDER:
            return [_flat(cylinder_footprint(pose, max(size[0], size[1]), size[2]).polygon())]
        case Marker.CUBE_LIST | Marker.POINTS:
            square = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size[:2]
            return [_flat(at[:2] + square) for at in _points(marker, pose)]
        case Marker.SPHERE_LIST:
            return [
                _flat(sphere_footprint(Pose3(tuple(at)), size[0]).polygon()) for at in _points(marker, pose).tolist()
            ]
        case Marker.TRIANGLE_LIST if marker.points:
            return [_flat(each.corners) for each in triangle_footprints(pose, marker_triangles(marker))[:MAX_TRIANGLES]]
        case Marker.MESH_RESOURCE:
            return [_flat(points_footprint(pose, marker_triangles(marker).reshape(-1, 3)).polygon())]
    raise BadInput(f"a marker {marker.ns!r} of the type {marker.type} with {len(marker.points)} points is not drawn")


def _arrow(marker: Marker, pose: Pose3) -> Outline:
    """Return an arrow's outline: between its two points, or along the x axis of its pose."""
    if len(marker.points) >= 2:
        start, end = _points(marker, pose)[:2, :2]
        width = marker.scale.x
    else:
        start, end = transformed(pose, np.array([(0.0, 0.0, 0.0), (marker.scale.x, 0.0, 0.0)]))[:, :2]
        width = marker.scale.y
    along = end - start
    length = float(np.hypot(*along))
    across = np.array((-along[1], along[0])) / length * width if length else np.zeros(2)
    neck = start + (1 - HEAD) * along
    corners = [start + across / 2, neck + across / 2, neck + across, end]
    corners += [neck - across, neck - across / 2, start - across / 2]
    return _flat(np.array(corners))


def _points(marker: Marker, pose: Pose3) -> Floats:
    rows = np.array([(each.x, each.y, each.z) for each in marker.points[:MAX_POINTS]], np.float64).reshape(-1, 3)
    return transformed(pose, rows) if len(rows) else rows


def _flat(corners: Floats) -> Outline:
    """Flatten corners to an outline, rounded to the millimetre."""
    outline: Outline = np.round(corners[:, :2], 3).ravel().tolist()
    return outline


def _colour(marker: Marker) -> str:
    c = marker.color if not marker.colors else marker.colors[0]
    return "#{:02x}{:02x}{:02x}{:02x}".format(*(round(255 * each) for each in (c.r, c.g, c.b, c.a)))
