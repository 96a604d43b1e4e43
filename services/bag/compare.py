"""Compares two bags message by message and finds the first one that differs."""

from __future__ import annotations

import heapq
import math
from collections import defaultdict, deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec

from messages.base import WrongPayload
from messages.parameters import ParameterValues
from messages.plain import plain
from messages.topics import CLOCK, FLEET_STATE, HEALTH, LOCKSTEP, ROSOUT, SIM_STATUS
from services.bag.channel import RAW, SENDER_SIDECAR, SIDECAR, Channel
from services.bag.csv_export import flatten
from services.bag.reader import Bag, Entry, Timeline, plain_decoder

WALL_CLOCK_TOPICS = frozenset(each.name for each in (HEALTH, ROSOUT, FLEET_STATE, SIM_STATUS, LOCKSTEP))
"""Topics about the processes of one run: heartbeats, log lines, process ids, awaited members."""
WALL_CLOCK_FIELDS = frozenset({"since"})
"""The last names of fields that hold a time of the wall clock: ``since`` of an emergency stop."""
PLACE_PARAMETERS = frozenset({"output", "file", "address", "stops_file", "listen"})
"""Parameters with the paths and addresses at which a run writes and listens."""


class MessageDifference(msgspec.Struct, frozen=True, kw_only=True):
    """The first message that differs between two bags.

    ``time_s`` is its simulated time. ``number`` counts the topic's messages from 1. ``left`` and ``right`` are the
    values of ``field`` in the two bags. An empty ``field`` means that only one bag has the message: the other side is
    None. ``also`` names further topics that differ at the same time.
    """

    topic: str
    time_s: float
    number: int
    field: str
    left: Any
    right: Any
    also: tuple[str, ...] = ()


class BagComparison(msgspec.Struct, frozen=True, kw_only=True):
    """The result of comparing two bags: the messages and topics compared, up to ``end_s`` of simulated time."""

    messages: int
    topics: int
    end_s: float | None
    difference: MessageDifference | None


class _Located(NamedTuple):
    """An entry with its place: ``position`` [ns] from the bag's start, and the bag it is from (0 or 1)."""

    position: int
    side: int
    entry: Entry


class _Pair(NamedTuple):
    """Two entries that differ, in the order of the bags; None stands for a message that one bag lacks."""

    position: int
    topic: str
    number: int
    entries: tuple[Entry | None, Entry | None]
    values: tuple[str, Any, Any]


def compare_bags(left: Bag, right: Bag, end: int | None = None) -> BagComparison:
    """Compare two bags topic by topic, in the order of recording.

    Everything that depends on the wall clock or the folder is ignored: WALL_CLOCK_TOPICS, WALL_CLOCK_FIELDS,
    PLACE_PARAMETERS, receive times and sequence numbers. So are the revisions of parameters, which continue from run
    to run.

    Args:
        left: One bag.
        right: The other.
        end: Compare messages before this time [ns] from the start. By default up to the end of the shorter bag's
            ``/clock``, and everything if a bag has none.

    Returns:
        The number of messages compared, and the first difference.

    Raises:
        BadInput: A bag cannot be read at all.
    """
    if end is None:
        ends = [_clock_end(left), _clock_end(right)]
        end = min((each for each in ends if each is not None), default=None) if None not in ends else None
    merged = heapq.merge(_located(left, 0, end), _located(right, 1, end), key=lambda each: each.position)
    waiting: dict[str, deque[_Located]] = defaultdict(deque)
    compared: dict[str, int] = defaultdict(int)
    found: list[_Pair] = []
    for each in merged:
        if found and each.position > found[0].position:
            break
        topic = each.entry.channel.name
        queue = waiting[topic]
        if not queue or queue[0].side == each.side:
            queue.append(each)
            continue
        other = queue.popleft()
        compared[topic] += 1
        if (pair := _difference(topic, compared[topic], other, each)) is not None:
            found = _keep_first([*found, pair])
    found = _keep_first(
        [*found, *(_lone(topic, compared[topic] + 1, queue[0]) for topic, queue in waiting.items() if queue)]
    )
    return BagComparison(
        messages=sum(compared.values()),
        topics=len(compared),
        end_s=None if end is None else end / 1e9,
        difference=_report(found) if found else None,
    )


