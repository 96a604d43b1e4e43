"""A fleet under the bench: started by the command line as a user would, watched by a node of its network."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from deploy.bench.partner import watcher
from messages.base import Message
from messages.topics import BASE_STATUS, GROUND_TRUTH, Topic
from services.runtime.network.sockets import router_endpoint
from services.runtime.node import Node

WATCHED = "tb3_0"
"""The robot by which the bench follows a run."""
BEGIN_S = 20.0
"""Wall time in which a fleet must have begun to move."""


class Fleet:
    """``elea up NAME …`` in a process of its own, its results in ``folder``."""

    def __init__(self, name: str, folder: Path, port: int, *options: str) -> None:
        self._command = [sys.executable, "-P", "-m", "deploy", "up", name, "--report", str(folder), "--port", str(port)]
        self._command += ["--no-view", "--no-saved", *options]
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
        """Wait for the end of the run; its report."""
        self._process.wait(600)
        report: dict[str, Any] = json.loads((self.folder / "report.json").read_text())
        return report

    def services(self) -> dict[str, psutil.Process]:
        """The service processes by name."""
        state = json.loads((self.folder / "processes.json").read_text())
        return {each["name"]: psutil.Process(each["pid"]) for each in state["processes"] if each["pid"]}


class Watch:
    """What the bench sees of a running fleet. It listens to a message of 5 Hz only, so as not to weigh on the fleet."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._status = node.read(BASE_STATUS, f"/{WATCHED}/base_status")
        self.now = 0.0

    def turn(self) -> None:
        """Wait for the next state of the robot's base."""
        self.node.wait(self._status.inlet)
        self.node.admit()
        if self._status.batch:
            self.now = self._status.batch[-1][0].header.stamp.ns / 1e9

    def until(self, seconds: float) -> float:
        """Watch until simulation time ``seconds``; the wall-clock time then."""
        while self.now < seconds:
            self.turn()
        return time.perf_counter()

    def until_motion(self, within: float = BEGIN_S) -> float:
        """Watch until the robot moves; the wall-clock time then."""
        truth = self.node.read(GROUND_TRUTH, f"/{WATCHED}/ground_truth")
        deadline = time.perf_counter() + within
        try:
            while time.perf_counter() < deadline:
                self.node.wait(truth.inlet)
                self.node.admit()
                for seen, _ in truth.batch:
                    twist = seen.twist.twist
                    if abs(twist.linear.x) > 0.01 or abs(twist.angular.z) > 0.01:
                        return time.perf_counter()
        finally:
            self.node.forget(truth)
        raise TimeoutError(f"no robot moved within {within} s")

    def commands(self, robots: Mapping[str, Topic[Message]], seconds: float) -> dict[str, list[Any]]:
        """What each robot is told on a topic of its namespace until simulation time ``seconds``."""
        sources = {name: self.node.read(topic, f"/{name}/{topic.name}") for name, topic in robots.items()}
        heard: dict[str, list[Any]] = {name: [] for name in robots}
        while self.now < seconds:
            self.turn()
            for name, source in sources.items():
                heard[name] += [command for command, _ in source.batch]
        return heard


@contextmanager
def watched(fleet: Fleet) -> Iterator[Watch]:
    """A node in the fleet's network."""
    with watcher(fleet.endpoint) as node:
        yield Watch(node)
