"""How a loop sees the tree of frames: as it stood at the start of the tick."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from messages.geometry import TransformStamped
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import TF, TF_STATIC
from services.runtime.errors import NoTransform
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.runtime.tf.buffer import CACHE_S, LookupResult, TransformBuffer
from services.runtime.transport.wire import NODE_BYTES


class Step(Protocol):
    """What is known of a tick here: the simulation time [s] since the one before, 0 after a reset."""

    @property
    def dt(self) -> float: ...


class TransformListener:
    """The transforms of ``/tf`` and ``/tf_static``, kept for ``cache`` [s of simulation time].

    Without ``moving`` those of ``/tf_static`` alone: the simulation makes ``/tf`` only while somebody reads it. A frame
    that gets two parents or two publishers is told in the log, once. After a reset only the fixed ones are left.
    """

    latched = False

    def __init__(self, node: Node, cache: float = CACHE_S, moving: bool = True) -> None:
        self.buffer = TransformBuffer(cache)
        self._moving = node.subscribe(TF) if moving else None
        self._fixed = node.subscribe(TF_STATIC)
        self._log = node.log
        self._said: set[str] = set()
        self._refused = 0

    def refresh(self) -> None:
        """Follow the inputs' last batches."""
        if self._moving is not None:
            add_moving(self.buffer, self._moving)
        # After what moves: of a frame that is told as both, whoever still moves it says so again, the other one never.
        add_static(self.buffer, self._fixed)
        self._tell()

    def clear(self) -> None:
        """Time has begun anew: forget what moves."""
        self.buffer.clear()
        add_static(self.buffer, self._fixed)

    def lookup(self, target: str, source: str, time: int | None = None) -> TransformStamped:
        """Where the frame ``source`` lies in ``target`` at ``time`` [ns]; at the latest common time when None.

        As tf2's ``lookupTransform``: it takes what is told in ``source`` to ``target``. The stamp of the answer is that
        time; 0 when only fixed frames lie between. Raises NoTransform, whose subclasses tell an unknown frame from two
        unconnected ones, a time outside of what is known, and a loop.
        """
        found = self.buffer.lookup(target, source, time)
        return _message(target, source, found)

    def lookup_full(
        self, target: str, target_time: int | None, source: str, source_time: int | None, fixed: str
    ) -> TransformStamped:
        """Where ``source`` lay at ``source_time`` [ns], told in ``target`` at ``target_time`` [ns].

        As tf2's ``lookupTransform`` with a fixed frame ("time travel"): ``fixed`` is what stands still between the two
        times. ``lookup_full("base", now, "base", now - 10**9, "odom")`` is how the base has moved in the last second.
        Times, stamp and errors are those of ``lookup``; the stamp is the target's time.
        """
        return _message(target, source, self.buffer.lookup_full(target, target_time, source, source_time, fixed))

    def can(self, target: str, source: str, time: int | None = None) -> bool:
        """Whether ``lookup`` would answer."""
        try:
            self.buffer.lookup(target, source, time)
        except NoTransform:
            return False
        return True

    def can_full(self, target: str, target_time: int | None, source: str, source_time: int | None, fixed: str) -> bool:
        """Whether ``lookup_full`` would answer."""
        try:
            self.buffer.lookup_full(target, target_time, source, source_time, fixed)
        except NoTransform:
            return False
        return True

    def wait_for(
        self, ticks: Iterator[Step], target: str, source: str, time: int | None = None, timeout: float = 5.0
    ) -> TransformStamped:
        """``lookup``, as soon as it answers: until then the loop's own ``ticks`` pass, so that nobody waits for it.

        Args:
            ticks: what the loop goes on with, ``ticks = ctx.ticks()``; requests are answered, the heartbeat is sent and
                the steps of lockstep are taken while it waits. A reset meanwhile shows in the epoch of the ticks after.
            target, source, time: as for ``lookup``.
            timeout: how long to wait at most [s of simulation time]; a simulation that is paused takes none of it.

        Raises:
            NoTransform: what ``lookup`` said last, when the time is over.
        """
        waited = 0.0
        while True:
            try:
                return self.lookup(target, source, time)
            except NoTransform as error:
                if waited >= timeout:
                    raise type(error)(f"{error} (waited for {timeout:g} s of simulation time)") from None
            waited += next(ticks).dt

    def frames(self) -> list[str]:
        """The names of all frames."""
        return self.buffer.frames()

    def _tell(self) -> None:
        for frame, text in self.buffer.conflicts().items():
            if frame not in self._said:
                self._said.add(frame)
                self._log.warn(f"{text}: a frame has one publisher, see ./elea tf tree")
        if self.buffer.refused > self._refused:
            self._refused = self.buffer.refused
            self._log.warn(f"{self._refused} transforms refused, the last one because {self.buffer.reason}", every=5.0)


def _message(target: str, source: str, found: LookupResult) -> TransformStamped:
    header = Header(stamp=Time.of(found.time or 0), frame_id=target.removeprefix("/"))
    return TransformStamped(
        header=header, child_frame_id=source.removeprefix("/"), transform=found.transform.to_transform()
    )


def add_moving(buffer: TransformBuffer, source: Subscriber[TFMessage]) -> None:
    """Add the last batch of ``/tf``. A publisher is known by its node: one that was restarted is still the same."""
    for message, origin in source.messages:
        buffer.add(message.transforms, origin.publisher[:NODE_BYTES] if origin is not None else b"")


def add_static(buffer: TransformBuffer, source: Subscriber[TFMessage]) -> None:
    """Add the last batch of ``/tf_static``."""
    for message, origin in source.messages:
        buffer.add_static(message.transforms, origin.publisher[:NODE_BYTES] if origin is not None else b"")
