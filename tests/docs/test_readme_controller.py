"""The controller in README.md, unchanged, drives a simulated robot as README.md states."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import hypot
from pathlib import Path

from messages.nav import Odometry
from messages.topics import GROUND_TRUTH
from services.runtime.subscriber import Subscriber
from tests.docs.readme import blocks, section
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until

SECTION = section("A controller of your own")
FACTOR, SLOW_FACTOR = 4, 0.5
"""Real-time factors: to save wall time, and for a robot that is not at its goal before a busy test ends what drives it.
"""
WITHIN_S = 60.0
"""Wall time limit for a drive of 1.4 m at 0.2 m/s on a busy machine."""


class RobotMonitor:
    """A robot's ground truth, sample by sample."""

    def __init__(self, source: Subscriber[Odometry]) -> None:
        self._source = source
        self.samples: list[Odometry] = []
        self.sent = 0

    def look(self) -> list[Odometry]:
        """Return all samples so far; ``sent`` is when the last was sent [ns, machine's clock]."""
        self._source.update()
        self.samples += [message for message, _ in self._source.messages]
        self.sent = max([self.sent, *(origin.source_ns for _, origin in self._source.messages if origin)])
        return self.samples

    @property
    def away(self) -> float:
        """Distance from (1, 1) [m]."""
        at = self.look()[-1].pose.pose.position
        return hypot(1 - at.x, 1 - at.y)

    @property
    def speed(self) -> float:
        """Speed over ground [m/s]."""
        return abs(self.look()[-1].twist.twist.linear.x)

    @property
    def seconds(self) -> float:
        """Simulation time [s]."""
        return self.look()[-1].header.stamp.ns / 1e9


def controller(folder: Path) -> Path:
    """Write the README's program to a file with the name that the README gives it."""
    [program] = blocks("python", SECTION)
    assert "`my_controller.py`" in SECTION
    file = folder / "my_controller.py"
    file.write_text(program)
    return file


def start(network: Network, folder: Path) -> Process:
    """Start the controller with the README's command."""
    [command] = re.findall(r"^\./elea run (.*)$", SECTION, re.MULTILINE)
    name, *arguments = command.split()
    file = controller(folder)
    assert (name, arguments) == (file.name, ["--namespace", "tb3_0"])
    return network.run(file, *arguments)


@contextmanager
def two_robots(folder: Path, factor: float) -> Iterator[tuple[Network, RobotMonitor, RobotMonitor]]:
    """Run the robot that the README's command drives, and one beside it."""
    robots = [{"name": "tb3_0", "model": "burger", "yaw": 1.57}, {"name": "tb3_1", "model": "burger", "y": 0.5}]
    settings = ("--param", f"robots={json.dumps(robots)}", "--param", "mode=real", "--param", f"factor={factor}")
    with Network(folder) as network, network.node() as node:
        driven = RobotMonitor(node.subscribe(GROUND_TRUTH, "/tb3_0/ground_truth"))
        beside = RobotMonitor(node.subscribe(GROUND_TRUTH, "/tb3_1/ground_truth"))
        network.start("sim", *settings)
        wait_until(lambda: driven.look() and beside.look(), 30.0, "ground truth of both robots")
        assert driven.away > 1.4
        yield network, driven, beside


def test_the_robot_stops_without_it(tmp_path: Path) -> None:
    with two_robots(tmp_path, SLOW_FACTOR) as (network, driven, _):
        first = start(network, tmp_path)
        wait_until(lambda: driven.speed > 0.1, WITHIN_S, "a robot on its way")
        assert first.stop() == 0
        ended = time.time_ns()
        wait_until(lambda: driven.look() and driven.sent > ended, WITHIN_S, "a sample sent after its end")
        left = driven.seconds
        wait_until(lambda: driven.speed < 0.001, WITHIN_S, "a robot that stands, left alone")
        wait_until(lambda: driven.seconds > left + 1, WITHIN_S, "a second more of simulation time")
        assert (
            max(each.twist.twist.linear.x for each in driven.look() if each.header.stamp.ns / 1e9 > left + 0.6) < 0.001
        )
        assert driven.away > 0.3


def test_it_drives_to_the_point(tmp_path: Path) -> None:
    with two_robots(tmp_path, FACTOR) as (network, driven, beside), start(network, tmp_path) as process:
        wait_until(lambda: driven.away < 0.05 and driven.speed < 0.001, WITHIN_S, "a robot that stands at its goal")
        there = driven.seconds
        wait_until(lambda: driven.seconds > there + 2, WITHIN_S, "two seconds more of simulation time")
        assert driven.away < 0.05
        assert process.status is None, process.text
        assert process.stop() == 0
        assert all(each.twist.twist.linear.x < 0.001 for each in beside.look())


def test_it_is_as_short_as_promised(tmp_path: Path) -> None:
    lines = [line for line in controller(tmp_path).read_text().splitlines() if line.strip()]
    assert len(lines) <= 15


def test_its_test_passes_and_fails_with_another_controller(tmp_path: Path) -> None:
    text = section("Test it")
    ([program], [command]) = blocks("python", text), blocks("sh", text)
    file = tmp_path / "test_my_controller.py"
    assert (command, f"`{file.name}`" in text) == ("./elea test test_my_controller.py\n", True)
    file.write_text(program)
    source = controller(tmp_path)
    with Process(["-m", "deploy", "test", file.name], tmp_path / "passes.log") as good:
        assert good.wait(180) == 0, good.text
        assert "1 passed" in good.text
    source.write_text(source.read_text().replace("odom.fresh(0.5)", "odom.value"))
    with Process(["-m", "deploy", "test", str(file)], tmp_path / "fails.log") as bad:
        assert bad.wait(180) == 1, bad.text
        assert "1 failed" in bad.text
