"""Time as a script sees it: simulation time, interpolated between samples of ``/clock``; or wall time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from itertools import islice

from messages.base import WrongPayload, decoder
from messages.rosgraph import Clock
from messages.topics import CLOCK
from services.runtime.node import Node
from services.runtime.pacing import ClockSource
from services.runtime.transport.api import RawSubscriber
from services.runtime.transport.wire import encoding, unpack_attachment

_CLOCKS = 16
"""Maximum number of samples that are buffered and read at once."""
_KEPT = 25
"""Number of samples from which the speed of simulation time is measured: half a second in real time."""
_FASTEST = 1000.0


class ScriptClock:
    """The time of a script. Simulation time is set from outside by ``set``; wall time needs no updates.

    Between two samples, ``now`` advances with the wall clock times the speed of simulation time, but never by more than
    the time between two samples, and never backwards.
    """

    def __init__(self, simulated: bool, interpolated: bool = True) -> None:
        self.simulated, self.started = simulated, not simulated
        self.epoch = 0
        """Number of resets of time."""
        self.paused = False
        self.factor = 1.0
        """Simulated seconds per second of wall time, as stated by the simulation."""
        self._epoch_sent = 0
        self.on_change: Callable[[], None] = _nothing
        self._interpolated = interpolated
        self._last = self._shown = 0
        self._last_wall = 0.0
        self._speed, self._period = 1.0, 0
        self._samples: deque[tuple[float, int]] = deque(maxlen=_KEPT)

    def now(self) -> int:
        """Return the time [ns]."""
        if not self.simulated:
            return time.time_ns()
        if self._interpolated and not self.paused:
            passed = round((time.monotonic() - self._last_wall) * self._speed * 1e9)
            self._shown = max(self._shown, self._last + min(passed, self._period))
        return self._shown

    def wall_until(self, time_ns: int, now: int) -> float:
        """Return the wall time [s] until a later time, if nothing is paused."""
        return max((time_ns - now) / (1e9 * self._speed), 0.0002)

    def set(self, time_ns: int, epoch: int = 0, paused: bool = False) -> None:
        """Set the time received from the simulation; a new epoch, or an earlier time, is a reset."""
        wall = time.monotonic()
        if epoch != self._epoch_sent or time_ns < self._last or not self.started:
            self.epoch += self.started
            self._epoch_sent = epoch
            self._samples.clear()
            self._period, self._shown = 0, time_ns
        elif paused or self.paused:
            self._samples.clear()
        elif time_ns > self._last:
            self._measure(wall, time_ns)
        self._shown = max(self._shown, time_ns)
        self._last, self._last_wall = time_ns, wall
        self.paused, self.started = paused, True
        self.on_change()

    def _measure(self, wall: float, time_ns: int) -> None:
        self._period = time_ns - self._last
        self._samples.append((wall, time_ns))
        first_wall, first_time = self._samples[0]
        if wall - first_wall > 0.05:
            self._speed = min((time_ns - first_time) / (wall - first_wall) / 1e9, _FASTEST)


class ClockReader:
    """Reads ``/clock`` for a node in real time."""

    def __init__(self, node: Node, clock: ScriptClock) -> None:
        self._key, self._encoding = node.identity.key(CLOCK.name), encoding(Clock.ROS_TYPE)
        self.raw: RawSubscriber = node.transport.subscribe(self._key, _CLOCKS)
        self._source = ClockSource(node)
        self._decode = decoder(Clock)
        self._clock = clock
        node.refusal_counters.append(self._source.counts)

    def update(self) -> bool:
        """Read new samples; return whether there was one."""
        newest = None
        for payload, attachment, source in islice(iter(self.raw.recv, None), _CLOCKS):
            if self.raw.key(source) != self._key or self.raw.encoding(source) not in ("", self._encoding):
                continue
            try:
                read = self._decode(payload)
            except WrongPayload:
                continue
            origin = unpack_attachment(attachment)
            if self._source.follows(origin.publisher if origin is not None else b""):
                newest = read
        if newest is None:
            return False
        self._clock.set(newest.clock.ns, newest.epoch, newest.paused)
        return True


def _nothing() -> None:
    pass
