"""Common parts of the supervisor's tests: child processes, a runner for them, and time limits."""

from __future__ import annotations

import asyncio
import re
import sys
import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

import psutil

from deploy.processes import NodeSpec, ProcessSpec
from deploy.restart_policy import RestartPolicy
from deploy.supervisor.managed_process import ManagedProcess
from deploy.supervisor.reaper import Reaper
from deploy.supervisor.spawner import Spawner
from deploy.supervisor.supervisor import Outcome, Supervisor
from messages.elea import FleetState
from tests.deploy.supervisor.fake_bus import FakeBus
from tests.harness.cases import case

WITHIN_S = 240.0
"""Wall time limit of each wait in a scenario. Time in which a process or the supervisor waits for a processor does not
count as silence: with fifteen processes per processor, an endless loop is detected only after half a minute, and beside
busy programs of other sessions after more than one.
"""


def faulty_process(script: str, node: str, *arguments: str, **options: Any) -> ProcessSpec:
    """Return a faulty child as a process of a fleet."""
    argv = (sys.executable, "-P", "-m", f"tests.deploy.supervisor.faulty.{script}", node, *arguments)
    kind = options.pop("kind", script)
    return ProcessSpec(name=node.strip("/"), nodes=(NodeSpec(name=node, kind=kind),), kind=kind, argv=argv, **options)


class SupervisorHarness:
    """A run's folder, a reaper and a fake bus; records every state change."""

    def __init__(self, folder: Path, stop_timeouts: Sequence[float] = (0.5, 0.5), grace: float = 20.0) -> None:
        (folder / "logs").mkdir(parents=True, exist_ok=True)
        self.folder, self.bus, self.reaper = folder, FakeBus(folder), Reaper()
        self.spawner = Spawner(folder, self.reaper)
        self.state_changes: list[tuple[float, str, str]] = []
        self.notes: list[str] = []
        self.stop_timeouts, self.grace = stop_timeouts, grace
        self._excused: dict[str, float] = {}
        self._killed: dict[str, float] = {}

    def supervisor(self, *processes: ProcessSpec) -> Supervisor:
        made = Supervisor(
            "test", "real", processes, self.bus, self.spawner, self, stop_timeouts=self.stop_timeouts, grace=self.grace
        )
        for name, process in made.processes.items():
            self._record_checks(name, process)
        return made

    def _record_checks(self, name: str, process: ManagedProcess) -> None:
        """Record the last check that excused a process for the supervisor's own delay, and the one that killed it."""
        check = process.check_heartbeat

        def recorded(now: float, late: bool, starting: bool = False) -> None:
            hung = process._hang_reason
            check(now, late, starting)
            if late:
                self._excused[name] = now
            if process._hang_reason and not hung:
                self._killed[name] = now

        process.check_heartbeat = recorded  # type: ignore[method-assign]

    def on_state_change(self, process: ManagedProcess, fleet: FleetState) -> None:
        self.state_changes.append((time.monotonic(), process.spec.name, process.state))

    def on_note(self, text: str) -> None:
        self.notes.append(text)

    def on_poll(self, processes: Sequence[ManagedProcess]) -> None:
        pass

    def print_line(self, line: str) -> None:
        """Record a line that a user would see, where the harness is the screen too."""
        self.notes.append(line)

    def set_status(self, line: str) -> None:
        pass

    def states(self, name: str) -> list[str]:
        """Return the states that a process went through."""
        return [state for _, process, state in self.state_changes if process == name]

    def time_of(self, name: str, state: str, occurrence: int = 0) -> float:
        """Return when [s, monotonic clock] a process entered a state for the ``occurrence``-th time, from 0."""
        return [at for at, process, reached in self.state_changes if (process, reached) == (name, state)][occurrence]

    def log(self, name: str) -> str:
        return (self.folder / "logs" / f"{name}.log").read_text()

    def silence(self, name: str) -> float:
        """Return how long [s] a process was silent, while it had a processor, when it was last killed for that."""
        silent, waited = self._silence(name)
        return silent - waited

    def unexcused_silence(self, name: str) -> float:
        """Return ``silence``, but from the last check that excused the process for the supervisor's own delay."""
        silent, waited = self._silence(name)
        return min(silent, self._killed[name] - self._excused.get(name, 0.0)) - waited

    def _silence(self, name: str) -> tuple[float, float]:
        log = self.log(name)
        said = re.findall(r"no heartbeat for ([\d.]+) s(?:, of which it waited ([\d.]+) s for a processor)?", log)
        assert said, log
        silent, waited = said[-1]
        return float(silent), float(waited or 0)

    def run(self, script: Callable[[Supervisor], Any], *processes: ProcessSpec) -> Outcome:
        """Run the processes with ``script``, a coroutine function that acts on the supervisor; then interrupt it."""

        return asyncio.run(self.play(script, *processes))

    async def play(self, script: Callable[[Supervisor], Any], *processes: ProcessSpec) -> Outcome:
        """Like ``run``, for tests that run several at once."""
        supervisor = self.supervisor(*processes)
        running = asyncio.create_task(supervisor.run())
        try:
            await asyncio.wait_for(script(supervisor), WITHIN_S)
        finally:
            try:
                supervisor.interrupt()
                outcome = await asyncio.wait_for(running, WITHIN_S)
            finally:
                self.reaper.close()
        return outcome


def play_side_by_side(folder: Path, scenarios: Sequence[Callable[[SupervisorHarness], Awaitable[None]]]) -> None:
    """Play scenarios concurrently, as each mostly waits; each has a folder of its own."""

    async def play(scenario: Callable[[SupervisorHarness], Awaitable[None]], name: str) -> None:
        with case(name):
            await scenario(SupervisorHarness(folder / name))

    async def play_all() -> None:
        async with asyncio.TaskGroup() as group:
            for each in scenarios:
                group.create_task(play(each, each.__name__))

    asyncio.run(play_all())


async def wait_until(condition: Callable[[], object], seconds: float = WITHIN_S) -> None:
    """Wait until a condition holds; fail after ``seconds``."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        await asyncio.sleep(0.02)


async def wait_all_ready(supervisor: Supervisor) -> None:
    """Wait until every process is ready."""
    await wait_until(lambda: all(process.state == "ready" for process in supervisor.processes.values()))


def has_ended(pid: int) -> bool:
    """Whether a process has ended; a zombie counts as ended."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


FAST_POLICY = RestartPolicy(first=0.05, longest=0.2, limit=3)
"""A policy that gives up quickly."""
