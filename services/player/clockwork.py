"""The player's own ``/clock``: the recorded one, or one made anew between the messages."""

from __future__ import annotations

from collections.abc import Iterator

from messages.rosgraph import Clock
from messages.simulation import SimTime
from messages.std import Time
from messages.topics import CLOCK
from services.bag.timeline import Moment
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.service import STEP_NS

RATE = 50.0
"""Hz of the clock that is made anew, as that of the simulation."""


class Clockwork:
    """Tells time, if the player does so at all. With a ``rate`` [Hz] it makes beats; else ``play`` passes them on."""

    def __init__(self, node: Node, tells: bool, rate: float) -> None:
        self._out: Output[Clock] | None = node.write(CLOCK) if tells else None
        self._period = round(1e9 / rate) if rate and tells else 0
        self._next: int | None = None
        self._segment = -1
        self._base = 0
        self.now = SimTime()

    def again(self) -> None:
        """The bag begins anew, in a new epoch."""
        self._base += self._segment + 1
        self._segment, self._next = -1, None

    def epoch_of(self, segment: int) -> int:
        """The epoch that a segment has for those who listen."""
        return self._base + segment

    def until(self, moment: Moment) -> Iterator[Moment]:
        """The beats that come before a moment, or with it."""
        if moment.segment != self._segment:
            self._segment, self._next = moment.segment, None
        if not self._period:
            return
        if self._next is None:
            self._next = moment.time - moment.time % self._period
        while self._next <= moment.time:
            yield Moment(moment.position - max(0, moment.time - self._next), moment.segment, max(0, self._next))
            self._next += self._period

    def tell(self, moment: Moment) -> None:
        """Publish a beat."""
        self._publish(Clock(clock=Time.of(moment.time), tick=moment.time // STEP_NS), moment.segment)

    def tell_pause(self, moment: Moment) -> None:
        """Publish that time stands still."""
        stands = Clock(clock=Time.of(self.now.time), tick=self.now.tick, paused=True)
        self._publish(stands, moment.segment)

    def play(self, clock: Clock, moment: Moment) -> None:
        """Publish a recorded message of the clock, unless beats are made."""
        if not self._period:
            self._publish(clock, moment.segment)

    def _publish(self, clock: Clock, segment: int) -> None:
        epoch = self.epoch_of(segment)
        self.now = SimTime(time=clock.clock.ns, tick=clock.tick, epoch=epoch)
        if self._out is not None:
            told = Clock(clock=clock.clock, tick=clock.tick, epoch=epoch, paused=clock.paused)
            self._out.publish(told)
