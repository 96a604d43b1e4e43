"""Supervises a fleet from the start of its first process to the end of its last."""

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
from services.runtime.errors import BadInput, list_names, unknown_name

ProcessAction = Literal["start", "stop", "restart"]

ActionHandler = Callable[[ProcessAction, str], str]
"""Takes an action on a process by name; returns what will be done, or raises BadInput to refuse."""


class FleetBus(Protocol):
    """The supervisor's network interface. No method blocks."""

    def heartbeats(self) -> Sequence[Health]:
        """Return the heartbeats received since the last call."""
        ...

    @property
    def delay_s(self) -> float:
        """The longest time [s] that one of these was on its way, on the machine's clock."""
        ...

    @property
    def flooded(self) -> bool:
        """Whether so many messages arrive on the heartbeats' topic that real ones are overwritten
        before they are read.
        """
        ...

    def router_answers(self) -> bool:
        """Return whether the router answered in the last few seconds; to be called repeatedly."""
        ...

    def publish(self, state: FleetState) -> None:
        """Publish the state of the fleet, latched for late subscribers."""
        ...

    def answer_requests(self, handle_action: ActionHandler) -> bool:
        """Answer some of the pending requests; return whether more are pending."""
        ...


POLL_PERIOD_S = 0.1
"""Wall time between two checks of heartbeats and requests."""
BUSY_POLL_PERIOD_S = 0.02
"""The same while requests are pending, and while a process starts: others wait for its first heartbeat, so these delays
add up over the start."""

LATE_POLL_S = 0.5
"""Delay [s] of a check beyond which the processes' silence does not count: the supervisor itself did not run."""

LATE_HEARTBEAT_S = 1.0
"""Time [s] that a heartbeat is on its way beyond which the processes' silence does not count: those of others may be as
late, or later, since a busy router does not serve all its links at once."""

_PARTICIPLES: dict[ProcessAction, str] = {"stop": "stopped", "restart": "restarted"}

_MAX_LISTED = 8
"""Maximum number of nodes of a process that are listed."""

