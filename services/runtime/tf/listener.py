"""The transform listener of a loop, updated at the start of each tick."""

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
    """The part of a tick used here: simulation time [s] since the previous one, 0 after a reset."""

    @property
    def dt(self) -> float: ...


class TransformListener:
    """The transforms of ``/tf`` and ``/tf_static``, kept for ``cache`` [s of simulation time].

    Without ``moving``, only those of ``/tf_static``: the simulation publishes ``/tf`` only while it has subscribers. A
    frame with several parents or publishers is logged once. After a reset only the static transforms are left.
    """

    latched = False

    def __init__(self, node: Node, cache: float = CACHE_S, moving: bool = True) -> None:
        self.buffer = TransformBuffer(cache)
        self._node = node
        self._moving = node.subscribe(TF) if moving else None
        self._fixed = node.subscribe(TF_STATIC)
        self._log = node.log
        self._logged: set[str] = set()
        self._refused = 0

    def read_moving(self) -> None:
        """Read ``/tf`` as well from now on."""
        if self._moving is None:
            self._moving = self._node.subscribe(TF)

    def refresh(self) -> None:
        """Update from the subscribers' last batches."""
        if self._moving is not None:
            add_moving(self.buffer, self._moving)
        # After the moving ones: a publisher that still moves a frame repeats it, one that made it static does not.
        add_static(self.buffer, self._fixed)
        self._log_conflicts()

    def clear(self) -> None:
        """Drop the moving transforms after a reset."""
        self.buffer.clear()
        add_static(self.buffer, self._fixed)

    def lookup(self, target: str, source: str, time: int | None = None) -> TransformStamped:
        """Return the transform that maps points from ``source`` to ``target``, like tf2's ``lookupTransform``.

        Args:
            target: The frame to map to.
            source: The frame to map from.
            time: Simulation time [ns]; None for the latest common time.

        Returns:
            The transform with its time as stamp, 0 if all frames between are static.

        Raises:
            NoTransform: UnknownFrame, NotConnected, Extrapolation or FrameLoop.
        """
        found = self.buffer.lookup(target, source, time)
        return _message(target, source, found)

    def lookup_full(
        self, target: str, target_time: int | None, source: str, source_time: int | None, fixed: str
    ) -> TransformStamped:
        """Return the transform from ``source`` at ``source_time`` [ns] to ``target`` at ``target_time`` [ns].

        Like tf2's ``lookupTransform`` with a fixed frame ("time travel"): ``fixed`` does not move between the times.
        ``lookup_full("base", now, "base", now - 10**9, "odom")`` is the motion of the base in the last second. Times
        and errors are those of ``lookup``; the stamp is the target's time.
        """
        return _message(target, source, self.buffer.lookup_full(target, target_time, source, source_time, fixed))

    def can(self, target: str, source: str, time: int | None = None) -> bool:
        """Return whether ``lookup`` would succeed."""
        try:
            self.buffer.lookup(target, source, time)
        except NoTransform:
            return False
        return True

    def can_full(self, target: str, target_time: int | None, source: str, source_time: int | None, fixed: str) -> bool:
        """Return whether ``lookup_full`` would succeed."""
        try:
            self.buffer.lookup_full(target, target_time, source, source_time, fixed)
        except NoTransform:
            return False
        return True

    def wait_for(
        self, ticks: Iterator[Step], target: str, source: str, time: int | None = None, timeout: float = 5.0
    ) -> TransformStamped:
        """Wait until ``lookup`` succeeds, consuming the loop's own ``ticks``, so that the node keeps working.

        Args:
            ticks: the loop's ticks, ``ticks = ctx.ticks()``; meanwhile requests are answered, heartbeats sent and
                lockstep steps finished. A reset meanwhile shows in the epoch of later ticks.
            target, source, time: as for ``lookup``.
            timeout: maximum wait [s of simulation time], which does not pass while the simulation is paused.

        Raises:
            NoTransform: the last error of ``lookup``, at the timeout.
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
        """Return the names of all frames."""
        return self.buffer.frames()

    def _log_conflicts(self) -> None:
        for frame, text in self.buffer.conflicts().items():
            if frame not in self._logged:
                self._logged.add(frame)
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
    """Add the last batch of ``/tf``. Publishers are identified by their node, so a restarted one stays the same."""
    for message, origin in source.messages:
        buffer.add(message.transforms, origin.publisher[:NODE_BYTES] if origin is not None else b"")


def add_static(buffer: TransformBuffer, source: Subscriber[TFMessage]) -> None:
    """Add the last batch of ``/tf_static``."""
    for message, origin in source.messages:
        buffer.add_static(message.transforms, origin.publisher[:NODE_BYTES] if origin is not None else b"")
