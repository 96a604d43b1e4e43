"""A bag in lockstep: it is the simulation, and its members are waited for at each of their ticks."""

from __future__ import annotations

import time

from services.bag.timeline import Moment
from services.player.clockwork import Clockwork
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import Go
from services.runtime.node import Node
from services.runtime.service import STEP_NS


class Steps:
    """In lockstep: the members are waited for at each of their ticks, as a simulation does it.

    With ``latency`` 1 what they send counts when they are due again, with 0 at once: so it was when the bag was made.
    """

    def __init__(
        self, node: Node, members: tuple[str, ...], rate: float, clockwork: Clockwork, latency: int = 0
    ) -> None:
        self._node, self._clockwork, self._rate, self._latency = node, clockwork, rate, latency
        self._barrier = Barrier(node.transport, node.outbox, members, node.log, node.wait, lambda: self._go(0))
        node.counts.append(self._barrier.counts)
        self._next: int | None = None
        self._epoch = 0
        self._released = False
        self._begun, self._origin = 0.0, -1

    @property
    def lost(self) -> tuple[str, ...]:
        """The members that the bag was played on without."""
        return self._barrier.state.lost

    def begin(self) -> None:
        self._node.heart.state, self._node.heart.note = "waiting", "for the members of lockstep"
        self._barrier.gather()
        self._node.heart.state, self._node.heart.note = "running", ""
        self._begun, self._origin = time.monotonic(), -1

    def reach(self, moment: Moment) -> None:
        epoch = self._clockwork.epoch_of(moment.segment)
        if self._next is not None and epoch != self._epoch:
            self._step()
            self._barrier.collect(0)  # as at a reset: all of the time before is told before time begins anew
            self._next = None
        if self._next is None:
            self._next, self._epoch = -(-moment.time // STEP_NS) * STEP_NS, epoch
        for beat in self._clockwork.until(moment):
            self._advance(beat.time)
            self._clockwork.tell(beat)
        self._advance(moment.time)
        self._pace(moment)

    def finish(self) -> None:
        if self._next is not None:
            self._step()
        self._barrier.collect(0)  # whatever is still under way, since every member is due at 0

    def _advance(self, time_ns: int) -> None:
        """Step as often as lies before ``time_ns``: its own messages are part of the step that follows."""
        while self._next is not None and self._next < time_ns:
            self._step()
            self._next += STEP_NS

    def _step(self) -> None:
        assert self._next is not None
        self._node.turn()
        self._barrier.update()
        if not self._barrier.due(self._next):
            return
        if self._released:
            self._barrier.collect(self._next)
        self._barrier.release(self._go(self._next), self._node.outputs)
        self._node.outbox.release()
        self._released = bool(self._latency)
        if not self._latency:
            self._barrier.collect(self._next)

    def _pace(self, moment: Moment) -> None:
        """Keep to the clock on the wall, if that is asked for."""
        if self._origin < 0:
            self._origin = moment.position
        if self._rate:
            ahead = (moment.position - self._origin) / 1e9 / self._rate - (time.monotonic() - self._begun)
            time.sleep(max(0.0, ahead))

    def _go(self, time_ns: int) -> Go:
        session = self._node.transport.session
        return Go(simulation=session, tick=time_ns // STEP_NS, time=time_ns, epoch=self._epoch)
