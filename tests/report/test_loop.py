"""The grader on the bus: it ends when all have finished, at a time limit, or when stopped, and leaves its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from deploy.report.write import read_measurements
from messages.topics import BASE_STATUS, GROUND_TRUTH, ODOM, PLAN, STATUS, Topic
from services.grader import SERVICE, GraderParameters
from services.grader.measure import Kind
from tests.report.simulated import Post, judged, robot
from tests.unit_waypoint.bench import PATIENCE_S, Bench, running

TOPICS: dict[Kind, Topic[Any]] = {
    Kind.PLAN: PLAN,
    Kind.STATUS: STATUS,
    Kind.ODOMETRY: ODOM,
    Kind.TRUTH: GROUND_TRUTH,
    Kind.BASE: BASE_STATUS,
}


@pytest.fixture(scope="module")
def posts() -> list[Post]:
    return sorted(robot("tb3_0", 0.0), key=lambda post: post[2].header.stamp.ns)


def play(bench: Bench, posts: list[Post], until: float, epoch: int = 0) -> None:
    """Send everything stamped up to ``until`` [s], and then the clock."""
    bench.clock(0.0, epoch)
    for kind, name, message in posts:
        if message.header.stamp.ns <= until * 1e9:
            bench.send(TOPICS[kind], f"{name}/{TOPICS[kind].name}", message)
    bench.clock(until, epoch)


def ended(bench: Bench) -> bool:
    assert bench.loop is not None
    bench.loop.join(PATIENCE_S)
    return not bench.loop.is_alive()


def test_it_ends_when_all_have_finished(tmp_path: Path, posts: list[Post]) -> None:
    with running(SERVICE, "/", GraderParameters(robots=("/tb3_0",), output=str(tmp_path / "new"))) as bench:
        play(bench, posts, until=60.0)
        assert ended(bench)
    measured = read_measurements(tmp_path / "new")
    assert measured == judged(posts, ("tb3_0",), end=59.8).measurements("goals")
    assert measured.robots["tb3_0"].points_reached == 3


def test_it_ends_after_the_duration_and_counts_nothing_later(tmp_path: Path, posts: list[Post]) -> None:
    params = GraderParameters(robots=("tb3_0",), ends="duration", duration=3.0, output=str(tmp_path))
    with running(SERVICE, "/", params) as bench:
        play(bench, posts, until=60.0)
        assert ended(bench)
    measured = read_measurements(tmp_path)
    assert measured == judged(posts, ("tb3_0",), end=3.0).measurements("duration")
    assert measured.sim_seconds == 3.0


def test_stopped_before_the_end_it_leaves_what_it_has(tmp_path: Path, posts: list[Post]) -> None:
    with running(SERVICE, "/", GraderParameters(robots=("tb3_0",), output=str(tmp_path))) as bench:
        play(bench, posts, until=4.0)
    measured = read_measurements(tmp_path)
    assert measured.ended == "stopped"
    assert (tmp_path / "trajectories.npz").exists()
