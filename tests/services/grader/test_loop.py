"""The grader on the bus: it ends when all have finished, at a time limit, or when stopped, and writes its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deploy.report.write import read_measurements
from messages.control import JointControllerState
from messages.gazebo import WorldStates
from messages.geometry import Point, Pose, Vector3
from messages.parameters import Parameter, ParameterValues
from messages.sensor import JointState
from messages.std import Header, Time
from messages.topics import (
    BASE_STATUS,
    CONTROL_STATE,
    GROUND_TRUTH,
    JOINT_STATES,
    ODOM,
    PLAN,
    STATUS,
    UPDATES,
    WORLD_MARKERS,
    WORLD_STATES,
    Topic,
)
from messages.visualization import Marker, MarkerArray
from services.grader import SERVICE, ArmSpec, GraderParameters, SizeSpec
from services.grader.measurement import MessageKind
from services.grader.records import ArmFigures, RobotFigures
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
    """Publish every message stamped up to ``until`` [s], then the clock."""
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


def test_the_clearance_from_bodies_that_stand_and_move_is_measured(
    tmp_path: Path, corner_messages: list[GradedEntry]
) -> None:
    """The robot drives from (0, 0) to (0.6, 0); a post stands beyond that, and a ball approaches."""
    size = Vector3(x=0.2, y=0.2, z=0.4)
    place = Pose(position=Point(x=1.0, z=0.2))
    post = Marker(ns="fixed", text="post", type=Marker.CYLINDER, pose=place, scale=size)
    ball = Marker(ns="moving", text="ball", type=Marker.SPHERE, scale=Vector3(x=0.2, y=0.2, z=0.2))
    unreadable = Marker(ns="fixed", text="cloud", type=8)
    params = GraderParameters(robots=("tb3_0",), sizes=(SizeSpec(name="tb3_0", radius=0.1),), output=str(tmp_path))
    with run_service(SERVICE, "/", params) as bench:
        bench.publish(WORLD_MARKERS, MarkerArray(markers=(post, ball, unreadable)))
        for step in range(30):
            place = Pose(position=Point(x=-0.5, y=2.0 - 0.01 * step, z=0.1))
            header = Header(stamp=Time.of(step * 100_000_000))
            bench.publish(WORLD_STATES, WorldStates(header=header, name=("ball",), pose=(place,)))
        play(bench, corner_messages, until=2.8)
    figures = read_measurements(tmp_path).robots["tb3_0"]
    assert isinstance(figures, RobotFigures)
    with np.load(tmp_path / "trajectories.npz") as arrays:
        trail = arrays["tb3_0.trail"]
        assert arrays["world.counts"].tolist() == [48, 48]
    nearest = trail[trail[:, 1].argmax()]
    assert figures.min_clearance_m == pytest.approx(1.0 - nearest[1] - 0.2, abs=1e-3)
    assert (figures.min_clearance_at_s, figures.min_clearance_to) == (pytest.approx(nearest[0]), "post")


def test_a_controllers_largest_effort_stays_as_changed_after_a_reset_of_time(tmp_path: Path) -> None:
    arm = ArmSpec(name="arm", joint="j", saturation=200.0)
    with run_service(SERVICE, "/", GraderParameters(robots=("arm",), arms=(arm,), output=str(tmp_path))) as bench:
        bench.set_time(0.0)
        bench.publish(
            UPDATES.of("/robot_control"), ParameterValues(values=(Parameter(name="saturation", value=100.0),))
        )
        bench.set_time(1.0)
        bench.set_time(0.0, epoch=1)
        for step in range(11):
            header = Header(stamp=Time.of(step * 100_000_000))
            bench.publish(JOINT_STATES.of("arm"), JointState(header=header, name=("j",), position=(0.0,)))
            bench.publish(CONTROL_STATE, JointControllerState(header=header, command=100.0))
        bench.set_time(3.0, epoch=1)
    figures = read_measurements(tmp_path).robots["arm"]
    assert isinstance(figures, ArmFigures)
    assert (figures.samples, figures.saturated_s) == (11, pytest.approx(1.0))


def test_stopped_before_the_end_it_leaves_what_it_has(tmp_path: Path, corner_messages: list[GradedEntry]) -> None:
    with run_service(SERVICE, "/", GraderParameters(robots=("tb3_0",), output=str(tmp_path))) as bench:
        play(bench, corner_messages, until=4.0)
    measured = read_measurements(tmp_path)
    assert measured.ended == "stopped"
    assert (tmp_path / "trajectories.npz").exists()
