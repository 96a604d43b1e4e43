"""Summarises a bag: duration, topics, counts, rates, files and problems."""

from __future__ import annotations

import msgspec

from services.bag.channel import Channel
from services.bag.reader import Bag, Timeline, is_sidecar, metadata_count, metadata_counts, unplayable_reason


class TopicInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One topic; ``rate`` [Hz] is in simulated time, None unless its messages have two different times."""

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
    """A bag, with times in s: ``start`` and ``wall_seconds`` are wall time, ``seconds`` is simulated time."""

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


class _TimeSpan:
    """The time [ns] that messages cover, summed over the segments between resets of the time."""

    def __init__(self) -> None:
        self.messages = 0
        self._segments: dict[int, tuple[int, int]] = {}

    def add(self, segment: int, time: int) -> None:
        """Add a message at ``time`` [ns]."""
        first, last = self._segments.get(segment, (time, time))
        self._segments[segment] = min(first, time), max(last, time)
        self.messages += 1

    @property
    def elapsed(self) -> int:
        """Total time [ns]; from the earliest to the latest time of each segment, since senders interleave."""
        return sum(last - first for first, last in self._segments.values())

    @property
    def rate(self) -> float | None:
        """Message rate [Hz]; None if the messages cover no time."""
        intervals = self.messages - len(self._segments)
        return intervals / self.elapsed * 1e9 if self.elapsed else None


def bag_info(bag: Bag) -> BagInfo:
    """Read and summarise the whole bag; 100,000 messages take about half a second."""
    spans: dict[Channel, _TimeSpan] = {}
    simulated, wall, timeline = _TimeSpan(), _TimeSpan(), Timeline()
    start: int | None = None
    for entry in bag.entries():
        if is_sidecar(entry.channel):
            continue
        segment = timeline.locate(entry.publish_time).segment
        spans.setdefault(entry.channel, _TimeSpan()).add(segment, entry.publish_time)
        simulated.add(segment, entry.publish_time)
        wall.add(0, entry.log_time)
        start = entry.log_time if start is None else min(start, entry.log_time)
    topics = sorted(spans, key=lambda channel: channel.topic)
    return BagInfo(
        path=str(bag.path),
        bytes=bag.size,
        start=(start or 0) / 1e9,
        wall_seconds=wall.elapsed / 1e9,
        seconds=simulated.elapsed / 1e9,
        messages=simulated.messages,
        topics=tuple(_topic(channel, spans[channel]) for channel in topics),
        files=tuple(FileInfo(name=each.name, bytes=each.stat().st_size) for each in bag.files),
        troubles=tuple(bag.problems),
        lost=lost_messages(bag),
        unwritten=metadata_count(bag.metadata, "unwritten"),
    )


def _topic(channel: Channel, span: _TimeSpan) -> TopicInfo:
    reason = unplayable_reason(channel)
    return TopicInfo(
        topic=channel.topic,
        type=channel.ros_type,
        messages=span.messages,
        rate=span.rate,
        latched=channel.quality.name == "LATCHED",
        encoding=channel.encoding,
        playable=not reason,
        reason=reason,
    )


def lost_messages(bag: Bag) -> dict[str, int]:
    """Return the number of messages that did not reach the recorder, by topic."""
    return metadata_counts(bag.metadata, "lost")
