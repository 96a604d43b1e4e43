"""The clocks that pace playback: wall clock, a running simulation, or lockstep; and the publisher of /clock."""

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
"""Rate of a generated clock [Hz], as in the simulation."""


class ClockPublisher:
    """Publishes /clock at ``rate`` [Hz], or as recorded if that is 0; does nothing unless ``enabled``."""

    def __init__(self, node: Node, enabled: bool, rate: float) -> None:
        self._out: Publisher[Clock] | None = node.advertise(CLOCK) if enabled else None
        self._period = round(1e9 / rate) if rate and enabled else 0
        self._next: int | None = None
        self._segment = -1
        self._base = 0
        self.now = SimTime()

    def restart(self) -> None:
        """Prepare to play the bag again, in a new epoch."""
        self._base += self._segment + 1
        self._segment, self._next = -1, None

    def epoch_of(self, segment: int) -> int:
        """Return the epoch published for a segment of the bag."""
        return self._base + segment

    def ticks_until(self, bag_time: BagTime) -> Iterator[BagTime]:
        """Yield the generated ticks up to and including a bag time."""
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
        """Publish a generated tick."""
        self._publish(Clock(clock=Time.of(bag_time.time), tick=bag_time.time // STEP_NS), bag_time.segment)

    def publish_pause(self, bag_time: BagTime) -> None:
        """Publish that time is paused."""
        paused = Clock(clock=Time.of(self.now.time), tick=self.now.tick, paused=True)
        self._publish(paused, bag_time.segment)

    def publish_recorded(self, clock: Clock, bag_time: BagTime) -> None:
        """Publish a recorded clock message, unless ticks are generated."""
        if not self._period:
            self._publish(clock, bag_time.segment)

    def _publish(self, clock: Clock, segment: int) -> None:
        epoch = self.epoch_of(segment)
        self.now = SimTime(time=clock.clock.ns, tick=clock.tick, epoch=epoch)
        if self._out is not None:
            self._out.publish(Clock(clock=clock.clock, tick=clock.tick, epoch=epoch, paused=clock.paused))


CLOCK_TIMEOUT_S = 2.0
"""Wall time [s] without a message of the simulation's clock after which a warning is logged."""
POLL_PERIOD_S = 0.02
"""Wall time [s] between two polls of requests and subscribers."""


class PlaybackClock(Protocol):
    """Blocks the player until a bag time is due."""

    def start(self) -> None:
        """Start the bag, or start it again."""
        ...

    def wait_until(self, bag_time: BagTime) -> None:
        """Block until the messages at this bag time are due."""
        ...

    def finish(self) -> None:
        """Finish after the last message."""
        ...


class WallClock:
    """Plays at ``rate`` times wall time, as fast as possible if that is 0; can be paused by request."""

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
    """Plays at ``rate`` times the time of a running simulation, and waits while that is paused.

    ``elapsed`` [ns] is the simulation time since the start of playback.
    """

    def __init__(self, ctx: Context[Any], rate: float) -> None:
        self._node, self._rate = ctx.node, rate
        self._clock = ctx.node.subscribe(CLOCK)
        self._last: Clock | None = None
        self.elapsed, self._origin, self._last_received = 0, -1, time.monotonic()

    def start(self) -> None:
        self._update()  # discards the time of the wait for subscribers
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
        """Add the time that has passed since the last update; a reset adds none."""
        self._clock.update()
        for clock, _ in self._clock.messages:
            if self._last is not None and clock.epoch == self._last.epoch:
                self.elapsed += max(0, clock.clock.ns - self._last.clock.ns)
            self._last = clock


class LockstepClock:
    """Plays in lockstep: waits for the members at each of their ticks, as a simulation does.

    Their messages are admitted at their next tick with ``latency`` 1, at once with 0; use that of the recorded run.
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
        """The members that were lost during playback."""
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
            self._barrier.collect_reports(0)  # as at a reset: the old timeline ends before the new one begins
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
        self._barrier.collect_reports(0)  # collects all that is outstanding, since every member is due at 0

    def _advance(self, time_ns: int) -> None:
        """Take all steps before ``time_ns``; messages at that time belong to the step that follows."""
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
        """Wait until wall time, scaled by the rate, reaches a bag time; at rate 0, do nothing."""
        if self._origin < 0:
            self._origin = bag_time.position
        if self._rate:
            ahead = (bag_time.position - self._origin) / 1e9 / self._rate - (time.monotonic() - self._started)
            time.sleep(max(0.0, ahead))

    def _step_grant(self, time_ns: int) -> StepGrant:
        session = self._node.transport.session
        return StepGrant(simulation=session, tick=time_ns // STEP_NS, time=time_ns, epoch=self._epoch)
