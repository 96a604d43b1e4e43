"""Odometry over time: accuracy, rate, and setting its pose."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from messages.geometry import Twist
from messages.requests import RESET_WORLD, SET_DRIVE, SET_ODOMETRY
from messages.se3 import Pose3
from messages.simulation import DriveSettings, SetOdometry
from messages.std import Empty
from messages.topics import CMD_VEL, CMD_VEL_OUT, GROUND_TRUTH, ODOM, TF, TF_STATIC
from models.robot_source import resolve_robot
from services.runtime.errors import BadInput, CallFailed
from services.runtime.subscriber import Subscriber
from tests.models.sample_robots import write
from tests.models.test_robot_source import rolling
from tests.services.sim.drive.simulation_harness import NAME, SimulationHarness, base_parameters, run_simulation

HALF = math.pi / 8
ELSEWHERE = Pose3((3.0, -2.0, 0.0), (0.0, 0.0, math.sin(HALF), math.cos(HALF)))


def chained(world: SimulationHarness) -> tuple[float, float, float]:
    """Return the robot's pose in the world from ``/tf_static`` (world to odom) and odometry."""
    static = Subscriber(TF_STATIC, "/tf_static", "tf_static", world.node.transport)
    static.update()
    frames = {each.child_frame_id: each.transform for each in static.messages[-1][0].transforms}
    odom, pose = frames[f"{NAME}/odom"], world.latest(ODOM).pose.pose
    yaw = odom.rotation
    turn = math.atan2(2 * yaw.w * yaw.z, 1 - 2 * yaw.z**2)
    c, s = math.cos(turn), math.sin(turn)
    x = odom.translation.x + c * pose.position.x - s * pose.position.y
    y = odom.translation.y + s * pose.position.x + c * pose.position.y
    return x, y, turn + pose.orientation.yaw


def true(world: SimulationHarness) -> tuple[float, float, float]:
    pose = world.received(GROUND_TRUTH)[-1].pose.pose
    return pose.position.x, pose.position.y, pose.orientation.yaw


def same(one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
    apart = math.hypot(one[0] - other[0], one[1] - other[1])
    return apart < 1e-3 and abs(math.remainder(one[2] - other[2], math.tau)) < 1.8e-3


@pytest.mark.slow
def test_a_square_drifts_by_less_than_a_millimetre_and_a_tenth_of_a_degree() -> None:
    with run_simulation(at=ELSEWHERE) as world:
        for _ in range(4):
            world.drive(0.5, 0.0, 2.0)
            world.drive(0.0, 0.0, 2.0)
            world.drive(0.0, math.pi / 4, 2.0)
            world.drive(0.0, 0.0, 1.0)
        assert same(chained(world), true(world)), (chained(world), true(world))


def test_odometry_is_put_and_the_frames_still_chain() -> None:
    with run_simulation(at=ELSEWHERE) as world:
        world.drive(0.3, 0.4, 3.0)
        assert "(1 m, 2 m, -0.5 rad)" in world.call(SET_ODOMETRY, SetOdometry(name=NAME, x=1.0, y=2.0, yaw=-0.5)).text
        world.publish_state()
        world.drive(0.3, -0.4, 3.0)
        assert same(chained(world), true(world))
        world.call(SET_ODOMETRY, SetOdometry(name=NAME))
        world.run(2.0)
        assert world.latest(ODOM).pose.pose.position.x < 0.1, "it counts from zero"
        assert same(chained(world), true(world))
        world.call(RESET_WORLD, Empty())
        world.run(0.1)
        assert same(chained(world), true(world))
        assert same(true(world), (3.0, -2.0, math.pi / 4))


def test_the_true_pose_cannot_be_put() -> None:
    with (
        run_simulation("burger", odometry="world") as world,
        pytest.raises(CallFailed, match="true pose in the world, which cannot be set"),
    ):
        world.call(SET_ODOMETRY, SetOdometry(name=NAME, x=1.0))


def test_open_loop_integrates_the_limited_command() -> None:
    with run_simulation(open_loop=True) as world:
        world.drive(5.0, 0.0, 3.0)
        told = world.latest(ODOM)
        ideal = 0.75 * told.header.stamp.ns / 1e9 - 0.75**2 / (2 * 0.3)
        assert told.pose.pose.position.x == pytest.approx(ideal, abs=0.75 * 0.005)
        assert told.twist.twist.linear.x == 0.75
    with run_simulation("burger", open_loop=True) as world:
        world.drive(0.2, 0.5, 3.0)
        assert same(chained(world), true(world))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [50.0, 30.0, 7.0, 0.0])
