"""What a bag is played by: the clock on the wall, or the time of a simulation that runs beside."""

from __future__ import annotations

import time
from typing import Any, Protocol

from messages.requests import PAUSE, RESUME
from messages.rosgraph import Clock
from messages.simulation import SimTime
from messages.std import Empty
from messages.topics import CLOCK
from services.bag.timeline import Moment
from services.player.clockwork import Clockwork
from services.runtime.context import Context
from services.runtime.node import Node

SILENCE_S = 2.0
"""Wall time without the clock of others after which it is told that the bag waits for it."""
NAP_S = 0.02
"""Wall time between two looks at what else there is to do."""


class Pace(Protocol):
    """Holds the player until a moment has come."""

    def begin(self) -> None:
        """The bag starts, or starts again."""
        ...

    def reach(self, moment: Moment) -> None:
        """Block until it is time for the messages of this moment."""
        ...

    def finish(self) -> None:
        """The last message was played."""
        ...


class Wall:
    """By the clock on the wall, times ``rate``; 0 is without waiting. It can be paused by request."""

    def __init__(self, node: Node, rate: float, clockwork: Clockwork) -> None:
        self._node, self._rate, self._clockwork = node, rate, clockwork
        self._started, self._origin = 0.0, 0
        self._looked = 0.0
        self._paused = False
        node.serve(PAUSE, lambda asked: self._pause(asked, True))
        node.serve(RESUME, lambda asked: self._pause(asked, False))

    def begin(self) -> None:
        self._started, self._origin = time.monotonic(), -1

    def reach(self, moment: Moment) -> None:
        if self._origin < 0:
            self._origin = moment.position
        for beat in self._clockwork.until(moment):
            self._hold(beat)
            self._clockwork.tell(beat)
        self._hold(moment)

    def finish(self) -> None:
        pass

    def _hold(self, moment: Moment) -> None:
        while True:
            now = time.monotonic()
            if now - self._looked > NAP_S:
                self._looked = now
                self._node.turn()
            if self._paused:
                self._clockwork.tell_pause(moment)
                time.sleep(NAP_S)
                self._started += time.monotonic() - now
                continue
            ahead = (moment.position - self._origin) / 1e9 / self._rate - (now - self._started) if self._rate else 0.0
            if ahead <= 0:
                return
            time.sleep(min(ahead, NAP_S))

    def _pause(self, _: Empty, paused: bool) -> SimTime:
        self._paused = paused
        return self._clockwork.now


class Following:
    """By the time of a simulation that runs beside, times ``rate``; it stands still with it.

    ``elapsed`` [ns] of it has passed since the bag began.
    """

    def __init__(self, ctx: Context[Any], rate: float) -> None:
        self._node, self._rate = ctx.kernel, rate
        self._clock = ctx.kernel.read(CLOCK)
        self._last: Clock | None = None
        self.elapsed, self._origin, self._heard = 0, -1, time.monotonic()

    def begin(self) -> None:
        self._follow()  # time that has passed until now, while subscribers were waited for, is none of the bag's
        self.elapsed, self._origin = 0, -1

    def reach(self, moment: Moment) -> None:
        if self._origin < 0:
            self._origin = moment.position
        while self._rate and self.elapsed * self._rate < moment.position - self._origin:
            self._node.wait(self._clock.inlet)
            self._follow()
            if self._clock.batch:
                self._heard = time.monotonic()
            elif time.monotonic() - self._heard > SILENCE_S:
                self._node.log.warn("waiting for /clock: is the simulation that publishes it paused?", every=10.0)
        self._node.turn()

    def finish(self) -> None:
        pass

    def _follow(self) -> None:
        """Add up the time that has passed since the last look; a reset adds none."""
        self._clock.admit()
        for clock, _ in self._clock.batch:
            if self._last is not None and clock.epoch == self._last.epoch:
                self.elapsed += max(0, clock.clock.ns - self._last.clock.ns)
            self._last = clock