RunEnd = Literal["graded", "finished", "failed", "interrupted"]


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended: its grader finished, a required script finished or process failed, or it was interrupted.

    ``wall_seconds`` counts from the moment when simulation time could begin, or from the start if that never came.
    ``failed_on_stop`` are the services that exited with an error when they were asked to stop. ``containers_lost``
    describes each abnormal end of a process with several nodes: the reason, and its nodes. ``failed_nodes`` are the
    nodes of all processes that exited with an error by themselves, or that the end of a graded run stopped just as they
    failed.
    """

    ended: RunEnd
    reason: str
    wall_seconds: float
    restarts: int
    failed_on_stop: tuple[str, ...] = ()
    containers_lost: tuple[str, ...] = ()
    failed_nodes: tuple[str, ...] = ()


class SupervisorObserver(Protocol):
    """An observer of the fleet's state; called from the supervisor's loop at every change."""

    def on_state_change(self, process: ManagedProcess, fleet: FleetState) -> None:
        """Handle a process's change of state."""
        ...

    def on_note(self, text: str) -> None:
        """Handle the start or end of a problem that affects the supervision of all processes."""
        ...

    def on_poll(self, processes: Sequence[ManagedProcess]) -> None:
        """Handle the end of a check of heartbeats and requests."""
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
        """Start all processes, monitor them until the fleet ends, then stop them all."""
        self._end = asyncio.get_running_loop().create_future()
        self._clock_start = time.monotonic()
        try:
            self._start_task(self._watch, "watch")
            for process in self.processes.values():
                self._start(process)
            ended, reason = await self._end
            wall = time.monotonic() - self._clock_start
            await self._stop_all(graded=ended == "graded")
        finally:
            self.kill_all()
            await self._cancel(self._tasks)
        restarts = sum(len(process.restarts) for process in self.processes.values())
        # A ROS 1 program that is asked to stop often exits with the exception that its wait or call raises.
        failed_on_stop = tuple(
            name
            for name, process in self.processes.items()
            if process.failed_on_stop and not is_script(process.spec.kind)
        )
        return Outcome(
            ended=ended,
            reason=reason,
            wall_seconds=wall,
            restarts=restarts,
            failed_on_stop=failed_on_stop,
            failed_nodes=tuple(
                name for process in self.processes.values() if process.failed for name in process.spec.names
            ),
            containers_lost=tuple(
                f"the process {name} of {', '.join(process.spec.names)} has ended: {why}"
                for name, process in self.processes.items()
                if len(process.spec.nodes) > 1
                for why in process.losses
            ),
        )

    def interrupt(self) -> None:
        """Stop the fleet in an orderly way; if called again, kill it."""
        if self._stopping:
            self.kill_all()
        self._finish("interrupted", "it was interrupted")

    def kill_all(self) -> None:
        """Kill all processes that are left."""
        for process in self.processes.values():
            process.kill()

    def state(self) -> FleetState:
        """Return the state of the fleet as published."""
        processes = tuple(process.state_message() for process in self.processes.values())
        return FleetState(fleet=self._fleet, mode=self._mode, processes=processes, note=self._note)

    def handle_action(self, action: ProcessAction, name: str) -> str:
        """Begin an action and return a description of it; raises BadInput.

        A process has one pending action at a time; only a restart may be followed by a stop.
        """
        process = self.processes.get(name.removeprefix("/")) or self._nodes.get(f"/{name.removeprefix('/')}")
        if process is None:
            raise unknown_name("process", name, dict.fromkeys([*self.processes, *(node[1:] for node in self._nodes)]))
        if self._stopping:
            raise BadInput("the fleet is stopping")
        pending = self._pending_actions(process)
        if pending and (action, pending) != ("stop", ["restart"]):
            raise BadInput(f"{_title(process, name)} is being {_PARTICIPLES[pending[-1]]}: try again when that is done")
        if action == "start" and process.is_running:
            raise BadInput(f"{_title(process, name)} is already running ({process.state})")
        if action == "start":
            self._start(process)
            return f"{_title(process, name)} starts"
        if action == "stop" and not process.is_running and not pending:
            raise BadInput(f"{_title(process, name)} is not running ({process.state})")
        work = partial(self._restart if action == "restart" else self._stop, process)
        task = self._start_task(work, f"{action} {process.spec.name}")
        self._actions[task] = action, process
        task.add_done_callback(self._actions.pop)
        return f"{_title(process, name)} {action}s"

    def is_busy(self, name: str) -> bool:
        """Return whether an action on a process is pending."""
        return bool(self._pending_actions(self.processes[name]))

    def _pending_actions(self, process: ManagedProcess) -> list[ProcessAction]:
        return [action for action, of in self._actions.values() if of is process]

    def _start(self, process: ManagedProcess) -> None:
        process.start(self._start_task, [self.processes[need] for need in process.spec.depends_on])

    def _start_task(self, work: TaskFunction, name: str) -> asyncio.Task[None]:
        """Start a task. Remaining tasks are cancelled when the fleet has ended, so none can outlast it."""
        task = asyncio.get_running_loop().create_task(self._guarded(work, name), name=name)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _guarded(self, work: TaskFunction, name: str) -> None:
        """Do the work; an error of the supervisor itself ends the fleet in an orderly way, with its report."""
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

    async def _stop(self, process: ManagedProcess, at_end: bool = False) -> None:
        await process.stop(self._stop_timeouts, at_end)

    async def _restart(self, process: ManagedProcess) -> None:
        await self._stop(process)
        if not self._stopping:
            self._start(process)

    async def _watch(self) -> None:
        """Check heartbeats and answer requests, in a loop."""
        last = time.monotonic()
        while True:
            for beat in self._bus.heartbeats():
                process = self._nodes.get(beat.node)
                if process is not None:
                    process.on_heartbeat(beat, time.monotonic())
            now = time.monotonic()
            late, last = now - last > LATE_POLL_S or self._bus.delay_s > LATE_HEARTBEAT_S, now
            unheard = self._heartbeats_blocked(now)
            for process in self.processes.values():
                process.check_heartbeat(now, late or unheard, starting=not self._clock_started)
            more = self._bus.answer_requests(self.handle_action)
            self._observer.on_poll(tuple(self.processes.values()))
            starts = any(process.state == "starting" for process in self.processes.values())
            await asyncio.sleep(BUSY_POLL_PERIOD_S if starts or more else POLL_PERIOD_S)

    def _heartbeats_blocked(self, now: float) -> bool:
        """Return whether heartbeats do not get through, so that silence does not mean a hang; report changes once.

        This is so when all ready processes are silent at once while the router answers, or when a flood on their topic
        displaces them. Processes that end are noticed and restarted in any case.
        """
        ready = [process for process in self.processes.values() if process.state == "ready"]
        why = ""
        if self._bus.flooded:
            why = "/health is flooded, so heartbeats are lost"
        elif len(ready) > 1 and not any(process.is_healthy(now) for process in ready) and self._bus.router_answers():
            why = "no heartbeat of any process arrives, although the router answers"
        if why != self._note:
            self._note = why
            self._observer.on_note(
                f"{why}: until this ends, a hung process is not detected" if why else "heartbeats arrive again"
            )
            self._bus.publish(self.state())
        return bool(why)

    async def _stop_all(self, graded: bool) -> None:
        """Cancel pending actions, then stop all processes in reverse start order, in parallel where nothing running
        depends on them.

        In a ``graded`` run, a process that then exits with an error has failed, except for a ROS 1 program.
        """
        self._stopping = True
        await self._cancel(self._actions)
        left = dict(self.processes)
        while left:
            needed = {need for process in left.values() for need in process.spec.depends_on}
            free = [name for name in left if name not in needed]
            tasks = []
            for name in free:
                process = left.pop(name)
                work = partial(self._stop, process, at_end=graded and not is_script(process.spec.kind))
                tasks.append(self._start_task(work, f"stop {name}"))
            await asyncio.wait(tasks)

    def _changed(self, process: ManagedProcess) -> None:
        state = self.state()
        waited = [each.state for each in self.processes.values() if each.spec.awaited]
        if not self._clock_started and all(each in ("ready", "finished", "failed", "stopped") for each in waited):
            self._clock_started, self._clock_start = True, time.monotonic()
        self._bus.publish(state)
        self._observer.on_state_change(process, state)
        if process.state == "finished" and process.spec.kind == "grader":
            self._finish("graded", "the run is over")
        elif process.state == "finished" and process.spec.ends_run:
            self._finish("finished", f"{process.spec.name} has finished")
        elif process.state in ("finished", "failed") and process.spec.required:
            self._finish("failed", f"{process.spec.name} {process.state}: {process.state_message().reason}")

    def _finish(self, ended: RunEnd, reason: str) -> None:
        if self._end is not None and not self._end.done():
            self._end.set_result((ended, reason))


def _title(process: ManagedProcess, asked: str) -> str:
    """Return a process's title for messages: as ``asked``, or for several nodes its name and theirs, as all are
    affected.
    """
    name, nodes = process.spec.name, process.spec.names
    if len(nodes) == 1:
        return asked
    return f"{name}, the process of {list_names(nodes, _MAX_LISTED)},"
