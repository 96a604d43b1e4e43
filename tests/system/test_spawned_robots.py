"""Robots spawned in a running simulation: their topics, sensors that work while subscribed, and their frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from messages.geometry import Pose, Twist
from messages.parameters import Assignment
from messages.requests import DELETE, SPAWN, Name
from messages.se3 import rotate
from messages.simulation import SpawnModel
from messages.std import String
from messages.tf import TFMessage
from messages.topics import (
    CAMERA_INFO,
    CMD_VEL,
    GROUND_TRUTH,
    IMAGE,
    IMU,
    JOINT_STATES,
    RANGE,
    ROBOT_DESCRIPTION,
    SCAN,
    SONAR,
    TF,
    TF_STATIC,
)
from models import urdf_path
from models.urdf import read_robot
from services.runtime.graph import snapshot
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, distance, time_of
from tests.harness.waiting import wait_until
from tests.system.tf_frames import Frame, frame_in_world, frame_of_pose, frames_by_name
from tests.system.two_robot_simulation import STARTS, TwoRobotSimulation, two_robot_simulation

PLACES = {"waffle": (2.0, 0.0), "waffle_pi": (2.0, 2.0), "p3dx": (2.0, -2.0)}
"""Spawn position (x, y) [m] of each new robot."""
REST_S = 1.0
"""Simulation time [s] within which a working sensor publishes: several periods of each."""
ALL = {"burger": {SCAN, IMU, JOINT_STATES}}
ALL["waffle"] = ALL["waffle_pi"] = ALL["burger"] | {IMAGE, CAMERA_INFO}
ALL["p3dx"] = {SCAN, SONAR, RANGE, JOINT_STATES}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    """A simulation with a waffle, a waffle_pi and a Pioneer in addition to its burgers."""
    with two_robot_simulation(tmp_path_factory.mktemp("spawned")) as made:
        for model, (x, y) in PLACES.items():
            exact = () if model == "p3dx" else (Assignment(name="odometry", value="world"),)
            asked = SpawnModel(name=model, model=model, pose=Pose.planar(x, y, 1.0), parameters=exact)
            state = made.call(SPAWN, asked)
            assert (state.name, state.model) == (model, model)
            assert state.pose.orientation.yaw == pytest.approx(1.0, abs=1e-9)
        yield made


@pytest.mark.parametrize("model", PLACES)
def test_the_topics_of_a_newcomer_appear(running: TwoRobotSimulation, model: str) -> None:
    def published() -> set[tuple[str, str]]:
        found = snapshot(running.node.transport)
        return {(each.name, each.record) for each in found if each.kind == "pub" and each.node == "/sim"}

    wanted = {(f"/{model}/{topic.name}", topic.record.ROS_TYPE) for topic in (*ALL[model], GROUND_TRUTH)}
    wait_until(lambda: published() >= wanted, WITHIN_S, f"the topics of {model}")
    stands = GroundTruthRecorder(running.node, model).wait_next()
    x, y = PLACES[model]
    assert stands.pose.pose.position.x == pytest.approx(x, abs=1e-3)
    assert stands.pose.pose.position.y == pytest.approx(y, abs=1e-3)
    assert stands.child_frame_id == f"{model}/base_footprint"


@pytest.mark.parametrize("model", PLACES)
def test_a_newcomer_drives(running: TwoRobotSimulation, model: str) -> None:
    truth, commands = GroundTruthRecorder(running.node, model), running.node.advertise(CMD_VEL, f"/{model}/cmd_vel")
    start = truth.wait_next()

    def moved() -> bool:
        commands.publish(Twist.planar(0.2, 0.0))
        return distance(start, truth.wait_next()) > 0.1

    wait_until(moved, WITHIN_S, f"a {model} that drives")
    truth.wait_until_still()


def test_sensors_work_while_somebody_looks(running: TwoRobotSimulation) -> None:
    sensors = {f"/{model}/{topic.name}": topic for model in PLACES for topic in ALL[model]}
    names = set(sensors)
    assert counts(running, names) == dict.fromkeys(names, 0)
    inputs: list[MessageRecorder[Any]] = [
        MessageRecorder(running.node.subscribe(topic, name)) for name, topic in sensors.items()
    ]
    for each in inputs:
        wait_until(lambda each=each: len(each.received()) > 2, WITHIN_S, f"messages on {each.source.name}")  # type: ignore[misc]
        frame, model = each.received()[-1].header.frame_id, each.source.name.split("/")[1]
        assert frame == "" if each.source.topic is JOINT_STATES else frame.startswith(f"{model}/"), each.source.name
    running.node.unregister(*(each.source for each in inputs))

    def rest() -> bool:
        before = counts(running, names)
        running.truth["tb3_0"].wait_after(REST_S)
        return counts(running, names) == before

    wait_until(rest, WITHIN_S, "sensors that rest")


def test_what_sensors_tell(running: TwoRobotSimulation) -> None:
    scan = MessageRecorder(running.node.subscribe(SCAN, "/tb3_0/scan")).wait_next()
    assert scan.header.frame_id == "tb3_0/base_scan"
    ranges = scan.ranges.tolist()
    assert len(ranges) == 360
    assert min(ranges) == pytest.approx(STARTS["tb3_1"] - 0.05, abs=0.06)
    assert 70 < ranges.index(min(ranges)) < 110
    imu = MessageRecorder(running.node.subscribe(IMU, "/tb3_0/imu")).wait_next()
    assert imu.linear_acceleration.z == pytest.approx(9.81, abs=0.15)
    image = MessageRecorder(running.node.subscribe(IMAGE, "/waffle_pi/camera/image")).wait_next()
    assert len(set(image.data)) > 1


@pytest.mark.parametrize("name", ["tb3_0", "waffle"])
def test_frames_compose_to_ground_truth(running: TwoRobotSimulation, name: str) -> None:
    commands = running.node.advertise(CMD_VEL, f"/{name}/cmd_vel")
    truth, moving, fixed = (
        GroundTruthRecorder(running.node, name),
        MessageRecorder(running.node.subscribe(TF)),
        running.tf_static,
    )
    wait_until(
        lambda: fixed.received() and f"{name}/base_scan" in frames_by_name(fixed.received()[-1]),
        WITHIN_S,
        "fixed frames",
    )
    moving.wait_next()
    start = truth.wait_next()

    def turned() -> bool:
        commands.publish(Twist.planar(0.1, 0.5))
        return distance(start, truth.wait_next()) > 0.1

    wait_until(turned, WITHIN_S, "a robot in a curve")
    last = truth.wait_after(0.1)
    still = frames_by_name(fixed.received()[-1])
    compared = 0
    for message in moving.received():
        now = frames_by_name(message)
        stamp = now[f"{name}/base_footprint"].stamp
        exact = [each for each in truth.received() if each.header.stamp.ns == stamp]
        if not exact:
            continue
        compared += 1
        frames = {**still, **now}
        close(frame_in_world(frames, f"{name}/base_footprint"), frame_of_pose(exact[0].pose.pose))
        scan_offset = read_robot(model_of(name)).link_offset("base_scan")
        offset = rotate(frame_of_pose(exact[0].pose.pose).rotation, scan_offset)
        place = frame_of_pose(exact[0].pose.pose).translation
        scan = frame_in_world(frames, f"{name}/base_scan")
        assert scan.translation == pytest.approx([a + b for a, b in zip(place, offset, strict=True)], abs=1e-9)
    assert compared > 20
    assert time_of(last) > time_of(start)
    assert all(child.partition("/")[0] in (*STARTS, *PLACES) for child in still)


def test_who_comes_late_gets_what_is_latched(running: TwoRobotSimulation) -> None:
    with running.network.node("late") as late:
        fixed: MessageRecorder[TFMessage] = MessageRecorder(late.subscribe(TF_STATIC))
        texts: dict[str, MessageRecorder[String]] = {
            name: MessageRecorder(late.subscribe(ROBOT_DESCRIPTION, f"/{name}/robot_description"))
            for name in (*STARTS, *PLACES)
        }
        wait_until(
            lambda: fixed.received() and all(each.received() for each in texts.values()),
            WITHIN_S,
            "what was said before",
        )
        for name, each in texts.items():
            assert each.received()[-1].data == urdf_path(model_of(name)).read_text()
        roots = {f"{name}/odom" for name in (*STARTS, *PLACES)}
        assert roots <= frames_by_name(fixed.received()[-1]).keys()


def test_frames_go_with_their_robot(running: TwoRobotSimulation) -> None:
    running.call(SPAWN, SpawnModel(name="guest", model="burger", pose=Pose.planar(-3.0, 0.0), namespace="visit/one"))
    fixed = running.tf_static
    wait_until(
        lambda: fixed.received() and "guest/odom" in frames_by_name(fixed.received()[-1]),
        WITHIN_S,
        "frames of the guest",
    )
    truth = MessageRecorder(running.node.subscribe(GROUND_TRUTH, "/visit/one/ground_truth"))
    assert truth.wait_next().child_frame_id == "guest/base_footprint"
    running.call(DELETE, Name(name="guest"))
    wait_until(lambda: "guest/odom" not in frames_by_name(fixed.received()[-1]), WITHIN_S, "no frames of the guest")


def counts(running: TwoRobotSimulation, names: set[str]) -> dict[str, int]:
    """Return the number of messages sent on each topic, from the simulation's health."""
    return {each.topic: each.sent for each in running.health("/sim").outputs if each.topic in names}


def model_of(name: str) -> str:
    """Return the model of a robot in this simulation."""
    return name if name in PLACES else "burger"


def close(one: Frame, other: Frame) -> None:
    """Assert that both frames have the same position and rotation."""
    assert one.translation == pytest.approx(other.translation, abs=1e-9)
    assert abs(sum(a * b for a, b in zip(one.rotation, other.rotation, strict=True))) == pytest.approx(1.0, abs=1e-12)
