"""Namespaces and frames of robots: the root namespace, frames without a prefix, and conflicts between robots."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from messages.elea import BaseStatus
from messages.geometry import Pose, Twist
from messages.nav import Odometry
from messages.requests import LIST_STOPS, MODEL_PROPERTIES, SPAWN, Name
from messages.sensor import Imu, LaserScan
from messages.simulation import SpawnModel
from messages.std import Bool, Empty
from messages.tf import TFMessage
from messages.topics import BASE_STATUS, CMD_VEL, E_STOP, GROUND_TRUTH, IMU, ODOM, SCAN, TF, TF_STATIC, Topic
from models.robot_source import resolve_robot
from services.runtime.errors import BadInput, CallFailed
from services.runtime.subscriber import Subscriber
from services.sim.parameters import RobotEntry
from services.sim.robot_names import check_robot_names, robot_frames
from tests.services.sim.joints.joint_simulation import JointSimulation, robot_entry, run_joint_simulation

TURTLEBOT = robot_entry("tb3", "burger", namespace="/", frame_prefix="")
_BAR = """<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.1 0.1 1"/></geometry></collision>"""
ARM = f"""<robot name="arm"><link name="world"/><link name="post">{_BAR}</link><link name="bar">{_BAR}</link>
  <joint name="stand" type="fixed"><parent link="world"/><child link="post"/><origin xyz="0 0 0.5"/></joint>
  <joint name="turn" type="revolute"><parent link="post"/><child link="bar"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/></joint></robot>"""


def newest(world: JointSimulation, topic: Topic[Any], name: str, act: Any) -> Any:
    """Return the last message on the absolute topic ``name`` after running ``act``."""
    heard: Subscriber[Any] = world.subscribe(topic, name)
    act()
    heard.update()
    return heard.messages[-1][0]


def drive(world: JointSimulation, seconds: float, robot: str = "") -> None:
    for _ in range(round(seconds / 0.04)):
        world.publish(CMD_VEL, Twist.planar(0.2, 0.0), robot=robot)
        world.run(0.04)


def test_a_robot_in_the_root_namespace_with_plain_frames() -> None:
    with run_joint_simulation(TURTLEBOT, robot_entry("tb3_1", "burger", x=3.0)) as world:
        published = {each.name for each in world.node.publishers}
        assert {"/odom", "/ground_truth", "/scan", "/imu", "/joint_states", "/base_status"} <= published
        assert {"/tb3_1/odom", "/tb3_1/scan"} <= published
        assert not any(each.startswith("//") for each in published)

        sensors: dict[str, Any] = {}
        for topic, record in ((ODOM, Odometry), (GROUND_TRUTH, Odometry), (SCAN, LaserScan), (IMU, Imu)):
            sensors[topic.name] = newest(world, topic, f"/{topic.name}", lambda: drive(world, 0.48))
            assert isinstance(sensors[topic.name], record)
        assert (sensors["odom"].header.frame_id, sensors["odom"].child_frame_id) == ("odom", "base_footprint")
        assert sensors["scan"].header.frame_id == "base_scan"
        assert sensors["imu"].header.frame_id == "imu_link"
        assert sensors["ground_truth"].pose.pose.position.x > 0.15, "it obeys /cmd_vel"
        assert world.simulation.find("tb3_1").pose.position[0] == pytest.approx(3.0, abs=1e-3), "the other one does not"

        told = world.subscribe(TF_STATIC, TF_STATIC.name)
        moving = newest(world, TF, TF.name, lambda: world.run(0.2))
        assert isinstance(moving, TFMessage)
        world.simulation.publish_static_tf()
        told.update()
        frames = {each.child_frame_id for each in (*told.messages[-1][0].transforms, *moving.transforms)}
        assert {"odom", "base_footprint", "base_scan", "wheel_left_link"} <= frames
        assert {"tb3_1/odom", "tb3_1/base_footprint"} <= frames
        assert world.call(MODEL_PROPERTIES, Name(name="tb3")).namespace == "/"
        assert world.call(MODEL_PROPERTIES, Name(name="tb3")).base_frame == "base_footprint"


