"""A fleet under supervision, from its first process to the end of its last."""

from __future__ import annotations

import asyncio
import random
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Literal, Protocol

import msgspec

from deploy.processes import ProcessSpec
from deploy.supervisor.heartbeat_monitor import STARTUP_TIMEOUT_S
from deploy.supervisor.managed_process import STOP_TIMEOUTS_S, ManagedProcess, TaskFunction
from deploy.supervisor.spawner import Spawner
from messages.elea import FleetState, Health
from services.catalog import is_script
from services.runtime.errors import BadInput, unknown_name

ProcessAction = Literal["start", "stop", "restart"]

ActionHandler = Callable[[ProcessAction, str], str]
"""Takes an order for a process by name and says what will be done; raises BadInput to refuse."""


class FleetBus(Protocol):
    """The network as the supervisor needs it. No method blocks."""

    def heartbeats(self) -> Sequence[Health]:
        """The heartbeats that have come since the last call."""
        ...

    @property
    def flooded(self) -> bool:
        """Whether so much comes where heartbeats come that true ones are overwritten before they are read."""
        ...

    def router_answers(self) -> bool:
        """Whether the router answered in the last seconds; to be called repeatedly."""
        ...

    def publish(self, state: FleetState) -> None:
        """Publish the state of the fleet; late subscribers get the last one."""
        ...

    def answer_requests(self, handle_action: ActionHandler) -> bool:
        """Answer some of the orders that wait; whether more do."""
        ...


POLL_PERIOD_S = 0.1
"""Wall time between two looks at heartbeats and orders."""
BUSY_POLL_PERIOD_S = 0.02
"""The same while orders wait, and while a process starts: others wait until its first heartbeat is seen, and the start
is a chain of such."""

LATE_POLL_S = 0.5
"""Delay [s] of a turn after which silence of the processes does not count: the supervisor itself did not run."""

_PARTICIPLES: dict[ProcessAction, str] = {"stop": "stopped", "restart": "restarted"}

_MAX_LISTED = 8
"""Nodes of a process that are named at most."""

