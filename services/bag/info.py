"""What a bag holds: span, topics, counts, rates, files, and what is wrong with it."""

from __future__ import annotations

import json
from collections.abc import Mapping

import msgspec

from services.bag.channel import Channel
from services.bag.reading import Bag
from services.bag.typed import beside, why_not


class TopicInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One topic; ``rate`` [Hz] is by simulated time, None for fewer than two messages or when they bear one time."""

    topic: str
    type: str
    messages: int
    rate: float | None
    latched: bool
    encoding: str
    playable: bool
    reason: str = ""


class FileInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One file."""

    name: str
    bytes: int


class BagInfo(msgspec.Struct, frozen=True, kw_only=True):
    """A bag. Times in s: ``start`` by the clock on the wall, ``wall_seconds`` long there, ``seconds`` simulated."""

    path: str
    bytes: int
    start: float
    wall_seconds: float
    seconds: float
    messages: int
    topics: tuple[TopicInfo, ...]
    files: tuple[FileInfo, ...]
    troubles: tuple[str, ...]
    lost: dict[str, int]
    unwritten: int


class _Count:
    """What is counted of a topic."""

    def __init__(self) -> None:
        self.messages, self.elapsed, self.last = 0, 0, 0

    def add(self, time_ns: int) -> None:
        """One more; where time falls back, after a reset, the counting of it begins anew."""
        if self.messages and time_ns > self.last:
            self.elapsed += time_ns - self.last
        self.messages, self.last = self.messages + 1, time_ns

    @property
    def rate(self) -> float | None:
        """Messages per second."""
        return (self.messages - 1) / self.elapsed * 1e9 if self.elapsed else None


def info(bag: Bag) -> BagInfo:
    """Read the whole bag and tell of it; 100,000 messages take about half a second."""
    counts: dict[Channel, _Count] = {}
    whole = _Count()
    first = last = 0
    for entry in bag.entries():
        if beside(entry.channel):
            continue
        first, last = first or entry.log_time, max(last, entry.log_time)
        counts.setdefault(entry.channel, _Count()).add(entry.publish_time)
        whole.add(entry.publish_time)
    topics = sorted(counts, key=lambda channel: channel.topic)
    return BagInfo(
        path=str(bag.path),
        bytes=bag.size,
        start=first / 1e9,
        wall_seconds=(last - first) / 1e9,
        seconds=whole.elapsed / 1e9,
        messages=whole.messages,
        topics=tuple(_topic(channel, counts[channel]) for channel in topics),
        files=tuple(FileInfo(name=each.name, bytes=each.stat().st_size) for each in bag.files),
        troubles=tuple(bag.troubles),
        lost=_table(bag.notes, "lost"),
        unwritten=_number(bag.notes, "unwritten"),
    )


def _topic(channel: Channel, count: _Count) -> TopicInfo:
    reason = why_not(channel)
    return TopicInfo(
        topic=channel.topic,
        type=channel.ros_type,
        messages=count.messages,
        rate=count.rate,
        latched=channel.quality.name == "LATCHED",
        encoding=channel.encoding,
        playable=not reason,
        reason=reason,
    )


def _number(notes: Mapping[str, str], name: str) -> int:
    text = notes.get(name, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 20 else 0


def _table(notes: Mapping[str, str], name: str) -> dict[str, int]:
    try:
        return msgspec.convert(json.loads(notes.get(name, "{}")), dict[str, int])
    except (ValueError, msgspec.ValidationError):
        return {}