def test_the_stop_of_all_robots_is_that_of_the_robot_in_the_root_namespace() -> None:
    with run_joint_simulation(TURTLEBOT, robot_entry("tb3_1", "burger", x=3.0)) as world:
        drive(world, 0.5)
        world.publish(E_STOP, Bool(data=True), robot="")
        status = newest(world, BASE_STATUS, "/base_status", lambda: drive(world, 0.5))
        assert isinstance(status, BaseStatus)
        assert status.e_stopped
        held = world.call(LIST_STOPS, Empty()).stops
        assert [(each.robot, each.topic) for each in held] == [("", "/e_stop")], "one stop, of all robots"
        world.publish(E_STOP, Bool(data=False), robot="")
        here = world.simulation.find("tb3").pose.position[0]
        drive(world, 0.5)
        assert world.simulation.find("tb3").pose.position[0] > here + 0.05
        assert not world.call(LIST_STOPS, Empty()).stops


def test_spawned_in_the_root_namespace_and_again() -> None:
    with run_joint_simulation(robot_entry("arm", x=-4.0)) as world:
        asked = SpawnModel(name="tb3", model="burger", namespace="/", frame_prefix="")
        world.call(SPAWN, asked)
        assert "/base" in {each.name.rpartition("/parameter")[0] for each in world.node.subscribers}
        refused = {
            "the namespace / is that of tb3": SpawnModel(
                name="b", model="burger", namespace="/", pose=Pose.planar(2, 0)
            ),
            "tb3 has the frame": SpawnModel(name="c", model="waffle", frame_prefix="", pose=Pose.planar(2, 0)),
            "already a robot 'tb3'": SpawnModel(name="tb3", model="burger", namespace="x"),
            "no leading slash": SpawnModel(name="d", model="burger", frame_prefix="/d/"),
            "a part does not start with a digit": SpawnModel(name="d", model="burger", frame_prefix="9/"),
            "parts are joined by a single": SpawnModel(name="d", model="burger", namespace="a//b"),
        }
        for why, request in refused.items():
            with pytest.raises(CallFailed, match=re.escape(why)):
                world.call(SPAWN, request)
        world.simulation.delete("tb3")
        world.call(SPAWN, asked)
        assert [robot.name for robot in world.simulation.robots] == ["arm", "tb3"]


def test_an_arm_that_stands_by_a_link_named_world(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    made = resolve_robot("arm.urdf", tmp_path).model
    arm, again = (RobotEntry(name=name, model=made, frame_prefix="") for name in ("a", "b"))
    check_robot_names(arm, [RobotEntry(name="one", model="burger", frame_prefix="")])
    with pytest.raises(BadInput, match="b: a has the frame bar already"):
        check_robot_names(again, [arm])
    with run_joint_simulation(robot_entry("a", arm.model, namespace="/", frame_prefix="")) as world:
        told = world.subscribe(TF_STATIC, TF_STATIC.name)
        world.simulation.publish_static_tf()
        told.update()
        frames = [(each.header.frame_id, each.child_frame_id) for each in told.messages[-1][0].transforms]
        assert frames == [("world", "post")]


def test_frames_that_robots_share() -> None:
    one = RobotEntry(name="one", model="burger", frame_prefix="")
    assert {"odom", "base_footprint", "base_scan"} <= robot_frames(one)
    assert {"two/odom", "two/base_scan"} <= robot_frames(RobotEntry(name="two", model="burger"))
    check_robot_names(RobotEntry(name="arm", model="arm", frame_prefix=""), [one])
    with pytest.raises(BadInput, match=r'frame_prefix, such as "p/"'):
        check_robot_names(RobotEntry(name="p", model="p3dx", frame_prefix=""), [one])
