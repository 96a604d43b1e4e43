"""The life of a process under supervision: wait, start, watch, restart by policy, stop."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import time
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Literal

from deploy.policy import BAD_INPUT, Failed, Finished, Restart, after_exit, describe_exit
from deploy.process import Process
from deploy.supervisor.child import Child, Nursery
from deploy.supervisor.log_file import last_words, note
from deploy.supervisor.processor import Look
from deploy.supervisor.pulse import GRACE_S, LIMIT_S, Pulse
from messages.elea import Health, ProcessState
from services.runtime.errors import TRY_AGAIN, BadInput

State = Literal["waiting", "starting", "ready", "backing off", "stopping", "stopped", "finished", "failed"]

PATIENCE_S = (5.0, 3.0)
"""Wall time that a process has to end after SIGINT, then after SIGTERM; SIGKILL follows."""

KILLED_S = 2.0
"""Wall time in which the end after SIGKILL must be seen: a process that hangs in the kernel, as on a dead NFS server,
is left to it, and the end of the fleet does not wait."""

Work = Callable[[], Coroutine[Any, Any, None]]
Spawn = Callable[[Work, str], asyncio.Task[None]]
"""Starts a task by name among those of the supervisor."""

_NOT_STARTED = 127
_WORTH_TELLING_S = 0.1
_ERRORS = (1, BAD_INPUT, TRY_AGAIN)
"""Exit statuses by which a service tells of an error."""


class Life:
    """One process of a fleet. ``changed`` is called with it at each change of state.

    ``note`` and ``doing`` are what its last heartbeat said. One that ``complains`` was well when it was asked to end,
    and then ended with an error of its own.
    """

    def __init__(
        self,
        process: Process,
        nursery: Nursery,
        changed: Callable[[Life], None],
        dice: random.Random,
        grace: float = GRACE_S,
    ) -> None:
        self.process = process
        self.state: State = "waiting"
        self.ready = asyncio.Event()
        self.restarts: list[float] = []
        self.note, self.doing = "", ""
        self.complains = False
        self._reason = ""
        self._nursery, self._changed, self._dice, self._grace = nursery, changed, dice, grace
        self._needs: Sequence[Life] = ()
        self._child: Child | None = None
        self._pulse, self._look = Pulse(0.0), Look()
        self._hung = ""
        self._task: asyncio.Task[None] | None = None
        self._ending = asyncio.Lock()

    @property
    def runs(self) -> bool:
        """Whether it was started and has not come to its end since."""
        return self._task is not None and not self._task.done()

    def begin(self, spawn: Spawn, needs: Sequence[Life]) -> None:
        """Live, from now on; ``needs`` are those that must be ready first. Raises BadInput when it lives already: a
        second life would be a second process of the name.
        """
        if self.runs:
            raise BadInput(f"{self.process.name} runs already ({self.state})")
        self._needs = needs
        self._enter("waiting")
        self._task = spawn(self._live, self.process.name)

    def heard(self, beat: Health, now: float) -> None:
        """A heartbeat of the node has come; one of an earlier life does not count."""
        if self._child is None or beat.pid != self._child.pid or self.state not in ("starting", "ready"):
            return
        self._pulse.heard(now)
        self.note, self.doing = beat.note, beat.state
        if self.state == "starting":
            self.ready.set()
            self._enter("ready")

    def judge(self, now: float, late: bool) -> None:
        """Kill the process if it hangs. It is excused while the judge is ``late`` himself, or when what it depends on
        is down: its heartbeats may not get through then. Time in which it, or the judge, waits for a processor does not
        count: a restart would wait as well.
        """
        if self._child is None or self.state not in ("starting", "ready"):
            return
        if late or not all(need.well(now) for need in self._needs):
            self._pulse.excuse(now)
        if not self._pulse.is_late(now):
            self._look.forget()
            return
        self._pulse.defer(self._look.held_up(now))
        if self._pulse.hangs(now):
            self._hung = f"no heartbeat for {self._pulse.silence(now):.1f} s"
            if self._pulse.held_up > _WORTH_TELLING_S:
                self._hung += f", {self._pulse.held_up:.1f} s of them in wait for a processor"
            self._child.signal(signal.SIGKILL)

    def starved(self, now: float) -> float:
        """For how long [s] it has been silent because the machine is busy; 0 when it beats in time."""
        silent = self._pulse.silence(now)
        alive = self.state == "ready" and silent > LIMIT_S
        return silent if alive and self._pulse.held_up > _WORTH_TELLING_S else 0.0

    def well(self, now: float) -> bool:
        """Whether it runs and beats."""
        return self.state == "ready" and self._pulse.well(now)

    def kill(self) -> None:
        """End it at once."""
        if self._child is not None:
            self._child.signal(signal.SIGKILL)

    async def stop(self, patience: Sequence[float] = PATIENCE_S) -> None:
        """End it by SIGINT, SIGTERM and SIGKILL in turn, and keep it ended."""
        async with self._ending:
            if self._task is not None:
                self._task.cancel()
                await asyncio.wait([self._task])
            self.ready.clear()
            child = self._child
            if child is not None and child.status is None:
                was_ready = self.state == "ready"
                self._enter("stopping")
                for number, seconds in zip((signal.SIGINT, signal.SIGTERM), patience, strict=True):
                    child.signal(number)
                    child.signal(signal.SIGCONT)  # one that was stopped takes the other signal only when it goes on
                    if await child.ended_within(seconds):
                        break
                else:
                    child.signal(signal.SIGKILL)
                    if not await child.ended_within(KILLED_S):
                        note(self._nursery.log(self.process.name), f"process {child.pid} does not end after SIGKILL")
                self.complains = was_ready and child.status in _ERRORS
            if self.state not in ("finished", "failed"):
                self._enter("stopped")

    def show(self) -> ProcessState:
        """The state as it is published."""
        child = self._child
        alive = child is not None and child.status is None
        return ProcessState(
            name=self.process.name,
            state=self.state,
            pid=child.pid if alive and child else 0,
            restarts=len(self.restarts),
            exit_status=child.status if child else None,
            reason=self._reason,
        )

    async def _live(self) -> None:
        while True:
            for need in self._needs:
                await need.ready.wait()
            status = await self._run_once()
            how = self._hung or describe_exit(status)
            said = last_words(self._nursery.log(self.process.name))
            now, chance = time.monotonic(), self._dice.random()
            match after_exit(self.process.policy, self.restarts, now, status, chance, said):
                case Finished():
                    return self._enter("finished", how)
                case Failed(reason):
                    return self._enter("failed", f"{self._hung}: {reason}" if self._hung else reason)
                case Restart(pause):
                    self._enter("backing off", f"{how}; again in {pause:.2f} s")
                    await asyncio.sleep(pause)
                    self.restarts.append(time.monotonic())
                    self._enter("waiting")

    async def _run_once(self) -> int:
        """Start the process and wait for its end; its exit status."""
        log = self._nursery.log(self.process.name)
        if self._child is not None and self._child.status is None:  # one that was left behind, as after KILLED_S
            self._child.signal(signal.SIGKILL)
            await self._child.ended()
        self._hung, self._child = "", None
        try:
            self._child = self._nursery.start(self.process.name, self.process.argv)
        except OSError as error:
            note(log, f"cannot start {self.process.argv[0]}: {error}")
            return _NOT_STARTED
        self._pulse, self._look = Pulse(time.monotonic(), self._grace), Look(self._child.pid, os.getpid())
        self._enter("starting")
        try:
            return await self._child.ended()
        finally:
            self.ready.clear()

    def _enter(self, state: State, reason: str = "") -> None:
        self.state, self._reason = state, reason
        if reason:
            note(self._nursery.log(self.process.name), f"{self.process.name} {state}: {reason}")
        self._changed(self)
