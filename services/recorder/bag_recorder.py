"""Writes received messages to a bag: their order and times, CDR encoding, and a count of what is lost."""

from __future__ import annotations

import json
import time
from bisect import bisect_right
from collections import Counter
from typing import Any

from messages.base import Message
from messages.cdr.sidecar import split
from messages.cdr.write import NotWritable, writer
from messages.rosgraph import Clock
from messages.std import Header
from messages.tf import TFMessage
from messages.topics import CLOCK, TF, TF_STATIC, Quality
from services.bag.channel import SENDER_SIDECAR, SIDECAR, Channel, Sender, channel_of, raw_channel
from services.bag.mcap_writer import disk_space
from services.bag.writer import BagWriter
from services.recorder.subscriptions import Subscriptions
from services.recorder.urdf_prefix import UrdfPrefixer
from services.runtime.log import Log
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import NODE_BYTES, SampleInfo

MAX_STAMP_OFFSET_NS = 1_000_000_000
"""A stamp that is farther from the clock is not the time of the message."""


class PublishTimes:
    """Follows ``/clock``, message by message; without one, simulated time is that on the wall."""

    def __init__(self) -> None:
        self.clock: int | None = None

    def publish_time(self, message: object, log_time: int, timed: bool) -> int:
        """The simulated time [ns] of a message: its stamp if it is near the clock, else the clock.

        ``has_clock`` tells whether there is a clock, though it may not have spoken yet.
        """
        if isinstance(message, Clock):
            self.clock = max(0, message.clock.ns)
        if self.clock is None:
            return 0 if timed else log_time
        stamp = header_stamp(message) if isinstance(message, Message) else None
        return (
            stamp if stamp is not None and abs(stamp - self.clock) <= MAX_STAMP_OFFSET_NS and stamp >= 0 else self.clock
        )


def receive_time(source_ns: int | None, since: int, now: int) -> int:
    """When a message came, ns on the wall: when it was sent, within the span in which it must have come."""
    return now if source_ns is None else min(max(source_ns, since), now)


def header_stamp(message: Message) -> int | None:
    """The stamp [ns] in a message's header, or in that of its first transform."""
    if isinstance(message, TFMessage) and message.transforms:
        message = message.transforms[0]
    header = getattr(message, "header", None)
    return header.stamp.ns if isinstance(header, Header) else None


REORDER_DELAY_S = 0.1
"""Wall time for which a message waits for those that were sent before it."""

ReceivedMessage = tuple[Subscriber[Any], Any, SampleInfo | None]
"""An input, a message of it, and where that came from."""


class ReorderBuffer:
    """Keeps messages until none that was sent earlier is to be expected."""

    def __init__(self) -> None:
        self._since = time.time_ns()
        self._waiting: list[tuple[int, ReceivedMessage]] = []

    def push(self, received: ReceivedMessage, wall: int) -> None:
        """A message was there at ``wall`` [ns]."""
        origin = received[2]
        self._waiting.append(
            (receive_time(origin.source_ns if origin is not None else None, self._since, wall), received)
        )

    def drain(self, wall: int, end: bool) -> list[tuple[int, ReceivedMessage]]:
        """Messages at least REORDER_DELAY_S older than ``wall`` [ns], with receive times; all at the ``end``."""
        self._since = wall if end else max(self._since, wall - round(REORDER_DELAY_S * 1e9))
        self._waiting.sort(key=_receive_time)
        ripe = bisect_right(self._waiting, self._since, key=_receive_time)
        taken, self._waiting = self._waiting[:ripe], self._waiting[ripe:]
        return taken


def _receive_time(entry: tuple[int, ReceivedMessage]) -> int:
    return entry[0]


LOW_DISK_FACTOR = 10
"""The disk is low when less than so many times the room is free that a bag leaves to others."""
DISK_CHECK_PERIOD_S = 10.0
"""Wall time between two looks at the disk."""
_UNKNOWN_SENDER = b"foreign"
"""Stands for all senders that do not tell who they are."""


