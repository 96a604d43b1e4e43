"""Plots on the page: the values of the requested fields, with their simulation time and unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

from msgspec import inspect

from messages.base import Message, WrongPayload
from messages.std import stamp_of
from messages.topics import TOPICS
from services.panel.clock import SimTimeMap
from services.panel.graph import NodeGraph
from services.panel.pages import Page
from services.panel.protocol import Samples, Subscribe, as_json, pack_samples
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.field_path import FieldPath, child, field_types, is_path, leaves, parse_path
from services.runtime.transport.wire import SampleInfo

LIST_PERIOD_S = 0.4
"""Wall time [s] between two lists of a topic's fields."""

MAX_STAMP_OFFSET_NS = 365 * 24 * 3600 * 1_000_000_000
"""A stamp that differs more from the last clock [ns] is wall time. The limit is wide: without pages no clock is read,
and the last one may be hours old."""
MAX_FIELDS = 600
"""Maximum listed leaves of a message."""
MAX_ARRAY_ELEMENTS = 64
"""Maximum listed elements of a list; a path can select any element."""

Scalar = bool | int | float | str | None
TopicType = tuple[str, str]


class Plots:
    """Subscribes once to each topic that pages plot; one that does not exist yet is subscribed to when it appears."""

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph, time: SimTimeMap) -> None:
        self._subscriptions, self._graph, self._time = SubscriptionGroup(subscriptions), graph, time
        self._requested: dict[Page, Subscribe] = {}
        self._newest: dict[str, object] = {}
        self._due = 0.0
        self._reconciled: tuple[int, int] = (-1, -1)
        self._changes = 0
        self._samples: dict[tuple[str, str], Samples] = {}
        self._steps: dict[str, dict[str, FieldPath]] = {}
        self._units: dict[tuple[str, str], str] = {}
        self._sent_units: dict[Page, dict[int, str]] = {}

    def set_subscription(self, page: Page, subscription: Subscribe | None) -> None:
        """Set what a page plots; None if it has closed."""
        if subscription is None:
            self._requested.pop(page, None)
            self._sent_units.pop(page, None)
        else:
            self._requested[page] = subscription
        self._changes += 1

    def update(self, now: float) -> None:
        """Read the new messages and send their samples to the pages; ``now`` is wall time [s]."""
        if self._reconciled != (self._graph.version, self._changes):
            self._reconciled = self._graph.version, self._changes
            self._reconcile()
        self._collect()
        self._send_samples()
        if now >= self._due:
            self._due = now + LIST_PERIOD_S
            self._send_fields()

    def _reconcile(self) -> None:
        """Subscribe to the topics that are requested and exist."""
        self._steps = {}
        names: set[str] = set()
        for subscription in self._requested.values():
            names.update(subscription.fields)
            for series in subscription.series:
                names.add(series.topic)
                self._steps.setdefault(series.topic, {})[series.path] = parse_path(series.path)
        wanted: dict[TopicType, str] = {}
        for name in sorted(names):
            entity = self._graph.publication(name)
            if entity is not None:
                wanted[name, entity.record] = entity.detail
        self._subscriptions.set_topics(wanted)
        self._newest = {name: message for name, message in self._newest.items() if name in names}
        self._units = {
            place: known for place, known in self._units.items() if place[1] in self._steps.get(place[0], ())
        }

    def _collect(self) -> None:
        self._samples = {}
        for name, record in self._subscriptions.topics():
            batch = self._subscriptions.messages(name, record)
            if not batch:
                continue
            self._newest[name] = batch[-1][0]
            paths = self._steps.get(name)
            if not paths:
                continue
            for path, steps in paths.items():
                if (name, path) not in self._units:
                    self._units[name, path] = field_unit(name, batch[-1][0], steps)
            lists = [(self._samples.setdefault((name, path), Samples()), steps) for path, steps in paths.items()]
            for message, origin in batch:
                time = self._time_of(message, origin)
                for samples, steps in lists:
                    value = read_number(message, steps)
                    if value is not None:
                        samples.add(time, value)

    def _time_of(self, message: object, origin: SampleInfo | None) -> float:
        """Return a sample's simulation time [s]: its stamp, or when it was sent if that is unset or foreign."""
        stamp, sent = stamp_of(message) or 0, self._time.at(origin)
        foreign = self._time.known and abs(stamp - sent) > MAX_STAMP_OFFSET_NS
        return (sent if foreign or not stamp else stamp) / 1e9

    def _send_samples(self) -> None:
        bodies = {place: (len(samples), samples.encode()) for place, samples in self._samples.items() if len(samples)}
        if not bodies:
            return
        for page, subscription in self._requested.items():
            packed = [
                (series.id, *bodies[series.topic, series.path])
                for series in subscription.series
                if (series.topic, series.path) in bodies
            ]
            if packed:
                page.enqueue(pack_samples(self._time.epoch, packed))

    def _send_fields(self) -> None:
        """Send each page the fields of the topics that it lists, and the units of its series."""
        listed: dict[str, str] = {}
        for page, subscription in self._requested.items():
            units = {
                series.id: known
                for series in subscription.series
                if (known := self._units.get((series.topic, series.path))) is not None
            }
            if units and self._sent_units.get(page) != units:
                self._sent_units[page] = units
                page.set_state("units", as_json("units", units=units))
            for name in subscription.fields:
                if name not in listed:
                    entity, message = self._graph.publication(name), self._newest.get(name)
                    listed[name] = as_json(
                        "fields",
                        topic=name,
                        type=entity.record if entity else "",
                        fields=list_fields(message) if message is not None else None,
                    )
                page.set_state(f"fields {name}", listed[name])


