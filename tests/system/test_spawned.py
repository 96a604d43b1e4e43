"""Robots that enter a running simulation: their topics, sensors that work while somebody looks, and their frames."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from messages.geometry import Pose, Twist
from messages.requests import DELETE, SPAWN, Name
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
from models import model_path
from models.frames import link_offset
from services.runtime.graph import snapshot
from services.sim.physics.rotation import into_world
from tests.system.frames import Frame, chain, frames_of, of_pose
from tests.system.watched import WITHIN_S, Truth, Watched, apart, speed, time_of
from tests.system.world import STARTS, World, world
from tests.waiting import until

PLACES = {"waffle": (2.0, 0.0), "waffle_pi": (2.0, 2.0), "p3dx": (2.0, -2.0)}
"""Where each newcomer enters, x and y in m."""
ALL = {"burger": {SCAN, IMU, JOINT_STATES}}
ALL["waffle"] = ALL["waffle_pi"] = ALL["burger"] | {IMAGE, CAMERA_INFO}
ALL["p3dx"] = {SCAN, SONAR, RANGE, JOINT_STATES}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """A world with a waffle, a waffle_pi and a Pioneer beside its burgers."""
    with world(tmp_path_factory.mktemp("spawned")) as made:
        for model, (x, y) in PLACES.items():
            state = made.node.call(SPAWN, SpawnModel(name=model, model=model, pose=Pose.planar(x, y, 1.0)))
            assert (state.name, state.model) == (model, model)
            assert state.pose.orientation.yaw == pytest.approx(1.0, abs=1e-9)
        yield made


@pytest.mark.parametrize("model", PLACES)
def test_the_topics_of_a_newcomer_appear(running: World, model: str) -> None:
    def published() -> set[tuple[str, str]]:
        found = snapshot(running.node.transport)
        return {(each.name, each.record) for each in found if each.kind == "pub" and each.node == "/sim"}

    wanted = {(f"/{model}/{topic.name}", topic.record.ROS_TYPE) for topic in (*ALL[model], GROUND_TRUTH)}
    until(lambda: published() >= wanted, WITHIN_S, f"the topics of {model}")
    stands = Truth(running.node, model).next()
    x, y = PLACES[model]
    assert stands.pose.pose.position.x == pytest.approx(x, abs=1e-3)
    assert stands.pose.pose.position.y == pytest.approx(y, abs=1e-3)
    assert stands.child_frame_id == f"{model}/base_footprint"


@pytest.mark.parametrize("model", PLACES)
def test_a_newcomer_drives(running: World, model: str) -> None:
    truth, commands = Truth(running.node, model), running.node.write(CMD_VEL, f"/{model}/cmd_vel")
    start = truth.next()

    def moved() -> bool:
        commands.publish(Twist.planar(0.2, 0.0))
        return apart(start, truth.next()) > 0.1

    until(moved, WITHIN_S, f"a {model} that drives")
    assert abs(speed(truth.after(0.6))) < 1e-3


@pytest.mark.parametrize("model", PLACES)
def test_sensors_work_while_somebody_looks(running: World, model: str) -> None:
    names = {f"/{model}/{topic.name}" for topic in ALL[model]}
    assert counts(running, names) == dict.fromkeys(names, 0)
    inputs: list[Watched[Any]] = [Watched(running.node.read(topic, f"/{model}/{topic.name}")) for topic in ALL[model]]
    for each in inputs:
        until(lambda each=each: len(each.all()) > 2, WITHIN_S, f"messages on {each.source.name}")  # type: ignore[misc]
        frame = each.all()[-1].header.frame_id
        assert frame == "" if each.source.topic is JOINT_STATES else frame.startswith(f"{model}/")
    running.node.forget(*(each.source for each in inputs))
    until(lambda: counts(running, names) == counts(running, names), WITHIN_S, "sensors that rest")


def test_what_sensors_tell(running: World) -> None:
    scan = Watched(running.node.read(SCAN, "/tb3_0/scan")).next()
    assert scan.header.frame_id == "tb3_0/base_scan"
    ranges = scan.ranges.tolist()
    assert len(ranges) == 360
    assert min(ranges) == pytest.approx(STARTS["tb3_1"] - 0.05, abs=0.06)
    assert 70 < ranges.index(min(ranges)) < 110
    imu = Watched(running.node.read(IMU, "/tb3_0/imu")).next()
    assert imu.linear_acceleration.z == pytest.approx(9.81, abs=0.15)
    image = Watched(running.node.read(IMAGE, "/waffle_pi/camera/image")).next()
    assert len(set(image.data)) > 1


@pytest.mark.parametrize("name", ["tb3_0", "waffle"])
def test_frames_compose_to_ground_truth(running: World, name: str) -> None:
    commands = running.node.write(CMD_VEL, f"/{name}/cmd_vel")
    truth, moving, fixed = Truth(running.node, name), Watched(running.node.read(TF)), running.fixed
    until(lambda: fixed.all() and f"{name}/base_scan" in frames_of(fixed.all()[-1]), WITHIN_S, "fixed frames")
    start = truth.next()

    def turned() -> bool:
        commands.publish(Twist.planar(0.1, 0.5))
        return apart(start, truth.next()) > 0.1

    until(turned, WITHIN_S, "a robot in a curve")
    last = truth.after(0.1)
    still = frames_of(fixed.all()[-1])
    compared = 0
    for message in moving.all():
        now = frames_of(message)
        stamp = now[f"{name}/base_footprint"].stamp
        exact = [each for each in truth.all() if each.header.stamp.ns == stamp]
        if not exact:
            continue
        compared += 1
        frames = {**still, **now}
        close(chain(frames, f"{name}/base_footprint"), of_pose(exact[0].pose.pose))
        offset = into_world(of_pose(exact[0].pose.pose).turn, link_offset(model_of(name), "base_scan"))
        place = of_pose(exact[0].pose.pose).place
        scan = chain(frames, f"{name}/base_scan")
        assert scan.place == pytest.approx([a + b for a, b in zip(place, offset, strict=True)], abs=1e-9)
    assert compared > 20
    assert time_of(last) > time_of(start)
    assert all(child.partition("/")[0] in (*STARTS, *PLACES) for child in still)


def test_who_comes_late_gets_what_is_latched(running: World) -> None:
    with running.network.node("late") as late:
        fixed: Watched[TFMessage] = Watched(late.read(TF_STATIC))
        texts: dict[str, Watched[String]] = {
            name: Watched(late.read(ROBOT_DESCRIPTION, f"/{name}/robot_description")) for name in (*STARTS, *PLACES)
        }
        until(lambda: fixed.all() and all(each.all() for each in texts.values()), WITHIN_S, "what was said before")
        for name, each in texts.items():
            assert each.all()[-1].data == model_path(model_of(name)).read_text()
        roots = {f"{name}/odom" for name in (*STARTS, *PLACES)}
        assert roots <= frames_of(fixed.all()[-1]).keys()


def test_frames_go_with_their_robot(running: World) -> None:
    running.node.call(
        SPAWN, SpawnModel(name="guest", model="burger", pose=Pose.planar(-3.0, 0.0), namespace="visit/one")
    )
    fixed = running.fixed
    until(lambda: fixed.all() and "guest/odom" in frames_of(fixed.all()[-1]), WITHIN_S, "frames of the guest")
    truth = Watched(running.node.read(GROUND_TRUTH, "/visit/one/ground_truth"))
    assert truth.next().child_frame_id == "guest/base_footprint"
    running.node.call(DELETE, Name(name="guest"))
    until(lambda: "guest/odom" not in frames_of(fixed.all()[-1]), WITHIN_S, "no frames of the guest")


def counts(running: World, names: set[str]) -> dict[str, int]:
    """Messages sent on each topic, by the next heartbeat."""
    return {each.topic: each.sent for each in running.beat("/sim").outputs if each.topic in names}


def model_of(name: str) -> str:
    """The model of a robot in this world."""
    return name if name in PLACES else "burger"


def close(one: Frame, other: Frame) -> None:
    """Both are the same place and rotation."""
    assert one.place == pytest.approx(other.place, abs=1e-9)
    assert abs(sum(a * b for a, b in zip(one.turn, other.turn, strict=True))) == pytest.approx(1.0, abs=1e-12)
