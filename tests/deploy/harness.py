"""What the tests of the supervisor share: children as processes, a stage that runs them, and time limits."""

from __future__ import annotations

import asyncio
import re
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import psutil

from deploy.policy import Policy
from deploy.process import Process
from deploy.supervisor.child import Nursery
from deploy.supervisor.life import Life
from deploy.supervisor.supervisor import Outcome, Supervisor
from deploy.supervisor.warden import Warden
from messages.elea import FleetState
from tests.deploy.file_bus import FileBus


def child(script: str, node: str, *arguments: str, **options: Any) -> Process:
    """A faulty child as a process of a fleet."""
    argv = (sys.executable, "-P", "-m", f"tests.deploy.faulty.{script}", node, *arguments)
    return Process(name=node.strip("/"), node=node, kind=options.pop("kind", script), argv=argv, **options)


class Stage:
    """A run's folder, a warden and a bus; it witnesses every change of state."""

    def __init__(self, folder: Path, patience: Sequence[float] = (0.5, 0.5), grace: float = 20.0) -> None:
        (folder / "logs").mkdir(parents=True, exist_ok=True)
        self.folder, self.bus, self.warden = folder, FileBus(folder), Warden()
        self.nursery = Nursery(folder, self.warden)
        self.seen: list[tuple[float, str, str]] = []
        self.said: list[str] = []
        self._patience, self._grace = patience, grace

    def supervisor(self, *processes: Process) -> Supervisor:
        made = Supervisor(
            "test", "real", processes, self.bus, self.nursery, self, patience=self._patience, grace=self._grace
        )
        self.lives = made.lives
        return made

    def saw(self, life: Life, fleet: FleetState) -> None:
        self.seen.append((time.monotonic(), life.process.name, life.state))

    def noted(self, text: str) -> None:
        self.said.append(text)

    def turned(self, lives: Sequence[Life]) -> None:
        pass

    def say(self, line: str) -> None:
        """What a person is told, when this is the screen too."""
        self.said.append(line)

    def show(self, line: str) -> None:
        pass

    def states(self, name: str) -> list[str]:
        """The states that a process went through."""
        return [state for _, process, state in self.seen if process == name]

    def when(self, name: str, state: str, occurrence: int = 0) -> float:
        """When a process came to a state [s]."""
        return [at for at, process, reached in self.seen if (process, reached) == (name, state)][occurrence]

    def log(self, name: str) -> str:
        return (self.folder / "logs" / f"{name}.log").read_text()

    def run(self, script: Callable[[Supervisor], Any], *processes: Process) -> Outcome:
        """Run the processes with ``script``, a coroutine function that acts on the supervisor; then interrupt it."""

        async def both() -> Outcome:
            supervisor = self.supervisor(*processes)
            running = asyncio.create_task(supervisor.run())
            try:
                await asyncio.wait_for(script(supervisor), 30)
            finally:
                supervisor.interrupt()
                outcome = await asyncio.wait_for(running, 30)
            return outcome

        try:
            return asyncio.run(both())
        finally:
            self.warden.close()


async def until(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait for a condition; fail when it does not come."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        await asyncio.sleep(0.02)


async def all_ready(supervisor: Supervisor) -> None:
    """Wait until every process beats."""
    await until(lambda: all(life.state == "ready" for life in supervisor.lives.values()))


def gone(pid: int) -> bool:
    """Whether a process has ended; a zombie that nobody has reaped counts as ended."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def own_silence(log: str) -> float:
    """For how long the process that was killed last had been silent while it could have beaten [s]."""
    said = re.findall(r"no heartbeat for ([\d.]+) s(?:, ([\d.]+) s of them in wait for a processor)?", log)
    assert said, log
    silent, held_up = said[-1]
    return float(silent) - float(held_up or 0)


FAST = Policy(first=0.05, longest=0.2, limit=3)
"""A policy that gives up soon."""