RunEnd = Literal["graded", "finished", "failed", "interrupted"]


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended: its grader finished, a required script finished or process failed, or it was interrupted.

    ``wall_seconds`` counts from the moment when simulation time could begin, from the start if that never came.
    ``failed_on_stop`` are the services that ended with an error when they were asked to end. ``containers_lost`` says
    of each process of several nodes that ended when it should not have why it did, and which nodes it had;
    ``failed_nodes`` are the nodes of all processes that did.
    """

    ended: RunEnd
    reason: str
    wall_seconds: float
    restarts: int
    failed_on_stop: tuple[str, ...] = ()
    containers_lost: tuple[str, ...] = ()
    failed_nodes: tuple[str, ...] = ()


class SupervisorObserver(Protocol):
    """An observer of the fleet's state; called from the supervisor's loop, with every change."""

    def on_state_change(self, life: ManagedProcess, fleet: FleetState) -> None:
        """A process has changed its state."""
        ...

    def on_note(self, text: str) -> None:
        """Something hinders the supervision of all processes, or does no more."""
        ...

    def on_poll(self, lives: Sequence[ManagedProcess]) -> None:
        """Another look at heartbeats is done."""
        ...


class Supervisor:
    """Runs processes until one of them, a signal or a request ends the fleet."""

    def __init__(
        self,
        fleet: str,
        mode: str,
        processes: Sequence[ProcessSpec],
        bus: FleetBus,
        spawner: Spawner,
        observer: SupervisorObserver,
        seed: int = 0,
        grace: float = STARTUP_TIMEOUT_S,
        stop_timeouts: Sequence[float] = STOP_TIMEOUTS_S,
    ) -> None:
        rng = random.Random(seed)
        self.processes = {each.name: ManagedProcess(each, spawner, self._changed, rng, grace) for each in processes}
        self._nodes = {node: each for each in self.processes.values() for node in each.spec.names}
        self._fleet, self._mode, self._bus, self._observer, self._stop_timeouts = (
            fleet,
            mode,
            bus,
            observer,
            stop_timeouts,
        )
        self._clock_start = time.monotonic()
        self._clock_started = self._stopping = False
        self._note = ""
        self._end: asyncio.Future[tuple[RunEnd, str]] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._actions: dict[asyncio.Task[None], tuple[ProcessAction, ManagedProcess]] = {}

    async def run(self) -> Outcome:
        """Start everything, watch over it until the fleet ends, stop everything."""
        self._end = asyncio.get_running_loop().create_future()
        self._clock_start = time.monotonic()
        try:
            self._start_task(self._watch, "watch")
            for life in self.processes.values():
                self._start(life)
            ended, reason = await self._end
            wall = time.monotonic() - self._clock_start
            await self._stop_all()
        finally:
            self.kill_all()
            await self._cancel(self._tasks)
        restarts = sum(len(life.restarts) for life in self.processes.values())
        # A program of ROS 1 that is asked to end often does so by the exception that its wait or its call raises.
        complaints = tuple(
            name for name, life in self.processes.items() if life.failed_on_stop and not is_script(life.spec.kind)
        )
        return Outcome(
            ended=ended,
            reason=reason,
            wall_seconds=wall,
            restarts=restarts,
            failed_on_stop=complaints,
            failed_nodes=tuple(name for life in self.processes.values() if life.failed for name in life.spec.names),
            containers_lost=tuple(
                f"the process {name} of {', '.join(life.spec.names)} has ended: {why}"
                for name, life in self.processes.items()
                if len(life.spec.nodes) > 1
                for why in life.losses
            ),
        )

    def interrupt(self) -> None:
        """End the fleet in an orderly way; asked again, end it at once."""
        if self._stopping:
            self.kill_all()
        self._finish("interrupted", "it was interrupted")

    def kill_all(self) -> None:
        """Kill whatever is left."""
        for life in self.processes.values():
            life.kill()

    def state(self) -> FleetState:
        """The fleet as it is published."""
        processes = tuple(life.state_message() for life in self.processes.values())
        return FleetState(fleet=self._fleet, mode=self._mode, processes=processes, note=self._note)

    def handle_action(self, verb: ProcessAction, name: str) -> str:
        """Begin to carry out an order and say what happens; raises BadInput.

        A process has one order under way at a time; only a restart can be followed by a stop.
        """
        life = self.processes.get(name.removeprefix("/")) or self._nodes.get(f"/{name.removeprefix('/')}")
        if life is None:
            raise unknown_name("process", name, dict.fromkeys([*self.processes, *(node[1:] for node in self._nodes)]))
        if self._stopping:
            raise BadInput("the fleet is stopping")
        under_way = self._pending_actions(life)
        if under_way and (verb, under_way) != ("stop", ["restart"]):
            raise BadInput(f"{_title(life, name)} is being {_PARTICIPLES[under_way[-1]]}: try again when that is done")
        if verb == "start" and life.is_running:
            raise BadInput(f"{_title(life, name)} is already running ({life.state})")
        if verb == "start":
            self._start(life)
            return f"{_title(life, name)} starts"
        if verb == "stop" and not life.is_running and not under_way:
            raise BadInput(f"{_title(life, name)} is not running ({life.state})")
        work = partial(self._restart if verb == "restart" else self._stop, life)
        order = self._start_task(work, f"{verb} {life.spec.name}")
        self._actions[order] = verb, life
        order.add_done_callback(self._actions.pop)
        return f"{_title(life, name)} {verb}s"

    def is_busy(self, name: str) -> bool:
        """Whether an order for a process is under way."""
        return bool(self._pending_actions(self.processes[name]))

    def _pending_actions(self, life: ManagedProcess) -> list[ProcessAction]:
        return [order for order, of in self._actions.values() if of is life]

    def _start(self, life: ManagedProcess) -> None:
        life.start(self._start_task, [self.processes[need] for need in life.spec.depends_on])

    def _start_task(self, work: TaskFunction, name: str) -> asyncio.Task[None]:
        """Start a task. All that are left are cancelled when the fleet has ended, so none can outlast it."""
        task = asyncio.get_running_loop().create_task(self._guarded(work, name), name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _guarded(self, work: TaskFunction, name: str) -> None:
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

    async def _stop(self, life: ManagedProcess) -> None:
        await life.stop(self._stop_timeouts)

    async def _restart(self, life: ManagedProcess) -> None:
        await self._stop(life)
        if not self._stopping:
            self._start(life)

    async def _watch(self) -> None:
        """Look at heartbeats, judge, answer orders."""
        last = time.monotonic()
        while True:
            for beat in self._bus.heartbeats():
                life = self._nodes.get(beat.node)
                if life is not None:
                    life.on_heartbeat(beat, time.monotonic())
            now = time.monotonic()
            late, last = now - last > LATE_POLL_S, now
            unheard = self._heartbeats_blocked(now)
            for life in self.processes.values():
                life.check_heartbeat(now, late or unheard, starting=not self._clock_started)
            more = self._bus.answer_requests(self.handle_action)
            self._observer.on_poll(tuple(self.processes.values()))
            starts = any(life.state == "starting" for life in self.processes.values())
            await asyncio.sleep(BUSY_POLL_PERIOD_S if starts or more else POLL_PERIOD_S)

    def _heartbeats_blocked(self, now: float) -> bool:
        """Whether heartbeats do not get through, so that silence does not mean a hang; logged once.

        Then all ready processes are silent at once while the router answers, or a flood on their topic drowns them.
        Processes that end are noticed and restarted in any case.
        """
        ready = [life for life in self.processes.values() if life.state == "ready"]
        why = ""
        if self._bus.flooded:
            why = "/health is flooded, so that heartbeats get lost"
        elif len(ready) > 1 and not any(life.is_healthy(now) for life in ready) and self._bus.router_answers():
            why = "no heartbeat of any process comes, though the router answers"
        if why != self._note:
            self._note = why
            self._observer.on_note(
                f"{why}: until this ends, a process that hangs is not noticed" if why else "heartbeats come"
            )
            self._bus.publish(self.state())
        return bool(why)

    async def _stop_all(self) -> None:
        """Stop in the reverse order of the start, those at once that nothing running depends on. Orders that are still
        under way are dropped first.
        """
        self._stopping = True
        await self._cancel(self._actions)
        left = dict(self.processes)
        while left:
            needed = {need for life in left.values() for need in life.spec.depends_on}
            free = [name for name in left if name not in needed]
            await asyncio.wait([self._start_task(partial(self._stop, left.pop(name)), f"stop {name}") for name in free])

    def _changed(self, life: ManagedProcess) -> None:
        state = self.state()
        waited = [each.state for each in self.processes.values() if each.spec.awaited]
        if not self._clock_started and all(each in ("ready", "finished", "failed", "stopped") for each in waited):
            self._clock_started, self._clock_start = True, time.monotonic()
        self._bus.publish(state)
        self._observer.on_state_change(life, state)
        if life.state == "finished" and life.spec.kind == "grader":
            self._finish("graded", "the run is over")
        elif life.state == "finished" and life.spec.ends_run:
            self._finish("finished", f"{life.spec.name} has finished")
        elif life.state in ("finished", "failed") and life.spec.required:
            self._finish("failed", f"{life.spec.name} {life.state}: {life.state_message().reason}")

    def _finish(self, ended: RunEnd, reason: str) -> None:
        if self._end is not None and not self._end.done():
            self._end.set_result((ended, reason))


def _title(life: ManagedProcess, asked: str) -> str:
    """A process as it was ``asked`` for; one of several nodes by its name and theirs, as all get what one gets."""
    name, nodes = life.spec.name, life.spec.names
    if len(nodes) == 1:
        return asked
    listed = ", ".join(nodes[:_MAX_LISTED]) + (f" and {len(nodes) - _MAX_LISTED} more" * (len(nodes) > _MAX_LISTED))
    return f"{name}, the process of {listed},"
