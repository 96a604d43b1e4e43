"""What nodes publish to be drawn: markers, paths, poses, maps and scans of any topic, on the map."""

from __future__ import annotations

from typing import Any

from messages.base import Message
from messages.nav import OccupancyGrid
from messages.se3 import IDENTITY, Pose3
from messages.sensor import LaserScan
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import GOAL_POSE, PLAN, SCAN, TF, TF_STATIC, WORLD_MARKERS
from messages.visualization import Marker
from services.driving.displays import DISPLAYED, MarkerSet, markers_of
from services.panel.clock import SimTimeMap
from services.panel.graph import NodeGraph
from services.panel.marker_outlines import marker_outline
from services.panel.protocol import as_json
from services.panel.robots import WORLD, RobotTracker
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.errors import BadInput, NoTransform
from services.runtime.tf.buffer import TransformBuffer

PERIODS_S = {LaserScan.ROS_TYPE: 0.2, OccupancyGrid.ROS_TYPE: 2.0}
"""Wall time between two messages of a topic that are drawn, for types that come often or cost much."""
MAX_TOPICS = 32
MAX_GONE = 10_000
"""Markers that are not shown any more, which pages are told of."""
MAX_MARKERS = 5000
"""Markers of a topic that are shown; the oldest give way."""


class MarkerTracker:
    """The markers of all topics that carry something to draw; ``version`` grows with each change.

    Topics are read from the first look of a page on, since most senders do not repeat what they drew. What robots of
    this project publish for themselves is drawn elsewhere: plans, goals, and the scan of the robot that is chosen.
    """

    def __init__(
        self, subscriptions: SharedSubscriptions, graph: NodeGraph, robots: RobotTracker, time: SimTimeMap
    ) -> None:
        self.version = 0
        self.outlines: dict[tuple[str, str, int], tuple[int, dict[str, Any]]] = {}
        """By topic, namespace and id: the version that a marker came with, and how it is drawn."""
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
        """The newest message of a topic that is not due yet."""

    def enable(self) -> None:
        """Somebody looks."""
        self._enabled = True

    def update(self, now: float) -> None:
        """Take in what has come; ``now`` is wall time [s]."""
        if not self._enabled:
            return
        if self._reconciled != (self._graph.version, self._robots.version):
            self._reconciled = self._graph.version, self._robots.version
            self._reconcile()
        self._end_lifetimes()
        for message, _ in self._moving.messages(TF.name, TFMessage.ROS_TYPE):
            self._frames.add(message.transforms, b"")
        for message, _ in self._moving.messages(TF_STATIC.name, TFMessage.ROS_TYPE):
            self._frames.add_static(message.transforms, b"")
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

    def _end_lifetimes(self) -> None:
        if self._epoch != self._time.epoch:
            self._epoch = self._time.epoch
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
            outline = marker_outline(marker, self._frame(marker.header))
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

    def _frame(self, header: Header) -> Pose3:
        """The pose of a frame in the world; one that no transform connects with it counts as the world itself."""
        if header.frame_id.lstrip("/") in ("", WORLD):
            return IDENTITY
        for time in (header.stamp.ns or None, None):
            try:
                return self._frames.lookup(WORLD, header.frame_id, time).transform
            except NoTransform:
                continue
        return IDENTITY


class MarkersChannel:
    """Tells the markers that have changed, and which are gone."""

    period, streams = 0.1, True

    def __init__(self, markers: MarkerTracker) -> None:
        self._markers = markers

    @property
    def version(self) -> int:
        """The markers'."""
        return self._markers.version

    def set_enabled(self, wanted: bool) -> None:
        """Read them from now on."""
        self._markers.enable()

    def update(self, now: float) -> None:
        """The hub updates the markers."""

    def delta(self, since: int) -> str | None:
        markers = self._markers
        changed = [
            {"id": " ".join(map(str, place)), "topic": place[0], **outline}
            for place, (version, outline) in markers.outlines.items()
            if version > since
        ]
        gone = [" ".join(map(str, place)) for place, version in markers.gone.items() if version > since >= 0]
        return as_json("markers", first=since < 0, shapes=changed, gone=gone)
