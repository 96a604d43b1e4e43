"""The frames of the network as a verb sees them: the tree, how often each frame is told of, and by whom."""

from __future__ import annotations

from collections import deque
from typing import Any

from deploy.live.clock import SimClock
from deploy.live.session import Session
from messages.tf import TFMessage
from messages.topics import TF, TF_STATIC, Topic
from services.runtime.frames.buffer import FrameBuffer
from services.runtime.frames.transforms import take_fixed, take_moving
from services.runtime.graph import Entity, snapshot
from services.runtime.inputs import Input
from services.runtime.network.wire import NODE_BYTES, member_id

WINDOW = 256
"""Stamps of a frame of which its rate is taken."""


class FrameWatch:
    """Follows /tf, /tf_static and the clock. Time that begins anew clears what moves."""

    def __init__(self, live: Session) -> None:
        self.buffer, self.clock = FrameBuffer(), SimClock(live.transport)
        self._live = live
        self.moving, self._fixed = self._input(TF), self._input(TF_STATIC)
        self.stamps: dict[str, deque[int]] = {}
        self._epoch = 0

    def follow(self) -> None:
        """Take what has come."""
        before = self.clock.now
        self.clock.follow()
        now = self.clock.now
        if self.clock.epoch != self._epoch or (before is not None and now is not None and now < before):
            self._epoch = self.clock.epoch
            self.buffer.clear()
            self.stamps.clear()
        self._fixed.admit()
        self.moving.admit()
        take_moving(self.buffer, self.moving)
        take_fixed(self.buffer, self._fixed)
        for message, _ in self.moving.batch:
            for each in message.transforms:
                seen = self.stamps.setdefault(each.child_frame_id.removeprefix("/"), deque(maxlen=WINDOW))
                seen.append(each.header.stamp.ns)

    def age(self, stamp: int) -> float | None:
        """How old something is, s of simulation time; None without a clock."""
        return None if self.clock.now is None else max(0.0, (self.clock.now - stamp) / 1e9)

    def rate(self, frame: str) -> float | None:
        """How often a moving frame is told of, Hz of simulation time; None until two stamps are known."""
        stamps = sorted(set(self.stamps.get(frame, ())))
        return (len(stamps) - 1) * 1e9 / (stamps[-1] - stamps[0]) if len(stamps) > 1 else None

    def publishers(self) -> dict[bytes, str]:
        """The nodes that publish frames now, by the id under which the buffer knows them."""
        ends: list[Entity] = snapshot(self._live.transport)
        return {
            member_id(each.node, each.session)[:NODE_BYTES]: each.node
            for each in ends
            if each.kind == "pub" and each.name in (TF.name, TF_STATIC.name)
        }

    def faults(self, names: dict[bytes, str]) -> list[str]:
        """What keeps the frames from being a tree, and what was refused; ``names`` are those of the publishers."""
        told = []
        for frame, text in self.buffer.conflicts().items():
            who = [names.get(each, "a foreign sender" if not each else "?") for each in self.buffer.publishers(frame)]
            told.append(f"{text}: {', '.join(who)} tell of it")
        if self.buffer.refused:
            told.append(f"{self.buffer.refused} transforms refused, the last one: {self.buffer.reason}")
        for source in (self.moving, self._fixed):
            if source.refused:
                told.append(f"{source.name}: {source.refused} messages refused, the last one: {source.reason}")
        return told

    def _input(self, topic: Topic[TFMessage]) -> Input[Any]:
        made = Input(topic, topic.name, topic.name[1:], self._live.transport)
        self._live.reads(topic.name, topic.record.ROS_TYPE, topic.quality.name)
        return made