def read_number(message: Any, path: FieldPath) -> float | None:
    """Return the number at a path, a bool as 0 or 1; None if there is none or it is not finite."""
    value = message
    try:
        for step in path:
            value = child(value, step)
    except (LookupError, WrongPayload):
        return None
    if type(value) is float:
        return value if math.isfinite(value) else None
    return float(value) if isinstance(value, int) and abs(value) < 2**1000 else None


def list_fields(message: Any) -> list[tuple[str, Scalar]]:
    """Return the paths and values of a message's fields, at most MAX_FIELDS."""
    found = (
        (path, value[:200] if isinstance(value, str) else _json_scalar(value))
        for path, value in _leaves(message)
        if (value is None or isinstance(value, bool | int | float | str)) and is_path(path)
    )
    return list(islice(found, MAX_FIELDS))


def _leaves(message: object) -> Iterator[tuple[str, Any]]:
    """Yield the single values of a message; bytes (uint8[]) element by element up to MAX_ARRAY_ELEMENTS, else whole."""
    for path, value in leaves(message, max_elements=MAX_ARRAY_ELEMENTS):
        if isinstance(value, bytes) and len(value) <= MAX_ARRAY_ELEMENTS:
            yield from ((f"{path}[{index}]", each) for index, each in enumerate(value))
        else:
            yield path, value


def _json_scalar(value: bool | int | float | None) -> Scalar:
    """Return the value as JSON can represent it."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


_REP_103 = {
    ("geometry_msgs/Twist", "linear"): "m/s",
    ("geometry_msgs/Twist", "angular"): "rad/s",
    ("geometry_msgs/Pose", "position"): "m",
    ("geometry_msgs/Quaternion", "yaw"): "rad",
    ("geometry_msgs/Transform", "translation"): "m",
    ("geometry_msgs/Wrench", "force"): "N",
    ("geometry_msgs/Wrench", "torque"): "N m",
    ("sensor_msgs/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/Imu", "linear_acceleration"): "m/s²",
    ("sensor_msgs/JointState", "position"): "rad",
    ("sensor_msgs/JointState", "velocity"): "rad/s",
    ("sensor_msgs/JointState", "effort"): "N m",
    ("sensor_msgs/LaserScan", "ranges"): "m",
    ("sensor_msgs/Range", "range"): "m",
    ("sensor_msgs/PointCloud", "points"): "m",
}
"""Units of fields whose type is used for several quantities, by ROS type and field."""

_TOPIC_UNITS = {each.name: each.unit for each in TOPICS if each.unit}
"""Units of topics that carry one bare number."""


def field_unit(topic: str, message: Any, path: FieldPath) -> str:
    """Return the unit of the number at a path in a message of ``topic``; empty if unknown."""
    found, value = _TOPIC_UNITS.get(topic, ""), message
    try:
        for step in path:
            if isinstance(value, Message) and isinstance(step, str):
                found = _REP_103.get((value.ROS_TYPE, step)) or _declared_unit(type(value), step) or found
            value = child(value, step)
    except (LookupError, WrongPayload):
        pass
    return found


def _declared_unit(record: type[Message], field: str) -> str:
    """Return the unit in a field's annotation, or an empty text."""
    kind = field_types(record).get(field)
    return str((kind.extra or {}).get("unit", "")) if isinstance(kind, inspect.Metadata) else ""
