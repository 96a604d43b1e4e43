"""Writes received messages to a bag as CDR, in order and with their times, and counts lost ones."""

from __future__ import annotations

import json
import time
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable
from typing import Any

from messages.base import Message, WrongPayload, decoder
from messages.cdr.sidecar import split
from messages.cdr.write import NotWritable, writer
from messages.interfaces.records import find_record
from messages.rosgraph import Clock
from messages.std import stamp_of
from messages.tf import TFMessage
from messages.topics import CLOCK, TF, TF_STATIC, Quality
from services.bag.channel import CDR, SENDER_SIDECAR, SIDECAR, Channel, Sender, channel_of, raw_channel
from services.bag.mcap_writer import disk_space
from services.bag.writer import BagWriter
from services.recorder.subscriptions import Subscriptions
from services.recorder.urdf_prefix import UrdfPrefixer
from services.runtime.log import Log
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import NODE_BYTES, SampleInfo

MAX_STAMP_OFFSET_NS = 1_000_000_000
"""Maximum difference [ns] between a message's stamp and the clock; other stamps are ignored."""


class PublishTimes:
    """Assigns simulation times from ``/clock``; without a clock, wall times."""

    def __init__(self) -> None:
        self.clock: int | None = None

    def publish_time(self, message: object, log_time: int, has_clock: bool) -> int:
        """Return the simulation time [ns] of a message: its stamp if it is near the clock, else the clock.

        Args:
            message: the message, or its payload if its type is unknown.
            log_time: wall time at which it was received [ns].
            has_clock: whether a node publishes ``/clock``, even if no message has arrived yet.
        """
        if isinstance(message, Clock):
            self.clock = max(0, message.clock.ns)
        if self.clock is None:
            return 0 if has_clock else log_time
        stamp = stamp_of(message)
        return (
            stamp if stamp is not None and abs(stamp - self.clock) <= MAX_STAMP_OFFSET_NS and stamp >= 0 else self.clock
        )


def receive_time(source_ns: int | None, since: int, now: int) -> int:
    """Return the wall time [ns] of a message: its send time, clamped to the span in which it must have arrived."""
    return now if source_ns is None else min(max(source_ns, since), now)


REORDER_DELAY_S = 0.1
"""Wall time [s] that a message is held back for earlier ones that are still on their way."""

ReceivedMessage = tuple[Subscriber[Any], Any, SampleInfo | None]
"""A subscriber, one of its messages, and the message's sender, time and number if known."""


class ReorderBuffer:
    """Sorts messages by the time of sending, by holding each back for REORDER_DELAY_S."""

    def __init__(self) -> None:
        self._since = time.time_ns()
        self._waiting: list[tuple[int, ReceivedMessage]] = []

    def push(self, received: ReceivedMessage, wall: int) -> None:
        """Add a message that was received by ``wall`` [ns]."""
        origin = received[2]
        self._waiting.append(
            (receive_time(origin.source_ns if origin is not None else None, self._since, wall), received)
        )

    def drain(self, wall: int, end: bool) -> list[tuple[int, ReceivedMessage]]:
        """Return messages at least REORDER_DELAY_S older than ``wall`` [ns], with their times; all at the ``end``."""
        self._since = wall if end else max(self._since, wall - round(REORDER_DELAY_S * 1e9))
        self._waiting.sort(key=_receive_time)
        due = bisect_right(self._waiting, self._since, key=_receive_time)
        drained, self._waiting = self._waiting[:due], self._waiting[due:]
        return drained


def _receive_time(entry: tuple[int, ReceivedMessage]) -> int:
    return entry[0]


LOW_DISK_FACTOR = 10
"""A warning is logged if less than this multiple of a bag's disk reserve is free."""
DISK_CHECK_PERIOD_S = 10.0
"""Wall time [s] between two checks of the disk."""
_UNKNOWN_SENDER = b"foreign"
"""Stands for all publishers that do not identify themselves."""


