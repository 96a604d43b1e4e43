"""The clocks a bag is played by: wall clock, a running simulation, or lockstep; and the /clock that is published."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Protocol

from messages.requests import PAUSE, RESUME
from messages.rosgraph import Clock
from messages.simulation import SimTime
from messages.std import Empty, Time
from messages.topics import CLOCK
from services.bag.reader import BagTime
from services.runtime.context import Context
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.step import STEP_NS

CLOCK_RATE = 50.0
"""Hz of the clock that is made anew, as that of the simulation."""


class ClockPublisher:
    """Publishes /clock, at ``rate`` [Hz] if it is not 0, else as recorded; nothing unless the player ``tells`` time."""

    def __init__(self, node: Node, tells: bool, rate: float) -> None:
        self._out: Publisher[Clock] | None = node.advertise(CLOCK) if tells else None
        self._period = round(1e9 / rate) if rate and tells else 0
        self._next: int | None = None
        self._segment = -1
        self._base = 0
        self.now = SimTime()

    def restart(self) -> None:
        """The bag begins anew, in a new epoch."""
        self._base += self._segment + 1
        self._segment, self._next = -1, None

    def epoch_of(self, segment: int) -> int:
        """The epoch that a segment has for those who listen."""
        return self._base + segment

    def ticks_until(self, bag_time: BagTime) -> Iterator[BagTime]:
        """The beats that come before a moment, or with it."""
        if bag_time.segment != self._segment:
            self._segment, self._next = bag_time.segment, None
        if not self._period:
            return
        if self._next is None:
            self._next = bag_time.time - bag_time.time % self._period
        while self._next <= bag_time.time:
            yield BagTime(bag_time.position - max(0, bag_time.time - self._next), bag_time.segment, max(0, self._next))
            self._next += self._period

    def publish(self, bag_time: BagTime) -> None:
        """Publish a beat."""
        self._publish(Clock(clock=Time.of(bag_time.time), tick=bag_time.time // STEP_NS), bag_time.segment)

    def publish_pause(self, bag_time: BagTime) -> None:
        """Publish that time stands still."""
        stands = Clock(clock=Time.of(self.now.time), tick=self.now.tick, paused=True)
        self._publish(stands, bag_time.segment)

    def publish_recorded(self, clock: Clock, bag_time: BagTime) -> None:
        """Publish a recorded message of the clock, unless beats are made."""
        if not self._period:
            self._publish(clock, bag_time.segment)

    def _publish(self, clock: Clock, segment: int) -> None:
        epoch = self.epoch_of(segment)
        self.now = SimTime(time=clock.clock.ns, tick=clock.tick, epoch=epoch)
        if self._out is not None:
            told = Clock(clock=clock.clock, tick=clock.tick, epoch=epoch, paused=clock.paused)
            self._out.publish(told)


CLOCK_TIMEOUT_S = 2.0
"""Wall time without the clock of others after which it is told that the bag waits for it."""
POLL_PERIOD_S = 0.02
"""Wall time between two looks at what else there is to do."""


class PlaybackClock(Protocol):
    """Holds the player until a moment has come."""

    def start(self) -> None:
        """The bag starts, or starts again."""
        ...

    def wait_until(self, bag_time: BagTime) -> None:
        """Block until it is time for the messages of this moment."""
        ...

    def finish(self) -> None:
        """The last message was played."""
        ...


class WallClock:
    """By the clock on the wall, times ``rate``; 0 is without waiting. It can be paused by request."""

    def __init__(self, node: Node, rate: float, clock_publisher: ClockPublisher) -> None:
        self._node, self._rate, self._clock_publisher = node, rate, clock_publisher
        self._started, self._origin = 0.0, 0
        self._polled = 0.0
        self._paused = False
        node.serve(PAUSE, lambda asked: self._set_paused(asked, True))
        node.serve(RESUME, lambda asked: self._set_paused(asked, False))

    def start(self) -> None:
        self._started, self._origin = time.monotonic(), -1

    def wait_until(self, bag_time: BagTime) -> None:
        if self._origin < 0:
            self._origin = bag_time.position
        for tick in self._clock_publisher.ticks_until(bag_time):
            self._wait_until(tick)
            self._clock_publisher.publish(tick)
        self._wait_until(bag_time)

    def finish(self) -> None:
        pass

    def _wait_until(self, bag_time: BagTime) -> None:
        while True:
            now = time.monotonic()
            if now - self._polled > POLL_PERIOD_S:
                self._polled = now
                self._node.spin_once()
            if self._paused:
                self._clock_publisher.publish_pause(bag_time)
                time.sleep(POLL_PERIOD_S)
                self._started += time.monotonic() - now
                continue
            ahead = (bag_time.position - self._origin) / 1e9 / self._rate - (now - self._started) if self._rate else 0.0
            if ahead <= 0:
                return
            time.sleep(min(ahead, POLL_PERIOD_S))

    def _set_paused(self, _: Empty, paused: bool) -> SimTime:
        self._paused = paused
        return self._clock_publisher.now


class SimClock:
    """By the time of a simulation that runs beside, times ``rate``; it stands still with it.

    ``elapsed`` [ns] of it has passed since the bag began.
    """

    def __init__(self, ctx: Context[Any], rate: float) -> None:
        self._node, self._rate = ctx.node, rate
        self._clock = ctx.node.subscribe(CLOCK)
        self._last: Clock | None = None
        self.elapsed, self._origin, self._last_received = 0, -1, time.monotonic()

    def start(self) -> None:
        self._update()  # time that has passed until now, while subscribers were waited for, is none of the bag's
        self.elapsed, self._origin = 0, -1

    def wait_until(self, bag_time: BagTime) -> None:
        if self._origin < 0:
            self._origin = bag_time.position
        while self._rate and self.elapsed * self._rate < bag_time.position - self._origin:
            self._node.wait(self._clock.raw)
            self._update()
            if self._clock.messages:
                self._last_received = time.monotonic()
            elif time.monotonic() - self._last_received > CLOCK_TIMEOUT_S:
                self._node.log.warn("waiting for /clock: is the simulation that publishes it paused?", every=10.0)
        self._node.spin_once()

    def finish(self) -> None:
        pass

    def _update(self) -> None:
        """Add up the time that has passed since the last look; a reset adds none."""
        self._clock.update()
        for clock, _ in self._clock.messages:
            if self._last is not None and clock.epoch == self._last.epoch:
                self.elapsed += max(0, clock.clock.ns - self._last.clock.ns)
            self._last = clock


class LockstepClock:
    """In lockstep: the members are waited for at each of their ticks, as a simulation does it.

    With ``latency`` 1 what they send counts when they are due again, with 0 at once: so it was when the bag was made.
    """

    def __init__(
        self, node: Node, members: tuple[str, ...], rate: float, clock_publisher: ClockPublisher, latency: int = 0
    ) -> None:
        self._node, self._clock_publisher, self._rate, self._latency = node, clock_publisher, rate, latency
        self._barrier = Barrier(
            node.transport, node.send_buffer, members, node.log, node.wait, lambda: self._step_grant(0)
        )
        node.refusal_counters.append(self._barrier.refusals)
        self._next: int | None = None
        self._epoch = 0
        self._released = False
        self._started, self._origin = 0.0, -1

    @property
    def lost(self) -> tuple[str, ...]:
        """The members that the bag was played on without."""
        return self._barrier.state.lost

    def start(self) -> None:
        self._node.heartbeat.state, self._node.heartbeat.detail = "waiting", "for the members of lockstep"
        self._barrier.wait_for_members()
        self._node.heartbeat.state, self._node.heartbeat.detail = "running", ""
        self._started, self._origin = time.monotonic(), -1

    def wait_until(self, bag_time: BagTime) -> None:
        epoch = self._clock_publisher.epoch_of(bag_time.segment)
        if self._next is not None and epoch != self._epoch:
            self._step()
            self._barrier.collect_reports(0)  # as at a reset: all of the time before is told before time begins anew
            self._next = None
        if self._next is None:
            self._next, self._epoch = -(-bag_time.time // STEP_NS) * STEP_NS, epoch
        for tick in self._clock_publisher.ticks_until(bag_time):
            self._advance(tick.time)
            self._clock_publisher.publish(tick)
        self._advance(bag_time.time)
        self._throttle(bag_time)

    def finish(self) -> None:
        if self._next is not None:
            self._step()
        self._barrier.collect_reports(0)  # whatever is still under way, since every member is due at 0

    def _advance(self, time_ns: int) -> None:
        """Step as often as lies before ``time_ns``: its own messages are part of the step that follows."""
        while self._next is not None and self._next < time_ns:
            self._step()
            self._next += STEP_NS

    def _step(self) -> None:
        assert self._next is not None
        self._node.spin_once()
        self._barrier.update()
        if not self._barrier.due(self._next):
            return
        if self._released:
            self._barrier.collect_reports(self._next)
        self._barrier.grant(self._step_grant(self._next), self._node.publishers)
        self._node.send_buffer.flush()
        self._released = bool(self._latency)
        if not self._latency:
            self._barrier.collect_reports(self._next)

    def _throttle(self, bag_time: BagTime) -> None:
        """Keep to the clock on the wall, if that is asked for."""
        if self._origin < 0:
            self._origin = bag_time.position
        if self._rate:
            ahead = (bag_time.position - self._origin) / 1e9 / self._rate - (time.monotonic() - self._started)
            time.sleep(max(0.0, ahead))

    def _step_grant(self, time_ns: int) -> StepGrant:
        session = self._node.transport.session
        return StepGrant(simulation=session, tick=time_ns // STEP_NS, time=time_ns, epoch=self._epoch)
