"""The grader on the bus: it ends when all have finished, at a time limit, or when stopped, and leaves its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from deploy.report.write import read_measurements
from messages.topics import BASE_STATUS, GROUND_TRUTH, ODOM, PLAN, STATUS, Topic
from services.grader import SERVICE, GraderParameters
from services.grader.measurement import MessageKind
from services.runtime.testing import ServiceHarness, run_service
from tests.services.grader.simulated_run import GradedEntry, measure_all, robot_messages

TOPICS: dict[MessageKind, Topic[Any]] = {
    MessageKind.PLAN: PLAN,
    MessageKind.STATUS: STATUS,
    MessageKind.ODOMETRY: ODOM,
    MessageKind.TRUTH: GROUND_TRUTH,
    MessageKind.BASE: BASE_STATUS,
}


@pytest.fixture(scope="module")
def corner_messages() -> list[GradedEntry]:
    return sorted(robot_messages("tb3_0", 0.0), key=lambda post: post[2].header.stamp.ns)


def play(bench: ServiceHarness, corner_messages: list[GradedEntry], until: float, epoch: int = 0) -> None:
    """Send everything stamped up to ``until`` [s], and then the clock."""
    bench.set_time(0.0, epoch)
    for kind, name, message in corner_messages:
        if message.header.stamp.ns <= until * 1e9:
            bench.publish(TOPICS[kind].of(name), message)
    bench.set_time(until, epoch)


def test_it_ends_when_all_have_finished(tmp_path: Path, corner_messages: list[GradedEntry]) -> None:
    with run_service(SERVICE, "/", GraderParameters(robots=("/tb3_0",), output=str(tmp_path / "new"))) as bench:
        play(bench, corner_messages, until=60.0)
        bench.wait_end()
    measured = read_measurements(tmp_path / "new")
    assert measured == measure_all(corner_messages, ("tb3_0",), end=59.8).measurements("goals")
    assert measured.robots["tb3_0"].points_reached == 3


def test_it_ends_after_the_duration_and_counts_nothing_later(
    tmp_path: Path, corner_messages: list[GradedEntry]
) -> None:
    params = GraderParameters(robots=("tb3_0",), ends="duration", duration=3.0, output=str(tmp_path))
    with run_service(SERVICE, "/", params) as bench:
        play(bench, corner_messages, until=60.0)
        bench.wait_end()
    measured = read_measurements(tmp_path)
    assert measured == measure_all(corner_messages, ("tb3_0",), end=3.0).measurements("duration")
    assert measured.sim_seconds == 3.0


def test_stopped_before_the_end_it_leaves_what_it_has(tmp_path: Path, corner_messages: list[GradedEntry]) -> None:
    with run_service(SERVICE, "/", GraderParameters(robots=("tb3_0",), output=str(tmp_path))) as bench:
        play(bench, corner_messages, until=4.0)
    measured = read_measurements(tmp_path)
    assert measured.ended == "stopped"
    assert (tmp_path / "trajectories.npz").exists()