class BagRecorder:
    """Writes the messages of ``subscriptions`` to ``bag``."""

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
        self._learned: dict[str, Callable[[bytes], Message]] = {}
        self._noted: set[str] = set()
        self.unconvertible: Counter[str] = Counter()
        self.write_error = ""

    def record_tick(self, now: int) -> None:
        """Record the samples admitted at a lockstep tick, at simulation time ``now`` [ns].

        The other members read the same samples at this tick, and a replay repeats them. The order is the same in every
        run.
        """
        wall = time.time_ns()
        self._learn()
        for name in sorted(self._subscriptions.by_topic, key=lambda name: (name != CLOCK.name, name)):
            source = self._subscriptions.by_topic[name]
            for message, origin in source.messages:
                self._write(source, self._decoded(source, message), origin, wall, now)

    def record_remaining(self, now: int) -> None:
        """Record what arrived after the last tick, at simulation time ``now`` [ns], with times after that tick.

        No member has read it yet, and the simulation waits for the recorder. A message without a stamp is placed 1 ns
        after the last clock before it, between two steps.
        """
        self._update_clock()
        wall = time.time_ns()
        self._learn()
        self._publish_times.clock = now
        self._enqueue(wall)
        for _, (source, payload, origin) in self._reorder_buffer.drain(wall, end=True):
            message = self._decoded(source, payload)
            unstamped = stamp_of(message) is None
            later = max(self._publish_times.publish_time(message, wall, has_clock=True) + unstamped, now + 1)
            if source.name in self._subscriptions.by_topic:
                self._write(source, message, origin, wall, later)

    def record(self, end: bool = False) -> None:
        """Record messages in the order of sending, except those of the last REORDER_DELAY_S; all at the ``end``."""
        self._update_clock()
        wall = time.time_ns()
        self._learn()
        self._enqueue(wall)
        for log_time, (source, payload, origin) in self._reorder_buffer.drain(wall, end):
            message = self._decoded(source, payload)
            publish_time = self._publish_times.publish_time(message, log_time, self._subscriptions.has_clock)
            if source.name in self._subscriptions.by_topic:
                self._write(source, message, origin, log_time, publish_time)

    @property
    def now(self) -> int:
        """Simulation time [ns] of the last clock message; 0 without one."""
        return self._publish_times.clock or 0

    def flush_due(self) -> None:
        """Write a chunk if it is due, and warn about lost messages."""
        try:
            self._bag.flush_due()
        except OSError as error:
            self._report_error(error)
        self._check_disk()
        lost = sum(self.lost.values())
        if lost > self._lost_reported:
            self._log.warn(
                f"{lost} messages were lost before they reached the recorder: is the machine too slow?", every=5.0
            )
            self._lost_reported = lost

    def close(self) -> None:
        """Write the remaining messages, and the counts of missing ones."""
        self._bag.metadata["lost"] = json.dumps(self.lost)
        self._bag.metadata["unfit"] = json.dumps(self.unconvertible)
        self._bag.metadata["unwritten"] = str(self._bag.unwritten)
        try:
            self._bag.close()
        except OSError as error:
            self._report_error(error)

    @property
    def lost(self) -> dict[str, int]:
        """Number of messages by topic that were sent and did not arrive."""
        return {name: source.lost for name, source in sorted(self._subscriptions.by_topic.items()) if source.lost}

    def _decoded(self, source: Subscriber[Any], message: Any) -> Any:
        """Decode a payload whose type was learned after its topic was subscribed to; return others unchanged."""
        if source.name not in self._subscriptions.raw:
            return message
        name = source.topic.record.ROS_TYPE
        if (record := find_record(name)) is None:
            self._note_unknown(source.name, f"is {name}, which is unknown here: it is kept as MessagePack")
            return message
        if (read := self._learned.get(name)) is None:
            read = self._learned[name] = decoder(record)
        try:
            return read(message)
        except WrongPayload as error:
            self._note_unknown(
                source.name, f"carries messages that are not {name}; they are kept as MessagePack: {error}"
            )
            return message

    def _note_unknown(self, topic: str, problem: str) -> None:
        if topic not in self._noted:
            self._noted.add(topic)
            self._log.warn(f"{topic} {problem}")

    def _learn(self) -> None:
        """Learn the types that scripts announce, and the frame names from which robot descriptions get a prefix."""
        self._subscriptions.learn_interfaces()
        for topic in (TF, TF_STATIC):
            if (
                source := self._subscriptions.by_topic.get(topic.name)
            ) is not None and source.topic.record is TFMessage:
                self._urdf_prefixer.add_frames(message for message, _ in source.messages)

    def _update_clock(self) -> None:
        """Read clock messages once more: subscribers are drained in turn, and time may have advanced meanwhile."""
        clock = self._subscriptions.clock
        early = clock.messages
        clock.update()
        clock.messages = [*early, *clock.messages]

    def _enqueue(self, wall: int) -> None:
        """Move received messages to the reorder buffer."""
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
        if isinstance(message, bytes):
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
            self._log.warn(f"{name}: a message does not fit its ROS type and is not recorded: {error}", every=5.0)

    def _additional_sender(self, name: str, origin: SampleInfo | None) -> bytes:
        """Return the node that sent a message, empty for the first node on the topic.

        A late subscriber gets the last message of each node; a restarted node replaces its former self.
        """
        node = origin.publisher[:NODE_BYTES] if origin is not None else _UNKNOWN_SENDER
        return node if self._first_sender.setdefault(name, node) != node else b""

    def _add(self, channel: Channel, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        try:
            self._bag.write(channel, sequence, log_time, publish_time, data)
        except OSError as error:
            self._report_error(error)

    def _channel_of(self, topic: str, message: Message, source: Subscriber[Any]) -> Channel:
        key = topic, f"{CDR} {type(message).ROS_TYPE}"
        return self._channels.get(key) or self._channel(topic, channel_of(topic, type(message), source.topic.quality))

    def _channel(self, topic: str, made: Channel) -> Channel:
        return self._channels.setdefault((topic, f"{made.encoding} {made.type}"), made)

    def _check_disk(self) -> None:
        """Warn while there is still time to free space."""
        now = time.monotonic()
        if now - self._disk_checked < DISK_CHECK_PERIOD_S:
            return
        self._disk_checked = now
        try:
            free, reserve = disk_space(self._bag.folder)
        except OSError:
            return  # writing reports it
        if free < LOW_DISK_FACTOR * reserve:
            self._log.warn(
                f"{free / 1e6:.0f} MB are left on the disk of {self._bag.folder}: nothing more is recorded when "
                f"{reserve / 1e6:.0f} MB are left",
                every=60.0,
            )

    def _report_error(self, error: OSError) -> None:
        self.write_error = error.strerror or str(error)
        self._log.error(
            f"the recording cannot be written ({error.strerror}): {self._bag.unwritten} messages are missing from "
            f"{self._bag.folder} so far; nothing else is affected",
            every=5.0,
        )
