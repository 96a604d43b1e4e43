"""The two ways in which time runs: with the wall clock, or in lockstep with the members."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Protocol

from messages.topics import LOCKSTEP
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.marks import Marks
from services.runtime.lockstep.protocol import Go
from services.runtime.node import Node
from services.sim.stage import CONTROL, Stage

SLACK_S = 0.1
"""Wall time by which real time may lag before it gives up catching up."""


class Timing(Protocol):
    """Holds the simulation at a tick until it may go on."""

    marks: Marks | None
    factor: float

    def begin(self, absent: Collection[str] = ()) -> None:
        """Block until time may start; nobody waits for the nodes that are ``absent``."""
        ...

    def hold(self) -> bool:
        """Send what the stage has told, wait as long as this tick asks for; True when commands are to be taken now."""
        ...

    def halt(self) -> None:
        """Time was paused, stepped or set anew."""
        ...

    def pace(self, factor: float) -> None:
        """Let time run at another factor, where there is one."""
        ...


class Real:
    """With the wall clock times a factor; what the machine cannot keep up with is lost, not made up for.

    ``lagged`` is called with the wall time [s] lost, each time that happens.
    """

    marks: Marks | None = None

    def __init__(self, stage: Stage, node: Node, factor: float, lagged: Callable[[float], None] | None = None) -> None:
        self._stage, self._node, self.factor, self._lagged = stage, node, factor, lagged
        self.halt()

    def begin(self, absent: Collection[str] = ()) -> None:
        self.halt()

    def hold(self) -> bool:
        self._node.outbox.release()
        if self._stage.tick % self._stage.pace:
            return False
        self._node.turn()
        ahead = self._start + (self._stage.now - self._from) / 1e9 / self.factor - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)
        elif ahead < -SLACK_S:
            self._node.log.warn(f"simulation lags by {-ahead:.1f} s: the machine is too slow or busy", every=10.0)
            if self._lagged is not None:
                self._lagged(-ahead)
            self.halt()
        return True

    def halt(self) -> None:
        self._start, self._from = time.monotonic(), self._stage.now

    def pace(self, factor: float) -> None:
        if factor != self.factor:
            self.factor = factor
            self.halt()


class Lockstep:
    """Waits at each tick for the members that are due; with ``latency`` 1 they compute
    while the physics steps, until they are due again."""

    factor = 1.0

    def __init__(self, stage: Stage, node: Node, members: tuple[str, ...], latency: int) -> None:
        self._stage, self._node, self._latency = stage, node, latency
        self._barrier = Barrier(node.transport, node.outbox, members, node.log, node.wait, self._greeting)
        node.counts.append(self._barrier.counts)
        self.marks: Marks | None = self._barrier.marks
        self._state, self._told = node.write(LOCKSTEP), -1
        self._released = False
        self._last = -1, -1

    def begin(self, absent: Collection[str] = ()) -> None:
        self._node.heart.state = "waiting"
        self._node.heart.note = "time has not begun: waiting for the members of lockstep"
        self._barrier.gather(absent)
        self._node.heart.note = ""

    def hold(self) -> bool:
        try:
            return self._hold()
        finally:
            self._node.outbox.release()

    def _hold(self) -> bool:
        # While it waits, a request may take single steps, each with a wait of its own; no tick is released twice.
        here = self._here
        due = self._barrier.due(self._stage.now)
        control = self._stage.tick % CONTROL == 0
        if control:
            self._node.turn()
            self._barrier.update()
        if not due:
            return control
        if self._released:
            self._barrier.collect(self._stage.now)
        if self._here != here:
            return control
        if self._last != here:
            self._last = here
            if self._barrier.version != self._told:
                self._told = self._barrier.version
                self._state.publish(self._barrier.state)
            # Also while single steps are taken in a pause.
            self._barrier.release(self._go(paused=False), self._node.outputs)
            self._released = bool(self._latency)
        if not self._latency:
            self._barrier.collect(self._stage.now)
        # A pause may have been told before this tick's leave, which a member takes for time that goes on.
        self.halt()
        return True

    def halt(self) -> None:
        # Of all else the next step tells; whatever is not paused, a member takes as one.
        if self._stage.paused:
            self._barrier.announce(self._go(paused=True))

    def pace(self, factor: float) -> None:
        pass

    @property
    def _here(self) -> tuple[int, int]:
        return self._stage.epoch, self._stage.tick

    def _greeting(self) -> Go:
        return self._go(self._stage.paused)

    def _go(self, paused: bool) -> Go:
        stage = self._stage
        return Go(
            simulation=self._node.transport.session,
            tick=stage.tick,
            time=stage.now,
            epoch=stage.epoch,
            paused=paused,
        )