def _located(bag: Bag, side: int, end: int | None) -> Iterator[_Located]:
    """Yield the entries to compare, with their positions, which never decrease."""
    timeline = Timeline()
    for entry in bag.entries():
        position = timeline.locate(entry.publish_time).position
        if end is not None and position >= end:
            return
        if _base_topic(entry.channel) not in WALL_CLOCK_TOPICS:
            yield _Located(position, side, entry)


def _clock_end(bag: Bag) -> int | None:
    """Return the position [ns] of the last message on ``/clock``; None without one."""
    timeline, last = Timeline(), None
    for entry in bag.entries():
        position = timeline.locate(entry.publish_time).position
        if entry.channel.name == CLOCK.name:
            last = position
    return last


def _base_topic(channel: Channel) -> str:
    """Return the topic that a channel belongs to: its own, or the one whose sidecar it is."""
    return channel.name.removesuffix(SIDECAR).removesuffix(SENDER_SIDECAR)


def _difference(topic: str, number: int, first: _Located, second: _Located) -> _Pair | None:
    """Return the difference between two messages of a topic with the same number, or None."""
    if first.position != second.position:
        return _lone(topic, number, min(first, second, key=lambda each: each.position))
    left, right = (first.entry, second.entry) if first.side == 0 else (second.entry, first.entry)
    values = _first_field(left, right)
    return None if values is None else _Pair(first.position, topic, number, (left, right), values)


def _lone(topic: str, number: int, only: _Located) -> _Pair:
    """Return the difference for a message that the other bag lacks."""
    values = _values(only.entry)
    if only.side == 0:
        return _Pair(only.position, topic, number, (only.entry, None), ("", values, None))
    return _Pair(only.position, topic, number, (None, only.entry), ("", None, values))


def _first_field(left: Entry, right: Entry) -> tuple[str, Any, Any] | None:
    """Return the first field that differs, and its values; None if only fields of the wall clock differ."""
    if left.publish_time != right.publish_time:
        return "publish_time", left.publish_time / 1e9, right.publish_time / 1e9
    if left.channel.type != right.channel.type:
        return "type", left.channel.type, right.channel.type
    if left.data == right.data:
        return None
    one, other = dict(flatten(_values(left))), dict(flatten(_values(right)))
    for field in (*one, *(each for each in other if each not in one)):
        if field.rpartition(".")[2] not in WALL_CLOCK_FIELDS and not _same(one.get(field), other.get(field)):
            return field, one.get(field), other.get(field)
    return None


def _same(left: Any, right: Any) -> bool:
    both_nan = isinstance(left, float) and isinstance(right, float) and math.isnan(left) and math.isnan(right)
    return both_nan or (left == right and type(left) is type(right))


def _values(entry: Entry) -> Any:
    """Return a message as plain values; one that cannot be decoded as the hexadecimal digits of its bytes."""
    try:
        found = plain(entry.data) if entry.channel.encoding == RAW else plain_decoder(entry.channel)(entry.data)
    except WrongPayload:
        return {"data": entry.data.hex()}
    if entry.channel.type == ParameterValues.ROS_TYPE:
        del found["revision"]
        found["values"] = {each["name"]: each for each in found["values"] if each["name"] not in PLACE_PARAMETERS}
    return found


def _keep_first(found: list[_Pair]) -> list[_Pair]:
    """Return the differences at the earliest position, in the order of their topics."""
    first = min((each.position for each in found), default=0)
    return sorted((each for each in found if each.position == first), key=lambda each: each.topic)


def _report(found: list[_Pair]) -> MessageDifference:
    first = found[0]
    entry = first.entries[0] or first.entries[1]
    assert entry is not None
    also = dict.fromkeys(_base_topic(e.channel) for each in found[1:] for e in each.entries if e is not None)
    name = _base_topic(entry.channel)
    field, left, right = first.values
    return MessageDifference(
        topic=name,
        time_s=entry.publish_time / 1e9,
        number=first.number,
        field=field,
        left=left,
        right=right,
        also=tuple(each for each in also if each != name),
    )
