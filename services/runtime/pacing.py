"""What a loop's ticks follow: the clock, or the leave that lockstep gives."""

from __future__ import annotations

import time
from itertools import islice
from typing import NamedTuple, Protocol

from messages.base import WrongPayload, decoder
from messages.rosgraph import Clock
from messages.topics import CLOCK
from services.runtime.lockstep.follower import LINK_S, Follower
from services.runtime.lockstep.marks import Marks
from services.runtime.lockstep.protocol import Go, greeting_numbers, numbers
from services.runtime.log import Log
from services.runtime.network.transport import Inlet
from services.runtime.network.wire import detach, encoding
from services.runtime.node import Node

SILENCE_S = 0.5
"""Wall time without a clock after which the loop calls itself waiting."""

_CLOCKS = 16
"""Clocks kept, and taken in one go; only the newest counts."""


class Instant(NamedTuple):
    """A point of simulation time: ns, epoch (one more at each reset), and which run of a simulation it is."""

    time: int
    epoch: int
    simulation: str


class Pacer(Protocol):
    """Gives the loop its next tick."""

    inlet: Inlet
    marks: Marks | None

    def start(self) -> None:
        """All inputs are declared; ticks may begin."""
        ...

    def next(self) -> Instant | None:
        """The next tick, or None when there is nothing to do but wait."""
        ...

    def finish(self) -> None:
        """The tick's work is done."""
        ...

    def leave(self) -> None:
        """There will be no more ticks."""
        ...


class Silence:
    """Notices that no time arrives, and says it once."""

    def __init__(self, node: Node, log: Log) -> None:
        self._heart, self._log, self._patience = node.heart, log, node.clock_patience_s
        self._heard = time.monotonic()
        self._ever = self._said = False

    def heard(self, paused: bool) -> None:
        """Time has arrived."""
        self._heard, self._ever = time.monotonic(), True
        self._heart.state = "paused" if paused else "running"
        self._heart.note = ""

    def check(self) -> None:
        """Nothing has arrived since the last look."""
        if self._heart.state == "paused":
            return
        silence = time.monotonic() - self._heard
        if silence > SILENCE_S:
            self._heart.state, self._heart.note = "waiting", "no clock"
        if silence > self._patience and not self._ever and not self._said:
            self._said = True
            self._log.warn(f"no clock for {silence:.1f} s: is the simulation running?")


class ClockPacer:
    """Ticks when ``/clock`` reaches a multiple of the period; what was missed is not made up for."""

    marks: Marks | None = None

    def __init__(self, node: Node, period_ns: int) -> None:
        transport = node.transport
        self._key, self._encoding = node.identity.key(CLOCK.name), encoding(Clock.ROS_TYPE)
        self.inlet = transport.subscribe(self._key, _CLOCKS)
        self._read = decoder(Clock)
        self._period_ns = period_ns
        self._node = node
        self._silence = Silence(node, node.log)
        self._next = self._jumps = 0
        self._epoch, self._simulation = -1, b""

    def start(self) -> None:
        self._node.show_step(self._period_ns)

    def next(self) -> Instant | None:
        clock, simulation = None, b""
        for payload, attachment, source in islice(iter(self.inlet.take, None), _CLOCKS):
            if self.inlet.key(source) != self._key or self.inlet.encoding(source) not in ("", self._encoding):
                continue
            try:
                clock = self._read(payload)
            except WrongPayload:
                continue
            origin = detach(attachment)
            simulation = origin.publisher if origin is not None else b""
        if clock is None:
            self._silence.check()
            return None
        self._silence.heard(clock.paused)
        now = clock.clock.ns
        restarted = clock.epoch != self._epoch or simulation != self._simulation
        if restarted or now < self._next - self._period_ns:
            self._epoch, self._simulation = clock.epoch, simulation
            self._next, self._jumps = now, self._jumps + 1
        if now < self._next:
            return None
        self._next = now - now % self._period_ns + self._period_ns
        return Instant(now, clock.epoch, str(self._jumps))

    def finish(self) -> None:
        pass

    def leave(self) -> None:
        pass


class LockstepPacer:
    """Ticks when the simulation lets it."""

    def __init__(self, node: Node, period_ns: int) -> None:
        self._node = node
        self._follower = Follower(node.transport, node.identity.node, period_ns)
        self.inlet = self._follower.inlet
        self.marks: Marks | None = self._follower.marks
        self._silence = Silence(node, node.log)
        self._greeting: Go | None = None
        self._deadline = 0.0
        self._step: Go | None = None

    def start(self) -> None:
        self._follower.join()

    def next(self) -> Instant | None:
        go = self._follower.take()
        if go is None:
            self._link()
            self._silence.check()
            return None
        self._silence.heard(go.paused)
        if go.roster:
            if self._greeting is None:
                self._deadline = time.monotonic() + LINK_S
            self._greeting = go
            self._link()
            return None
        if go.paused:
            return None
        self._step = go
        # The simulation waits for commands and Done; all else that the step tells leaves behind them, in one go.
        self._node.outbox.hold()
        return Instant(go.time, go.epoch, go.simulation)

    def finish(self) -> None:
        assert self._step is not None
        self._follower.finish(self._step.tick, numbers(self._node.outputs), {})
        self._node.outbox.release()

    def leave(self) -> None:
        self._node.outbox.release()
        self._follower.leave()

    def _link(self) -> None:
        """Answer the greeting once all fellows are in sight, or after LINK_S without some."""
        if self._greeting is None:
            return
        if not self._follower.linked(self._greeting.roster):
            if time.monotonic() < self._deadline:
                return
            self._node.log.warn(f"not all of {', '.join(self._greeting.roster)} in sight after {LINK_S} s")
        tick, self._greeting = self._greeting.tick, None
        self._follower.greet(tick, *greeting_numbers(self._node.outputs))
