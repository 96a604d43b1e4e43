"""The life cycle of a supervised process: wait, start, monitor, restart by policy, stop."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Literal

from deploy.processes import ProcessSpec
from deploy.restart_policy import BAD_INPUT, Failed, Finished, Restart, decide_after_exit, describe_exit
from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S, STARTUP_TIMEOUT_S, CpuWaitMeter, HeartbeatMonitor
from deploy.supervisor.log_file import append_note, last_line
from deploy.supervisor.spawner import ChildProcess, Spawner
from messages.elea import Health, ProcessState
from services.runtime.errors import TRY_AGAIN, BadInput

ProcessStateName = Literal["waiting", "starting", "ready", "backing off", "stopping", "stopped", "finished", "failed"]

STOP_TIMEOUTS_S = (5.0, 3.0)
"""Wall time to wait for the exit after SIGINT, then after SIGTERM; SIGKILL follows."""

KILL_TIMEOUT_S = 2.0
"""Wall time to wait for the exit after SIGKILL: a process that hangs in the kernel, e.g. on a dead NFS server, is left
behind, and the fleet's end does not wait for it.
"""

ENDING_S = 2.0
"""Wall time that a process whose nodes have all ended has to exit by itself before it is signalled."""

TaskFunction = Callable[[], Coroutine[Any, Any, None]]
StartTask = Callable[[TaskFunction, str], asyncio.Task[None]]
"""Starts a named task among those of the supervisor."""

_NOT_STARTED = 127
_REPORTED_CPU_WAIT_S = 0.1
_ERROR_STATUSES = (1, BAD_INPUT, TRY_AGAIN)
"""Exit statuses with which a service reports an error."""


class ManagedProcess:
    """One process of a fleet; ``changed`` is called with it at each change of state.

    It is ready when all its nodes have published a heartbeat, and hung when one of them stops doing so.
    ``failed_on_stop``: it was ready when asked to stop, and then exited with an error.
    """

    def __init__(
        self,
        process: ProcessSpec,
        spawner: Spawner,
        changed: Callable[[ManagedProcess], None],
        rng: random.Random,
        grace: float = STARTUP_TIMEOUT_S,
    ) -> None:
        self.spec = process
        self.state: ProcessStateName = "waiting"
        self.ready = asyncio.Event()
        self.restarts: list[float] = []
        self.failed_on_stop = False
        self.losses: list[str] = []
        """The reason of each abnormal end."""
        self.failed = False
        """Whether it exited with an error by itself; being killed for a hang does not count."""
        self._reason = ""
        self._spawner, self._changed, self._rng, self._grace = spawner, changed, rng, grace
        self._dependencies: Sequence[ManagedProcess] = ()
        self._child: ChildProcess | None = None
        self._heartbeats: dict[str, HeartbeatMonitor] = {}
        """By node; a node that has ended before its process is removed."""
        self._beats: dict[str, Health] = {}
        """The last heartbeat of each node."""
        self._cpu_wait = CpuWaitMeter()
        self._hang_reason = ""
        self._task: asyncio.Task[None] | None = None
        self._stop_lock = asyncio.Lock()

    @property
    def is_running(self) -> bool:
        """Whether it was started and has not finished, failed or been stopped since."""
        return self._task is not None and not self._task.done()

    @property
    def note(self) -> str:
        """The first note in its nodes' last heartbeats."""
        noted = ((name, beat.note) for name, beat in self._beats.items() if beat.note)
        name, note = next(noted, ("", ""))
        return f"{name}: {note}" if note and len(self.spec.nodes) > 1 else note

    @property
    def activity(self) -> str:
        """The state in its nodes' last heartbeats: the first that is not "running", if any."""
        states = [beat.state for beat in self._beats.values()]
        return next((each for each in states if each != "running"), states[0] if states else "")

    def start(self, spawn: StartTask, needs: Sequence[ManagedProcess]) -> None:
        """Start it as soon as all processes in ``needs`` are ready.

        Raises BadInput if it is already running: there would be two processes of this name.
        """
        if self.is_running:
            raise BadInput(f"{self.spec.name} is already running ({self.state})")
        self._dependencies = needs
        self._set_state("waiting")
        self._task = spawn(self._run, self.spec.name)

    def on_heartbeat(self, beat: Health, now: float) -> None:
        """Record a heartbeat of a node; one from an earlier run of the process is ignored."""
        if self._child is None or beat.pid != self._child.pid or self.state not in ("starting", "ready"):
            return
        if beat.state == "stopping":  # the other nodes of its process go on
            self._heartbeats.pop(beat.node, None)
        elif beat.node in self._heartbeats:
            self._heartbeats[beat.node].on_heartbeat(now)
        self._beats[beat.node] = beat
        if self.state == "starting" and all(each.received for each in self._heartbeats.values()):
            self.ready.set()
            self._set_state("ready")

    def check_heartbeat(self, now: float, late: bool, starting: bool = False) -> None:
        """Kill the process if it hangs.

        It is excused while the supervisor or the heartbeats that it receives are ``late``, and while a process that it
        depends on is down, since its heartbeats may not get through then. Time in which it, the supervisor, or the
        router between them waits for a CPU does not count: a restarted process would wait as well. While the fleet is
        ``starting``, declarations and queries between its processes may delay a heartbeat, so the start-up timeout
        applies to each of them.
        """
        if self._child is None or self.state not in ("starting", "ready") or self._hang_reason:
            return
        excused = late or not all(need.is_healthy(now) for need in self._dependencies)
        for each in self._heartbeats.values():
            if excused or (starting and each.received and each.silence(now) < self._grace):
                each.extend_to(now)
        overdue = [each for each in self._heartbeats.values() if each.is_late(now)]
        if not overdue:
            self._measure_cpu_wait_anew(self._child)
            return
        waited = self._cpu_wait.measure(now)
        for each in overdue:
            each.extend_by(waited)
        if hung := [(node, each) for node, each in self._heartbeats.items() if each.is_hung(now)]:
            node, heartbeat = hung[0]
            whose = f" of {node}" if len(self.spec.nodes) > 1 else ""
            self._hang_reason = f"no heartbeat{whose} for {heartbeat.silence(now):.1f} s"
            if heartbeat.cpu_wait_s > _REPORTED_CPU_WAIT_S:
                self._hang_reason += f", of which it waited {heartbeat.cpu_wait_s:.1f} s for a processor"
            self._child.signal(signal.SIGKILL)

    def starved_for(self, now: float) -> float:
        """Return how long [s] it has been silent because the machine is busy; 0 if its heartbeats are on time."""
        starved = [each for each in self._heartbeats.values() if each.cpu_wait_s > _REPORTED_CPU_WAIT_S]
        silent = max((each.silence(now) for each in starved), default=0.0)
        return silent if self.state == "ready" and silent > HEARTBEAT_TIMEOUT_S else 0.0

    def is_healthy(self, now: float) -> bool:
        """Return whether it is ready and all its nodes publish heartbeats."""
        return self.state == "ready" and all(each.is_healthy(now) for each in self._heartbeats.values())

    def kill(self) -> None:
        """Kill its process group."""
        if self._child is not None:
            self._child.signal(signal.SIGKILL)

    async def stop(self, stop_timeouts: Sequence[float] = STOP_TIMEOUTS_S, at_end: bool = False) -> None:
        """Stop it by SIGINT, SIGTERM and SIGKILL in turn, and do not restart it.

        A process whose nodes have all ended is about to exit: its exit counts as if it had not been asked to stop.
        ``at_end``: the run has ended by itself, which may happen just as the process fails, so an exit with an error is
        recorded as its own failure.
        """
        async with self._stop_lock:
            if self._task is not None:
                self._task.cancel()
                await asyncio.wait([self._task])
            self.ready.clear()
            child = self._child
            if child is not None and self.state == "ready" and await self._ends_by_itself(child):
                how, last = self._note_end(child.status or 0)
                if child.status:
                    self._set_state("failed", f"{how}: {last}" if last and child.status > 0 else how)
                else:
                    self._set_state("finished", how)
            elif child is not None and child.status is None:
                was_ready = self.state == "ready"
                self._set_state("stopping")
                for number, seconds in zip((signal.SIGINT, signal.SIGTERM), stop_timeouts, strict=True):
                    child.signal(number)
                    child.signal(signal.SIGCONT)  # a stopped process handles the other signal only once it continues
                    if await child.wait_for(seconds):
                        break
                else:
                    child.signal(signal.SIGKILL)
                    if not await child.wait_for(KILL_TIMEOUT_S):
                        append_note(
                            self._spawner.log_path(self.spec.name), f"process {child.pid} does not end after SIGKILL"
                        )
                self.failed_on_stop = was_ready and child.status in _ERROR_STATUSES
                if self.failed_on_stop and at_end:
                    self._note_end(child.status or 0)
            if self.state not in ("finished", "failed"):
                self._set_state("stopped")

    async def _ends_by_itself(self, child: ChildProcess) -> bool:
        """Return whether a process has exited unasked, or does so within ENDING_S of the end of all its nodes."""
        return child.status is not None or (not self._heartbeats and await child.wait_for(ENDING_S))

    def _note_end(self, status: int) -> tuple[str, str]:
        """Record an unrequested end, by exit or for its silence; return its description and the
        last line of the log.
        """
        how = self._hang_reason or describe_exit(status)
        last = last_line(self._spawner.log_path(self.spec.name))
        self.failed = self.failed or (status != 0 and not self._hang_reason)
        if status or self._hang_reason:
            self.losses.append(f"{how}: {last}" if last and status > 0 else how)
        return how, last

    def state_message(self) -> ProcessState:
        """Return its state as published."""
        child = self._child
        alive = child is not None and child.status is None
        return ProcessState(
            name=self.spec.name,
            state=self.state,
            pid=child.pid if alive and child else 0,
            restarts=len(self.restarts),
            exit_status=child.status if child else None,
            reason=self._reason,
            nodes=self.spec.names if len(self.spec.nodes) > 1 else (),
        )

    async def _run(self) -> None:
        while True:
            for need in self._dependencies:
                await need.ready.wait()
            status = await self._run_once()
            how, last = self._note_end(status)
            now, chance = time.monotonic(), self._rng.random()
            match decide_after_exit(self.spec.policy, self.restarts, now, status, chance, last):
                case Finished():
                    return self._set_state("finished", how)
                case Failed(reason):
                    return self._set_state("failed", f"{self._hang_reason}: {reason}" if self._hang_reason else reason)
                case Restart(pause):
                    self._set_state("backing off", f"{how}; restarting in {pause:.2f} s")
                    await asyncio.sleep(pause)
                    self.restarts.append(time.monotonic())
                    self._set_state("waiting")

    async def _run_once(self) -> int:
        """Start the process and wait for its end; return its exit status."""
        log = self._spawner.log_path(self.spec.name)
        if self._child is not None and self._child.status is None:  # one that was left behind after KILL_TIMEOUT_S
            self._child.signal(signal.SIGKILL)
            await self._child.wait()
        self._hang_reason, self._child = "", None
        try:
            self._child = self._spawner.spawn(
                self.spec.name, self.spec.argv, self.spec.environment, self.spec.cwd, self.spec.screen
            )
        except OSError as error:
            append_note(log, f"cannot start {self.spec.argv[0]}: {error}")
            return _NOT_STARTED
        now = time.monotonic()
        self._heartbeats = {node: HeartbeatMonitor(now, self._grace) for node in self.spec.names}
        self._beats = {}
        self._measure_cpu_wait_anew(self._child)
        self._set_state("starting")
        try:
            return await self._child.wait()
        finally:
            self.ready.clear()

    def _measure_cpu_wait_anew(self, child: ChildProcess) -> None:
        routers = [need._child.pid for need in self._dependencies if need.spec.kind == "router" and need._child]
        self._cpu_wait.reset(child.pid, os.getpid(), *routers)

    def _set_state(self, state: ProcessStateName, reason: str = "") -> None:
        self.state, self._reason = state, reason
        if reason:
            append_note(self._spawner.log_path(self.spec.name), f"{self.spec.name} {state}: {reason}")
        self._changed(self)
