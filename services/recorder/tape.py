"""From messages to the bag: CDR, times, numbers, and an account of what is lost."""

from __future__ import annotations

import json
import time
from collections import Counter
from typing import Any

from messages.base import Message
from messages.cdr.extras import split
from messages.cdr.write import NotWritable, writer
from messages.rosgraph import Clock
from messages.tf import TFMessage
from messages.topics import CLOCK, TF, TF_STATIC, Quality
from services.bag.channel import BESIDE, SENDER, Channel, Sender, channel_of, raw_channel
from services.bag.folder import BagFolder
from services.bag.mcap_file import room
from services.recorder.fitting import Fitting
from services.recorder.listening import Listening
from services.recorder.order import Order
from services.recorder.times import Times, stamp_of
from services.runtime.inputs import Input
from services.runtime.log import Log
from services.runtime.network.wire import NODE_BYTES, Origin

LOW = 10
"""The disk is low when less than so many times the room is free that a bag leaves to others."""
LOOK_S = 10.0
"""Wall time between two looks at the disk."""
_FOREIGN = b"foreign"
"""Stands for all senders that do not tell who they are."""


class Tape:
    """Writes what ``listening`` has heard to ``bag``."""

    def __init__(self, bag: BagFolder, listening: Listening, log: Log) -> None:
        self._bag, self._listening, self._log = bag, listening, log
        self._times = Times()
        self._fitting = Fitting()
        self._channels: dict[tuple[str, str], Channel] = {}
        self._numbers: Counter[str] = Counter()
        self._first: dict[str, bytes] = {}
        self._order = Order()
        self._told = 0
        self._looked = 0.0
        self.unfit: Counter[str] = Counter()
        self.troubled = ""

    def take_tick(self, now: int) -> None:
        """A tick of lockstep, at ``now`` [ns] of simulation time: from then on, what has come counts for its readers.

        So it is what a replay must repeat at this tick. The order is the same in every run.
        """
        wall = time.time_ns()
        self._learn()
        for name in sorted(self._listening.heard, key=lambda name: (name != CLOCK.name, name)):
            source = self._listening.heard[name]
            for message, origin in source.batch:
                self._write(source, message, origin, wall, now)

    def take_rest(self, now: int) -> None:
        """What came after the last tick, at ``now`` [ns]: nobody had it yet, so its time lies after that tick.

        Its own stamp tells it; one without a stamp lies right after the clock that was sent before it, at no step.
        """
        wall = time.time_ns()
        self._learn()
        self._times.clock = now
        self._queue(wall)
        for _, (source, message, origin) in self._order.take(wall, end=True):
            bare = stamp_of(message) is None and not isinstance(message, Clock)
            later = max(self._times.of(message, wall, timed=True) + bare, now + 1)
            if source.name in self._listening.heard:
                self._write(source, message, origin, wall, later)

    def take(self, end: bool = False) -> None:
        """What has come, in the order in which it was sent, but for the last SETTLE_S; at the ``end`` that as well."""
        clock = self._listening.clock
        # Inputs are emptied in turn: what a clock told meanwhile belongs before what came after it.
        early = clock.batch
        clock.admit()
        clock.batch = [*early, *clock.batch]
        wall = time.time_ns()
        self._learn()
        self._queue(wall)
        for log_time, (source, message, origin) in self._order.take(wall, end):
            publish_time = self._times.of(message, log_time, self._listening.timed)
            if source.name in self._listening.heard:
                self._write(source, message, origin, log_time, publish_time)

    @property
    def now(self) -> int:
        """Simulated time [ns], as far as the clock has told it; 0 without one."""
        return self._times.clock or 0

    def rest(self) -> None:
        """Write a chunk if it is time to, and tell what was lost."""
        try:
            self._bag.flush_due()
        except OSError as error:
            self._complain(error)
        self._look_at_disk()
        lost = sum(self.lost.values())
        if lost > self._told:
            self._log.warn(f"{lost} messages were lost on their way to the bag: is the machine too slow?", every=5.0)
            self._told = lost

    def close(self) -> None:
        """Write what is left, and the account."""
        self._bag.notes["lost"] = json.dumps(self.lost)
        self._bag.notes["unfit"] = json.dumps(self.unfit)
        self._bag.notes["unwritten"] = str(self._bag.unwritten)
        try:
            self._bag.close()
        except OSError as error:
            self._complain(error)

    @property
    def lost(self) -> dict[str, int]:
        """Messages that were sent and did not arrive, by topic."""
        return {name: source.lost for name, source in sorted(self._listening.heard.items()) if source.lost}

    def _learn(self) -> None:
        """Whatever comes with a description of a robot may tell how its frames are called."""
        for topic in (TF, TF_STATIC):
            if (source := self._listening.heard.get(topic.name)) is not None and source.topic.record is TFMessage:
                self._fitting.learn(message for message, _ in source.batch)

    def _queue(self, wall: int) -> None:
        """Leave it to the order of sending when what is there is written."""
        for source in {**self._listening.heard, CLOCK.name: self._listening.clock}.values():
            for message, origin in source.batch:
                self._order.put((source, message, origin), wall)

    def _write(self, source: Input[Any], message: Any, origin: Origin | None, log_time: int, publish_time: int) -> None:
        name = source.name
        if origin is None:
            self._numbers[name] += 1
        sequence = origin.sequence if origin is not None else self._numbers[name]
        if source.topic.quality is Quality.LATCHED and (node := self._other(name, origin)):
            note = writer(Sender)(Sender(node=node))
            self._add(self._channel_of(name + SENDER, Sender(), source), sequence, log_time, publish_time, note)
        if name in self._listening.raw:
            raw = raw_channel(name, source.topic.record.ROS_TYPE, source.topic.quality)
            self._add(self._channel(name, raw), sequence, log_time, publish_time, message)
            return
        main, beside = split(message)
        if beside is None:
            main, beside = self._fitting.split(name, main)
        try:
            for each, topic in ((beside, name + BESIDE), (main, name)):
                if each is not None:
                    data = writer(type(each))(each)
                    self._add(self._channel_of(topic, each, source), sequence, log_time, publish_time, data)
        except NotWritable as error:
            self.unfit[name] += 1
            self._log.warn(f"{name}: a message has no place in its ROS type and is not recorded: {error}", every=5.0)

    def _other(self, name: str, origin: Origin | None) -> bytes:
        """The node behind a message, unless it was the first on its topic.

        A late joiner has the last message of each node; one that was started anew takes the place of the old one.
        """
        node = origin.publisher[:NODE_BYTES] if origin is not None else _FOREIGN
        return node if self._first.setdefault(name, node) != node else b""

    def _add(self, channel: Channel, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        try:
            self._bag.add(channel, sequence, log_time, publish_time, data)
        except OSError as error:
            self._complain(error)

    def _channel_of(self, topic: str, message: Message, source: Input[Any]) -> Channel:
        key = topic, type(message).ROS_TYPE
        return self._channels.get(key) or self._channel(topic, channel_of(topic, type(message), source.topic.quality))

    def _channel(self, topic: str, made: Channel) -> Channel:
        return self._channels.setdefault((topic, made.type), made)

    def _look_at_disk(self) -> None:
        """Warn while there is time to make room."""
        now = time.monotonic()
        if now - self._looked < LOOK_S:
            return
        self._looked = now
        try:
            free, reserve = room(self._bag.folder)
        except OSError:
            return  # writing tells it
        if free < LOW * reserve:
            self._log.warn(
                f"{free / 1e6:.0f} MB are left on the disk of {self._bag.folder}: nothing more is recorded when "
                f"{reserve / 1e6:.0f} MB are left",
                every=60.0,
            )

    def _complain(self, error: OSError) -> None:
        self.troubled = error.strerror or str(error)
        self._log.error(
            f"the disk does not take the recording ({error.strerror}): {self._bag.unwritten} messages are missing from "
            f"{self._bag.folder} so far; nothing else is affected",
            every=5.0,
        )