def test_the_average_rate_is_exact(rate: float) -> None:
    with run_simulation(publish_rate=rate) as world:
        world.run(10.0)
        assert len(world.received(ODOM)) in ((0,) if rate == 0 else (10 * rate, 10 * rate + 1))
        assert len(world.received(GROUND_TRUTH)) == 500, "it does not depend on that"


def test_odometry_has_the_stamps_of_ground_truth_whenever_the_robot_came() -> None:
    with run_simulation("burger") as world:
        world.run(0.02)
        world.call(RESET_WORLD, Empty())
        world.run(1.0)
        told, real = ({each.header.stamp.ns for each in world.received(topic)} for topic in (ODOM, GROUND_TRUTH))
        assert told == real == set(range(0, 1_020_000_000, 40_000_000))


@pytest.mark.parametrize("rate", [20, 25, 30, 40, 50])
def test_ground_truth_has_the_rate_of_an_imported_robot(tmp_path: Path, rate: int) -> None:
    plugin = (
        '<gazebo><plugin name="drive" filename="libgazebo_ros_diff_drive.so"><left_joint>left_joint</left_joint>'
        f"<right_joint>right_joint</right_joint><update_rate>{rate}</update_rate></plugin></gazebo></robot>"
    )
    path = write(tmp_path / "rover.urdf", rolling().replace("</robot>", plugin))
    with run_simulation(resolve_robot(str(path), tmp_path).model) as world:
        world.run(1.0)
        told, real = ([each.header.stamp.ns for each in world.received(topic)] for topic in (ODOM, GROUND_TRUTH))
    assert told == real
    assert len(real) == rate


def test_covariances_are_copied_and_may_be_whole_numbers() -> None:
    diagonal = [1, 2, 3.5, 4, 5, 6]
    for model in ("p3dx", "burger"):
        with run_simulation(
            model, pose_covariance_diagonal=diagonal, twist_covariance_diagonal=[0, 0, 0, 0, 0, 1]
        ) as world:
            world.run(0.1)
            odometry = world.latest(ODOM)
            assert odometry.pose.covariance[::7] == tuple(diagonal)
            assert sum(odometry.pose.covariance) == sum(diagonal)
            assert odometry.twist.covariance[::7] == (0, 0, 0, 0, 0, 1)


def test_live_parameters_change_together() -> None:
    with run_simulation() as world:
        world.drive(0.2, 0.5, 2.0)
        told = world.call(SET_DRIVE, DriveSettings(name=NAME, wheel_separation_multiplier=1.2, publish_rate=10.0))
        assert told == DriveSettings(
            name=NAME,
            wheel_separation_multiplier=1.2,
            left_wheel_radius_multiplier=1.0,
            right_wheel_radius_multiplier=1.0,
            publish_rate=10.0,
            enable_odom_tf=True,
        )
        count = len(world.received(ODOM))
        world.drive(0.2, 0.5, 2.0)
        assert world.truth().twist.twist.angular.z == pytest.approx(0.5 * 1.2, rel=5e-3)
        assert len(world.received(ODOM)) - count in (20, 21)


