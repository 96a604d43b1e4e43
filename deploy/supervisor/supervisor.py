"""A fleet under supervision, from its first process to the end of its last."""

from __future__ import annotations

import asyncio
import random
import sys
import time
import traceback
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Literal, Protocol

import msgspec

from deploy.process import Process
from deploy.supervisor.bus import Bus, Verb
from deploy.supervisor.child import Nursery
from deploy.supervisor.life import PATIENCE_S, Life, Work
from deploy.supervisor.pulse import GRACE_S
from messages.elea import FleetState
from services.runtime.errors import BadInput, unknown

TURN_S = 0.1
"""Wall time between two looks at heartbeats and orders."""

LATE_S = 0.5
"""A turn that comes so late [s] tells nothing about the others: the supervisor itself did not run."""

_UNDER_WAY: dict[Verb, str] = {"stop": "stopped", "restart": "restarted"}

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

    def noted(self, text: str) -> None:
        """Something hinders the supervision of all processes, or does no more."""
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
        self._note = ""
        self._end: asyncio.Future[tuple[Ended, str]] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._orders: dict[asyncio.Task[None], tuple[Verb, Life]] = {}

    async def run(self) -> Outcome:
        """Start everything, watch over it until the fleet ends, stop everything."""
        self._end = asyncio.get_running_loop().create_future()
        self._begun = time.monotonic()
        try:
            self._spawn(self._watch, "watch")
            for life in self.lives.values():
                self._begin(life)
            ended, reason = await self._end
            wall = time.monotonic() - self._begun
            await self._stop_all()
        finally:
            self.hurry()
            await self._cancel(self._tasks)
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
        return FleetState(fleet=self._fleet, mode=self._mode, processes=processes, note=self._note)

    def carry_out(self, verb: Verb, name: str) -> str:
        """Begin to carry out an order and say what happens; raises BadInput.

        A process has one order under way at a time; only a restart can be followed by a stop.
        """
        life = self.lives.get(name.removeprefix("/"))
        if life is None:
            raise unknown("process", name, self.lives)
        if self._stopping:
            raise BadInput("the fleet is about to end")
        under_way = self._under_way(life)
        if under_way and (verb, under_way) != ("stop", ["restart"]):
            raise BadInput(f"{name} is being {_UNDER_WAY[under_way[-1]]}: ask again when that is done")
        if verb == "start" and life.runs:
            raise BadInput(f"{name} runs already ({life.state})")
        if verb == "start":
            self._begin(life)
            return f"{name} starts"
        if verb == "stop" and not life.runs and not under_way:
            raise BadInput(f"{name} does not run ({life.state})")
        order = self._spawn(partial(self._restart if verb == "restart" else self._stop, life), f"{verb} {name}")
        self._orders[order] = verb, life
        order.add_done_callback(self._orders.pop)
        return f"{name} {verb}s"

    def busy(self, name: str) -> bool:
        """Whether an order for a process is under way."""
        return bool(self._under_way(self.lives[name]))

    def _under_way(self, life: Life) -> list[Verb]:
        return [order for order, of in self._orders.values() if of is life]

    def _begin(self, life: Life) -> None:
        life.begin(self._spawn, [self.lives[need] for need in life.process.depends_on])

    def _spawn(self, work: Work, name: str) -> asyncio.Task[None]:
        """Start a task. All that are left are cancelled when the fleet has ended, so none can outlast it."""
        task = asyncio.get_running_loop().create_task(self._guarded(work, name), name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _guarded(self, work: Work, name: str) -> None:
        """Do the work; an error of the supervisor's own ends the fleet in an orderly way, with its report."""
        try:
            await work()
        except Exception as error:  # noqa: BLE001 whatever it is, processes are to be stopped and a report is due
            traceback.print_exc(file=sys.stderr)
            self._finish("failed", f"internal error of the supervisor ({name}): {type(error).__name__}: {error}")

    async def _cancel(self, tasks: Iterable[asyncio.Task[None]]) -> None:
        for task in (left := list(tasks)):
            task.cancel()
        if left:
            await asyncio.wait(left)

    async def _stop(self, life: Life) -> None:
        await life.stop(self._patience)

    async def _restart(self, life: Life) -> None:
        await self._stop(life)
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
            unheard = self._is_unheard(now)
            for life in self.lives.values():
                life.judge(now, late or unheard)
            self._bus.answer(self.carry_out)
            self._witness.turned(tuple(self.lives.values()))
            await asyncio.sleep(TURN_S)

    def _is_unheard(self, now: float) -> bool:
        """Whether heartbeats do not come through, so that silence says nothing of a process; it is told once.

        All processes that were ready are silent at once while the router answers, or so much comes on their topic that
        they get lost. What ends is noticed and restarted in any case.
        """
        ready = [life for life in self.lives.values() if life.state == "ready"]
        why = ""
        if self._bus.flooded:
            why = "somebody floods /health, so that heartbeats get lost"
        elif len(ready) > 1 and not any(life.well(now) for life in ready) and self._bus.carries():
            why = "no heartbeat of any process comes, though the router answers"
        if why != self._note:
            self._note = why
            self._witness.noted(
                f"{why}: until this ends, a process that hangs is not noticed" if why else "heartbeats come"
            )
            self._bus.publish(self.state())
        return bool(why)

    async def _stop_all(self) -> None:
        """Stop in the reverse order of the start, those at once that nothing running depends on. Orders that are still
        under way are dropped first.
        """
        self._stopping = True
        await self._cancel(self._orders)
        left = dict(self.lives)
        while left:
            needed = {need for life in left.values() for need in life.process.depends_on}
            free = [name for name in left if name not in needed]
            await asyncio.wait([self._spawn(partial(self._stop, left.pop(name)), f"stop {name}") for name in free])

    def _changed(self, life: Life) -> None:
        state = self.state()
        waited = [each.state for each in self.lives.values() if each.process.begins]
        if not self._has_begun and all(each in ("ready", "finished", "failed", "stopped") for each in waited):
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
