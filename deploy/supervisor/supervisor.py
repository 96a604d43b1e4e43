"""A fleet under supervision, from its first process to the end of its last."""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Sequence
from typing import Literal, Protocol

import msgspec

from deploy.process import Process
from deploy.supervisor.bus import Bus, Verb
from deploy.supervisor.child import Nursery
from deploy.supervisor.life import PATIENCE_S, Life
from deploy.supervisor.pulse import GRACE_S
from messages.elea import FleetState
from services.runtime.errors import BadInput, unknown

TURN_S = 0.1
"""Wall time between two looks at heartbeats and orders."""

LATE_S = 0.5
"""A turn that comes so late [s] tells nothing about the others: the supervisor itself did not run."""


Ended = Literal["graded", "failed", "interrupted"]


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended: its grader finished, a required process failed, or it was interrupted.

    ``wall_seconds`` counts from the moment when simulation time could begin, from the start if that never came.
    ``complaints`` are the processes that ended with an error when they were asked to end.
    """

    ended: Ended
    reason: str
    wall_seconds: float
    restarts: int
    complaints: tuple[str, ...] = ()


class Witness(Protocol):
    """Whoever wants to know how the fleet fares; called from the supervisor's loop, with every change."""

    def saw(self, life: Life, fleet: FleetState) -> None:
        """A process has changed its state."""
        ...

    def turned(self, lives: Sequence[Life]) -> None:
        """Another look at heartbeats is done."""
        ...


class Supervisor:
    """Runs processes until one of them, or somebody outside, ends the fleet."""

    def __init__(
        self,
        fleet: str,
        mode: str,
        processes: Sequence[Process],
        bus: Bus,
        nursery: Nursery,
        witness: Witness,
        seed: int = 0,
        grace: float = GRACE_S,
        patience: Sequence[float] = PATIENCE_S,
    ) -> None:
        dice = random.Random(seed)
        self.lives = {each.name: Life(each, nursery, self._changed, dice, grace) for each in processes}
        self._nodes = {each.process.node: each for each in self.lives.values()}
        self._fleet, self._mode, self._bus, self._witness, self._patience = fleet, mode, bus, witness, patience
        self._begun = time.monotonic()
        self._has_begun = self._stopping = False
        self._end: asyncio.Future[tuple[Ended, str]] | None = None

    async def run(self) -> Outcome:
        """Start everything, watch over it until the fleet ends, stop everything."""
        self._end = asyncio.get_running_loop().create_future()
        self._begun = time.monotonic()
        try:
            async with asyncio.TaskGroup() as tasks:
                self._tasks = tasks
                watching = tasks.create_task(self._watch())
                for life in self.lives.values():
                    self._begin(life)
                ended, reason = await self._end
                wall = time.monotonic() - self._begun
                await self._stop_all()
                watching.cancel()
        finally:
            self.hurry()
        restarts = sum(len(life.restarts) for life in self.lives.values())
        complaints = tuple(name for name, life in self.lives.items() if life.complains)
        return Outcome(ended=ended, reason=reason, wall_seconds=wall, restarts=restarts, complaints=complaints)

    def interrupt(self) -> None:
        """End the fleet in an orderly way; asked again, end it at once."""
        if self._stopping:
            self.hurry()
        self._finish("interrupted", "it was interrupted")

    def hurry(self) -> None:
        """Kill whatever is left."""
        for life in self.lives.values():
            life.kill()

    def state(self) -> FleetState:
        """The fleet as it is published."""
        processes = tuple(life.show() for life in self.lives.values())
        return FleetState(fleet=self._fleet, mode=self._mode, processes=processes)

    def carry_out(self, verb: Verb, name: str) -> str:
        """Begin to carry out an order and say what happens; raises BadInput."""
        life = self.lives.get(name.removeprefix("/"))
        if life is None:
            raise unknown("process", name, self.lives)
        if self._stopping:
            raise BadInput("the fleet is about to end")
        runs = life.state not in ("stopped", "finished", "failed")
        if verb == "start" and runs:
            raise BadInput(f"{name} runs already ({life.state})")
        if verb == "start":
            self._begin(life)
            return f"{name} starts"
        if verb == "stop" and not runs:
            raise BadInput(f"{name} does not run ({life.state})")
        self._tasks.create_task(self._restart(life) if verb == "restart" else life.stop(self._patience))
        return f"{name} {verb}s"

    def _begin(self, life: Life) -> None:
        life.begin(self._tasks, [self.lives[need] for need in life.process.depends_on])

    async def _restart(self, life: Life) -> None:
        await life.stop(self._patience)
        if not self._stopping:
            self._begin(life)

    async def _watch(self) -> None:
        """Look at heartbeats, judge, answer orders."""
        last = time.monotonic()
        while True:
            for beat in self._bus.beats():
                life = self._nodes.get(beat.node)
                if life is not None:
                    life.heard(beat, time.monotonic())
            now = time.monotonic()
            late, last = now - last > LATE_S, now
            for life in self.lives.values():
                life.judge(now, late)
            self._bus.answer(self.carry_out)
            self._witness.turned(tuple(self.lives.values()))
            await asyncio.sleep(TURN_S)

    async def _stop_all(self) -> None:
        """Stop in the reverse order of the start, those at once that nothing running depends on."""
        self._stopping = True
        left = dict(self.lives)
        while left:
            needed = {need for life in left.values() for need in life.process.depends_on}
            free = [name for name in left if name not in needed]
            await asyncio.gather(*(left.pop(name).stop(self._patience) for name in free))

    def _changed(self, life: Life) -> None:
        state = self.state()
        if not self._has_begun and all(each.state == "ready" for each in self.lives.values() if each.process.begins):
            self._has_begun, self._begun = True, time.monotonic()
        self._bus.publish(state)
        self._witness.saw(life, state)
        if life.state == "finished" and life.process.kind == "grader":
            self._finish("graded", "the run is over")
        elif life.state in ("finished", "failed") and life.process.required:
            self._finish("failed", f"{life.process.name} {life.state}: {life.show().reason}")

    def _finish(self, ended: Ended, reason: str) -> None:
        if self._end is not None and not self._end.done():
            self._end.set_result((ended, reason))