def test_a_steady_base_takes_new_multipliers_at_once() -> None:
    with run_simulation(cmd_vel_timeout=0.0) as world:
        world.drive(0.2, 0.0, 1.5)
        world.call(
            SET_DRIVE, DriveSettings(name=NAME, left_wheel_radius_multiplier=0.5, right_wheel_radius_multiplier=0.5)
        )
        world.run(1.0)
        assert world.truth().twist.twist.linear.x == pytest.approx(0.4, rel=5e-3)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"wheel_separation_multiplier": 10.1}, r"<= 10\.0 - at `\$\.wheel_separation_multiplier`"),
        ({"left_wheel_radius_multiplier": 0.09}, r">= 0\.1 - at `\$\.left_wheel_radius_multiplier`"),
        ({"publish_rate": 51.0}, r"<= 50\.0 - at `\$\.publish_rate`"),
        ({"publish_rate": math.nan}, r"publish_rate"),
        ({"name": "p3dy"}, "unknown model 'p3dy'; did you mean 'p3dx'"),
    ],
)
def test_one_that_is_out_of_bounds_changes_none(asked: dict[str, object], says: str) -> None:
    with run_simulation() as world:
        before = world.base.live
        with pytest.raises(CallFailed, match=says):
            world.call(SET_DRIVE, DriveSettings(**{"name": NAME, "right_wheel_radius_multiplier": 1.1, **asked}))  # type: ignore[arg-type]
        assert world.base.live == before


def test_the_transform_of_odometry_can_be_switched_off() -> None:
    with run_simulation() as world:
        frames = Subscriber(TF, "/tf", "tf", world.node.transport)
        children = []
        for enabled in (True, False):
            world.call(SET_DRIVE, DriveSettings(name=NAME, enable_odom_tf=enabled))
            world.run(0.2)
            frames.update()
            children.append({each.child_frame_id for each in frames.messages[-1][0].transforms})
        assert children[0] - children[1] == {f"{NAME}/base_footprint"}


def test_frames_and_topics_are_those_of_a_configured_controller() -> None:
    """As given by ``odom_frame_id``, ``base_frame_id`` and a ``diff_drive_controller``'s name, after the prefix."""

    def tree(world: SimulationHarness) -> dict[str, str]:
        """Return the parent of each frame."""
        found = {}
        for topic, name in ((TF_STATIC, "tf_static"), (TF, "tf")):
            frames = Subscriber(topic, f"/{name}", name, world.node.transport, latched=True)
            world.run(0.1)
            frames.update()
            found |= {each.child_frame_id: each.header.frame_id for each in frames.messages[-1][0].transforms}
        return found

    cases = (
        ({}, "odom", "base_footprint", {}),
        ({"odom_frame_id": "/wheel_odom", "base_frame_id": f"{NAME}/base_link"}, "wheel_odom", "base_link", {}),
        (
            {"base_frame_id": "vehicle/centre"},
            "odom",
            "vehicle/centre",
            {"vehicle/centre": "odom", "base_footprint": "vehicle/centre"},
        ),
    )
    for stated, odom, child, parents in cases:
        with run_simulation(**stated) as world:
            told = tree(world)
            world.run(0.1)
            odometry = world.latest(ODOM)
            assert (odometry.header.frame_id, odometry.child_frame_id) == (f"{NAME}/{odom}", f"{NAME}/{child}")
            assert world.truth().child_frame_id == f"{NAME}/base_footprint"
            expected = {odom: "world", "base_footprint": odom, "base_link": "base_footprint"} | parents
            for frame, parent in expected.items():
                assert told[f"{NAME}/{frame}"] == (parent if parent == "world" else f"{NAME}/{parent}")
    with run_simulation(controller="diff", publish_cmd=True) as world:
        topics = {topic: replace(topic, name=f"diff/{topic.name}") for topic in (CMD_VEL, CMD_VEL_OUT, ODOM)}
        for topic in (topics[ODOM], topics[CMD_VEL_OUT]):
            world.subscribe(topic)
        for _ in range(25):
            world.publish(topics[CMD_VEL], Twist.planar(0.2, 0.0))
            world.run(0.04)
        assert world.latest(topics[ODOM]) == world.latest(ODOM)
        assert world.latest(ODOM).pose.pose.position.x > 0.1
        assert world.latest(topics[CMD_VEL_OUT]).twist.linear.x == 0.2
    for wrong in ("", "odom frame", "9odom", "a//b", "odom\n"):
        with pytest.raises(BadInput):
            base_parameters(odom_frame_id=wrong)