class BagRecorder:
    """Writes what ``subscriptions`` has heard to ``bag``."""

    def __init__(self, bag: BagWriter, subscriptions: Subscriptions, log: Log) -> None:
        self._bag, self._subscriptions, self._log = bag, subscriptions, log
        self._publish_times = PublishTimes()
        self._urdf_prefixer = UrdfPrefixer()
        self._channels: dict[tuple[str, str], Channel] = {}
        self._numbers: Counter[str] = Counter()
        self._first_sender: dict[str, bytes] = {}
        self._reorder_buffer = ReorderBuffer()
        self._lost_reported = 0
        self._disk_checked = 0.0
        self.unconvertible: Counter[str] = Counter()
        self.write_error = ""

    def record_tick(self, now: int) -> None:
        """A tick of lockstep, at ``now`` [ns] of simulation time: from then on, what has come counts for its readers.

        So it is what a replay must repeat at this tick. The order is the same in every run.
        """
        wall = time.time_ns()
        self._learn_frames()
        for name in sorted(self._subscriptions.by_topic, key=lambda name: (name != CLOCK.name, name)):
            source = self._subscriptions.by_topic[name]
            for message, origin in source.messages:
                self._write(source, message, origin, wall, now)

    def record_remaining(self, now: int) -> None:
        """What came after the last tick, at ``now`` [ns]: nobody had it yet, so its time lies after that tick.

        Its own stamp tells it; one without a stamp lies right after the clock that was sent before it, at no step.
        """
        wall = time.time_ns()
        self._learn_frames()
        self._publish_times.clock = now
        self._enqueue(wall)
        for _, (source, message, origin) in self._reorder_buffer.drain(wall, end=True):
            bare = header_stamp(message) is None and not isinstance(message, Clock)
            later = max(self._publish_times.publish_time(message, wall, timed=True) + bare, now + 1)
            if source.name in self._subscriptions.by_topic:
                self._write(source, message, origin, wall, later)

    def record(self, end: bool = False) -> None:
        """Write messages in the order of sending, but not those of the last REORDER_DELAY_S; at the ``end``, all."""
        clock = self._subscriptions.clock
        # Inputs are emptied in turn: what a clock told meanwhile belongs before what came after it.
        early = clock.messages
        clock.update()
        clock.messages = [*early, *clock.messages]
        wall = time.time_ns()
        self._learn_frames()
        self._enqueue(wall)
        for log_time, (source, message, origin) in self._reorder_buffer.drain(wall, end):
            publish_time = self._publish_times.publish_time(message, log_time, self._subscriptions.has_clock)
            if source.name in self._subscriptions.by_topic:
                self._write(source, message, origin, log_time, publish_time)

    @property
    def now(self) -> int:
        """Simulated time [ns], as far as the clock has told it; 0 without one."""
        return self._publish_times.clock or 0

    def flush_due(self) -> None:
        """Write a chunk if it is time to, and tell what was lost."""
        try:
            self._bag.flush_due()
        except OSError as error:
            self._report_error(error)
        self._check_disk()
        lost = sum(self.lost.values())
        if lost > self._lost_reported:
            self._log.warn(f"{lost} messages were lost on their way to the bag: is the machine too slow?", every=5.0)
            self._lost_reported = lost

    def close(self) -> None:
        """Write what is left, and the account."""
        self._bag.metadata["lost"] = json.dumps(self.lost)
        self._bag.metadata["unfit"] = json.dumps(self.unconvertible)
        self._bag.metadata["unwritten"] = str(self._bag.unwritten)
        try:
            self._bag.close()
        except OSError as error:
            self._report_error(error)

    @property
    def lost(self) -> dict[str, int]:
        """Messages that were sent and did not arrive, by topic."""
        return {name: source.lost for name, source in sorted(self._subscriptions.by_topic.items()) if source.lost}

    def _learn_frames(self) -> None:
        """Whatever comes with a description of a robot may tell how its frames are called."""
        for topic in (TF, TF_STATIC):
            if (
                source := self._subscriptions.by_topic.get(topic.name)
            ) is not None and source.topic.record is TFMessage:
                self._urdf_prefixer.add_frames(message for message, _ in source.messages)

    def _enqueue(self, wall: int) -> None:
        """Leave it to the order of sending when what is there is written."""
        for source in {**self._subscriptions.by_topic, CLOCK.name: self._subscriptions.clock}.values():
            for message, origin in source.messages:
                self._reorder_buffer.push((source, message, origin), wall)

    def _write(
        self, source: Subscriber[Any], message: Any, origin: SampleInfo | None, log_time: int, publish_time: int
    ) -> None:
        name = source.name
        if origin is None:
            self._numbers[name] += 1
        sequence = origin.sequence if origin is not None else self._numbers[name]
        if source.topic.quality is Quality.LATCHED and (node := self._additional_sender(name, origin)):
            note = writer(Sender)(Sender(node=node))
            self._add(self._channel_of(name + SENDER_SIDECAR, Sender(), source), sequence, log_time, publish_time, note)
        if name in self._subscriptions.raw:
            raw = raw_channel(name, source.topic.record.ROS_TYPE, source.topic.quality)
            self._add(self._channel(name, raw), sequence, log_time, publish_time, message)
            return
        main, sidecar = split(message)
        if sidecar is None:
            main, sidecar = self._urdf_prefixer.apply(name, main)
        try:
            for each, topic in ((sidecar, name + SIDECAR), (main, name)):
                if each is not None:
                    data = writer(type(each))(each)
                    self._add(self._channel_of(topic, each, source), sequence, log_time, publish_time, data)
        except NotWritable as error:
            self.unconvertible[name] += 1
            self._log.warn(f"{name}: a message has no place in its ROS type and is not recorded: {error}", every=5.0)

    def _additional_sender(self, name: str, origin: SampleInfo | None) -> bytes:
        """The node behind a message, unless it was the first on its topic.

        A late joiner has the last message of each node; one that was started anew takes the place of the old one.
        """
        node = origin.publisher[:NODE_BYTES] if origin is not None else _UNKNOWN_SENDER
        return node if self._first_sender.setdefault(name, node) != node else b""

    def _add(self, channel: Channel, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        try:
            self._bag.write(channel, sequence, log_time, publish_time, data)
        except OSError as error:
            self._report_error(error)

    def _channel_of(self, topic: str, message: Message, source: Subscriber[Any]) -> Channel:
        key = topic, type(message).ROS_TYPE
        return self._channels.get(key) or self._channel(topic, channel_of(topic, type(message), source.topic.quality))

    def _channel(self, topic: str, made: Channel) -> Channel:
        return self._channels.setdefault((topic, made.type), made)

    def _check_disk(self) -> None:
        """Warn while there is time to make room."""
        now = time.monotonic()
        if now - self._disk_checked < DISK_CHECK_PERIOD_S:
            return
        self._disk_checked = now
        try:
            free, reserve = disk_space(self._bag.folder)
        except OSError:
            return  # writing tells it
        if free < LOW_DISK_FACTOR * reserve:
            self._log.warn(
                f"{free / 1e6:.0f} MB are left on the disk of {self._bag.folder}: nothing more is recorded when "
                f"{reserve / 1e6:.0f} MB are left",
                every=60.0,
            )

    def _report_error(self, error: OSError) -> None:
        self.write_error = error.strerror or str(error)
        self._log.error(
            f"the disk does not take the recording ({error.strerror}): {self._bag.unwritten} messages are missing from "
            f"{self._bag.folder} so far; nothing else is affected",
            every=5.0,
        )
