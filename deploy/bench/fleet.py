"""A fleet under test: started as by a user, observed by a node; and its idle cost."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from deploy.bench.figures import Figure
from deploy.bench.peer import bench_node
from messages.base import Message
from messages.topics import BASE_STATUS, GROUND_TRUTH, Topic
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import router_endpoint

WATCHED_ROBOT = "tb3_0"
"""The robot by which the benchmark follows a run."""
START_TIMEOUT_S = 60.0
"""Wall time for a fleet to begin to move."""


class BenchFleet:
    """Runs ``elea up NAME …`` in its own process, with results in ``folder``."""

    def __init__(self, name: str, folder: Path, port: int, *options: str) -> None:
        self._command = [sys.executable, "-P", "-m", "deploy", "up", name, "--report", str(folder), "--port", str(port)]
        self._command += ["--no-view", "--no-picture", "--no-saved", *options]
        self.endpoint = router_endpoint(port)
        self.folder = folder

    def __enter__(self) -> Self:
        self.started = time.perf_counter()
        self._process = subprocess.Popen(self._command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait(60)

    def finish(self) -> dict[str, Any]:
        """Wait for the end of the run; return its report."""
        self._process.wait(600)
        report: dict[str, Any] = json.loads((self.folder / "report.json").read_text())
        return report

    def services(self) -> dict[str, psutil.Process]:
        """Return the service processes by name."""
        state = json.loads((self.folder / "processes.json").read_text())
        return {each["name"]: psutil.Process(each["pid"]) for each in state["processes"] if each["pid"]}


class FleetWatcher:
    """Observes a running fleet by a single topic of 5 Hz, so as not to burden it."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._status = node.subscribe(BASE_STATUS, f"/{WATCHED_ROBOT}/base_status")
        self.now = 0.0

    def spin_once(self) -> None:
        """Wait for the next state of the robot's base."""
        self.node.wait(self._status.raw)
        self.node.update_subscribers()
        if self._status.messages:
            self.now = self._status.messages[-1][0].header.stamp.ns / 1e9

    def wait_until(self, seconds: float) -> float:
        """Wait until simulation time ``seconds``; return the wall-clock time."""
        while self.now < seconds:
            self.spin_once()
        return time.perf_counter()

    def wait_for_motion(self, within: float = START_TIMEOUT_S) -> float:
        """Wait until the robot moves; return the wall-clock time."""
        truth = self.node.subscribe(GROUND_TRUTH, f"/{WATCHED_ROBOT}/ground_truth")
        deadline = time.perf_counter() + within
        try:
            while time.perf_counter() < deadline:
                self.node.wait(truth.raw)
                self.node.update_subscribers()
                for seen, _ in truth.messages:
                    twist = seen.twist.twist
                    if abs(twist.linear.x) > 0.01 or abs(twist.angular.z) > 0.01:
                        return time.perf_counter()
        finally:
            self.node.unregister(truth)
        raise TimeoutError(f"no robot moved within {within} s")

    def record_commands(self, robots: Mapping[str, Topic[Message]], seconds: float) -> dict[str, list[Any]]:
        """Return the messages on each robot's topic until simulation time ``seconds``."""
        sources = {name: self.node.subscribe(topic, f"/{name}/{topic.name}") for name, topic in robots.items()}
        received: dict[str, list[Any]] = {name: [] for name in robots}
        while self.now < seconds:
            self.spin_once()
            for name, source in sources.items():
                received[name] += [command for command, _ in source.messages]
        return received


@contextmanager
def watch_fleet(fleet: BenchFleet) -> Iterator[FleetWatcher]:
    """Join the fleet's network as a node."""
    with bench_node(fleet.endpoint) as node:
        yield FleetWatcher(node)


IDLE_FLEET = "bare"
"""Robots that stand still."""
FROM_S, TO_S = 3.0, 8.0
"""The span of simulation time, here also of wall time, over which CPU is counted."""


def measure_idle(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Measure the fleet IDLE_FLEET in real time."""
    cpu: dict[str, list[float]] = {}
    memory: dict[str, list[float]] = {}
    for number in range(rounds):
        say(f"idle, round {number + 1} of {rounds}")
        with (
            tempfile.TemporaryDirectory() as folder,
            BenchFleet(IDLE_FLEET, Path(folder) / "run", port, "--mode", "real") as fleet,
            watch_fleet(fleet) as watch,
        ):
            watch.wait_until(FROM_S)
            services = fleet.services()
            before = {name: sum(process.cpu_times()[:2]) for name, process in services.items()}
            begun = time.perf_counter()
            watch.wait_until(TO_S)
            wall = time.perf_counter() - begun
            for name, process in services.items():
                used = sum(process.cpu_times()[:2]) - before[name]
                cpu.setdefault(name, []).append(100 * used / wall)
                memory.setdefault(name, []).append(process.memory_info().rss / 2**20)
    figures = []
    for name in cpu:
        figures.append(Figure(f"idle_cpu_{name}_percent", "%", f"of a core, {name} in real time", tuple(cpu[name])))
        figures.append(Figure(f"memory_{name}_mib", "MiB", f"resident, {name}", tuple(memory[name])))
    return figures
