"""Gazebo's services and topics under their original names: semantics, spawned models, and rejected requests."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from messages import gazebo_msgs as gz
from messages.gazebo_services import (
    APPLY_BODY_WRENCH,
    APPLY_JOINT_EFFORT,
    CLEAR_BODY_WRENCHES,
    CLEAR_JOINT_FORCES,
    DELETE_MODEL,
    GET_JOINT_PROPERTIES,
    GET_LINK_PROPERTIES,
    GET_LINK_STATE,
    GET_MODEL_PROPERTIES,
    GET_MODEL_STATE,
    GET_PHYSICS_PROPERTIES,
    GET_WORLD_PROPERTIES,
    PAUSE_PHYSICS,
    RESET_SIMULATION,
    RESET_WORLD,
    SET_LINK_STATE,
    SET_MODEL_CONFIGURATION,
    SET_MODEL_STATE,
    SET_PHYSICS_PROPERTIES,
    SPAWN_SDF_MODEL,
    SPAWN_URDF_MODEL,
    UNPAUSE_PHYSICS,
)
from messages.geometry import Point, Pose, Quaternion, Twist, Vector3, Wrench
from messages.se3 import Pose3
from messages.std import Duration
from messages.std_srvs import Empty as EmptyService
from messages.topics import IMU, ODOM
from messages.topics import SET_LINK_STATE as SET_LINK_STATE_TOPIC
from messages.topics import SET_MODEL_STATE as SET_MODEL_STATE_TOPIC
from models.bodies import BoxShape
from models.mesh import write_stl
from models.shape_mesh import shape_mesh
from services.runtime.errors import CallFailed
from services.runtime.requests import call
from services.runtime.transport.memory import MemoryTransport
from tests import models
from tests.harness.waiting import wait_until
from tests.services.sim.joints.joint_simulation import JointSimulation, robot_entry, run_joint_simulation

NO_TURN = Quaternion(w=0.0)
"""The orientation of a ROS 1 message in which it wasn't set."""
COURIER = (Path(models.__file__).parent / "robots/courier.urdf").read_text()
"""A robot with a differential drive, a laser and an IMU, whose topics have names of their own."""
BOX = """<?xml version="1.0"?>
<sdf version="1.6"><model name="box">{static}
  <link name="link"><pose>0 0 0.25 0 0 0</pose>
    <inertial><mass>2.0</mass></inertial>
    <collision name="c"><geometry><box><size>0.5 0.5 0.5</size></box></geometry></collision>
    <visual name="v"><geometry><box><size>0.5 0.5 0.5</size></box></geometry></visual>
  </link>
</model></sdf>"""


def at(x: float, y: float, z: float = 0.0) -> Pose:
    """Return a position with ROS 1's unset orientation."""
    return Pose(position=Point(x=x, y=y, z=z), orientation=NO_TURN)


def place(on: JointSimulation, model: str, **more: Any) -> tuple[float, float, float]:
    found = on.call(GET_MODEL_STATE, gz.GetModelState(model_name=model, **more))
    assert found.success, found.status_message
    return found.pose.position.x, found.pose.position.y, found.pose.position.z


def test_models_are_seen_and_moved_in_the_axes_of_a_frame() -> None:
    """A model's twist is in the world's axes; an orientation of zeros means identity."""
    with run_joint_simulation(robot_entry("tb3", "burger"), robot_entry("other", "burger", x=2.0)) as on:
        west = Pose3.planar(1.0, 1.0, math.pi / 2).to_msg()
        command = gz.ModelState(model_name="tb3", pose=west, twist=Twist.planar(0.2, 0.0))
        assert on.call(SET_MODEL_STATE, gz.SetModelState(model_state=command)).success
        found = on.call(GET_MODEL_STATE, gz.GetModelState(model_name="tb3", relative_entity_name="world"))
        assert found.success
        assert found.header.frame_id == "world"
        assert (found.pose.position.x, found.pose.position.y) == pytest.approx((1.0, 1.0))
        assert (found.twist.linear.x, found.twist.linear.y) == pytest.approx((0.2, 0.0), abs=1e-6)
        assert place(on, "other", relative_entity_name="tb3")[:2] == pytest.approx((-1.0, -1.0))
        assert place(on, "ground_plane") == (0, 0, 0)
        ahead = gz.ModelState(model_name="other", pose=at(1.0, 0.0), reference_frame="tb3::base_footprint")
        assert on.call(SET_MODEL_STATE, gz.SetModelState(model_state=ahead)).success
        assert place(on, "other")[:2] == pytest.approx((1.0, 2.0))
        link = on.call(GET_LINK_STATE, gz.GetLinkState(link_name="other::base_link", reference_frame="other"))
        assert link.success
        assert link.link_state.link_name == "other::base_link"
        assert link.link_state.pose.position.z == pytest.approx(0.01, abs=1e-4)
        root = gz.LinkState(link_name="other::base_footprint", pose=at(3.0, 3.0))
        assert on.call(SET_LINK_STATE, gz.SetLinkState(link_state=root)).success
        assert place(on, "other")[:2] == pytest.approx((3.0, 3.0))
        for answer, text in (
            (on.call(GET_MODEL_STATE, gz.GetModelState(model_name="tb4")), "did you mean 'tb3'"),
            (on.call(GET_MODEL_STATE, gz.GetModelState(model_name="tb3", relative_entity_name="x")), "unknown"),
            (on.call(GET_LINK_STATE, gz.GetLinkState(link_name="base_link")), "2 models have a link 'base_link'"),
            (
                on.call(
                    SET_LINK_STATE,
                    gz.SetLinkState(link_state=gz.LinkState(link_name="tb3::wheel_left_link")),
                ),
                "only the root link base_footprint of tb3 can be moved",
            ),
        ):
            assert not answer.success
            assert text in answer.status_message


def test_the_topics_move_models_and_the_newest_command_counts() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger")) as on:
        for x in (1.0, 2.0):
            on.publish(SET_MODEL_STATE_TOPIC, gz.ModelState(model_name="tb3", pose=at(x, 0.0)), robot="")
        on.publish(SET_MODEL_STATE_TOPIC, gz.ModelState(model_name="nobody"), robot="")
        on.run(0.02)
        assert place(on, "tb3")[0] == pytest.approx(2.0, abs=1e-3)
        assert "a command to move a model is rejected: unknown model 'nobody'" in on.log
        on.publish(SET_LINK_STATE_TOPIC, gz.LinkState(link_name="tb3", pose=at(0.0, 1.0)), robot="")
        on.run(0.02)
        assert place(on, "tb3")[1] == pytest.approx(1.0, abs=1e-3)


def test_an_arm_is_driven_as_by_its_controller() -> None:
    """Efforts on a joint named without its model, joint states, and setting of joint positions."""
    with run_joint_simulation() as on:
        ends = Duration.of(100_000_000)
        effort = gz.ApplyJointEffort(joint_name="bear_link", effort=5.0, duration=ends)
        assert on.call(APPLY_JOINT_EFFORT, effort).success
        on.run(0.1)
        joint = on.call(GET_JOINT_PROPERTIES, gz.GetJointProperties(joint_name="bear_link"))
        assert joint.success
        assert (joint.type, len(joint.position), len(joint.damping)) == (0, 1, 1)
        assert abs(joint.rate[0]) > 0.05
        for_ever = gz.ApplyJointEffort(joint_name="arm::bear_link", effort=5.0, duration=Duration(sec=-1))
        assert "until it is cleared" in on.call(APPLY_JOINT_EFFORT, for_ever).status_message
        on.call(CLEAR_JOINT_FORCES, gz.JointRequest(joint_name="bear_link"))
        with pytest.raises(CallFailed, match="unknown joint 'bear'"):
            on.call(CLEAR_JOINT_FORCES, gz.JointRequest(joint_name="bear"))
        assert not on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="bear")).success
        wild = on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="bear_link", effort=1e9))
        assert "1e+06" in wild.status_message or "1000000" in wild.status_message
        on.run(0.005)
        put = gz.SetModelConfiguration(model_name="arm", joint_names=("bear_link",), joint_positions=(0.4,))
        assert on.call(SET_MODEL_CONFIGURATION, put).success
        position = on.call(GET_JOINT_PROPERTIES, gz.GetJointProperties(joint_name="bear_link")).position
        assert position == pytest.approx((0.4,))
        model = on.call(GET_MODEL_PROPERTIES, gz.GetModelProperties(model_name="arm"))
        assert model.success
        assert "bear_link" in model.joint_names
        assert model.is_static
        link = on.call(GET_LINK_PROPERTIES, gz.GetLinkProperties(link_name="arm::bear_link"))
        assert link.mass == pytest.approx(2.0)
        assert min(link.ixx, link.iyy, link.izz) > 0


def test_in_real_time_a_pushed_joint_is_seen_after_a_step() -> None:
    """A control loop that never waits gets a new state in each iteration."""
    with run_joint_simulation() as on:
        asked = gz.GetJointProperties(joint_name="bear_link")
        on.run(0.1)
        before = on.call(GET_JOINT_PROPERTIES, asked).rate[0]
        on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="bear_link", effort=50.0))
        with ThreadPoolExecutor(1) as pool:
            key = GET_JOINT_PROPERTIES.name.lstrip("/")
            waits = pool.submit(call, MemoryTransport(on.bus), GET_JOINT_PROPERTIES, key, asked, 60.0)
            wait_until(lambda: any(each.waiting for each in on.node.request_handlers))
            on.node.spin_once()
            assert not waits.done()
            on.run(0.005)
            assert abs(waits.result(60.0).rate[0] - before) > 1e-3
        on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="bear_link", effort=50.0))
        with ThreadPoolExecutor(1) as pool:
            waits = pool.submit(call, MemoryTransport(on.bus), GET_JOINT_PROPERTIES, key, asked, 60.0)
            wait_until(lambda: any(each.waiting for each in on.node.request_handlers))
            on.node.spin_once()
            assert not waits.done()
            on.call(PAUSE_PHYSICS, EmptyService())
            assert waits.result(60.0).success, "a pause answers it, too: no step comes"
        on.call(UNPAUSE_PHYSICS, EmptyService())
        on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="arm/bear_link", effort=50.0))
        unknown = on.call(GET_JOINT_PROPERTIES, gz.GetJointProperties(joint_name="nobody"))
        assert not unknown.success, "it is answered before the step"
        with ThreadPoolExecutor(1) as pool:
            wrong = gz.GetJointProperties(joint_name="arm::nobody")
            waits = pool.submit(call, MemoryTransport(on.bus), GET_JOINT_PROPERTIES, key, wrong, 60.0)
            wait_until(lambda: any(each.waiting for each in on.node.request_handlers))
            on.node.spin_once()
            on.run(0.005)
            assert "arm: unknown joint 'nobody'" in waits.result(60.0).status_message
        on.call(APPLY_JOINT_EFFORT, gz.ApplyJointEffort(joint_name="bear_link", effort=50.0))
        on.call(PAUSE_PHYSICS, EmptyService())
        assert on.call(GET_JOINT_PROPERTIES, asked).success


def test_boxes_come_fall_are_pushed_and_go() -> None:
    """Boxes from SDF text: a dynamic one falls and comes to rest, a static one stays and moves only on request."""
    with run_joint_simulation(robot_entry("tb3", "burger")) as on:

        def spawn(name: str, static: str = "", **more: Any) -> Any:
            text = BOX.format(static=static)
            return on.call(SPAWN_SDF_MODEL, gz.SpawnModel(model_name=name, model_xml=text, **more))

        made = spawn("free", initial_pose=at(2.0, 0.0, 0.3))
        assert made.success, made.status_message
        made = spawn("fixed", "<static>true</static>", initial_pose=at(0.0, 2.0, 1.0), reference_frame="tb3")
        assert made.success, made.status_message
        on.run(1.0)
        assert place(on, "free") == pytest.approx((2.0, 0.0, 0.0), abs=5e-3)
        assert place(on, "fixed") == pytest.approx((0.0, 2.0, 1.0), abs=5e-3)
        names = on.call(GET_WORLD_PROPERTIES, gz.GetWorldProperties()).model_names
        assert names == ("ground_plane", "crate", "tb3", "free", "fixed")
        link = on.call(GET_LINK_PROPERTIES, gz.GetLinkProperties(link_name="free::link"))
        assert link.mass == pytest.approx(2.0)
        assert link.com.position.z == pytest.approx(0.25)
        assert (link.ixx, link.ixy) == pytest.approx((2.0 * 0.5 / 12, 0.0), abs=1e-6)
        push = gz.ApplyBodyWrench(
            body_name="free::link", wrench=Wrench(force=Vector3(x=40.0)), duration=Duration(nanosec=200_000_000)
        )
        assert on.call(APPLY_BODY_WRENCH, push).success
        on.run(0.2)
        assert place(on, "free")[0] > 2.1
        on.call(CLEAR_BODY_WRENCHES, gz.BodyRequest(body_name="free::link"))
        lifted = gz.ModelState(model_name="fixed", pose=at(0.0, -2.0, 0.5), twist=Twist.planar(1.0, 0.0))
        assert on.call(SET_MODEL_STATE, gz.SetModelState(model_state=lifted)).success
        assert place(on, "fixed") == pytest.approx((0.0, -2.0, 0.5))
        assert "already a robot 'free'" in spawn("free", initial_pose=at(5.0, 5.0)).status_message
        assert on.call(DELETE_MODEL, gz.DeleteModel(model_name="free")).success
        assert not on.call(DELETE_MODEL, gz.DeleteModel(model_name="free")).success
        stays = on.call(DELETE_MODEL, gz.DeleteModel(model_name="ground_plane"))
        assert "part of the world and cannot be deleted" in stays.status_message
        assert spawn("free", initial_pose=at(2.0, 0.0, 0.3)).success


def test_robots_come_by_the_text_of_their_description() -> None:
    """A known robot name gives Elea's model; the first robot that drives gets Gazebo's topics."""
    with run_joint_simulation(robot_entry("arm", "arm", y=5.0)) as on:
        text = '<?xml version="1.0"?><robot name="turtlebot3_burger" xmlns:xacro="http://ros.org/wiki/xacro"/>'
        made = on.call(SPAWN_URDF_MODEL, gz.SpawnModel(model_name="tb3", model_xml=text))
        assert made.success, made.status_message
        assert "Elea's own model burger" in made.status_message
        assert on.simulation.find("tb3").namespace == "/"
        assert on.simulation.find("tb3").entry.parameters.odometry == "world"
        second = gz.SpawnModel(model_name="two", model_xml=text, initial_pose=at(1.0, 0.0))
        assert on.call(SPAWN_URDF_MODEL, second).success
        assert on.simulation.find("two").namespace == "/two"
        named = gz.SpawnModel(model_name="three", model_xml=text, robot_namespace="tb3_2", initial_pose=at(2.0, 0.0))
        assert on.call(SPAWN_URDF_MODEL, named).success
        assert on.simulation.find("three").namespace == "/tb3_2"
        ball = (
            '<robot name="ball"><link name="b"><inertial><mass value="1"/>'
            '<inertia ixx="0.004" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>'
            '<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>'
        )
        made = on.call(
            SPAWN_URDF_MODEL, gz.SpawnModel(model_name="ball", model_xml=ball, initial_pose=at(3.0, 0.0, 0.5))
        )
        assert made.success, made.status_message
        on.run(0.6)
        assert place(on, "ball")[2] == pytest.approx(0.1, abs=2e-3)
        for name, xml, reason in (
            ("", ball, "model_name is empty"),
            ("x", "", "model_xml is empty"),
            ("x", "<robot name='x'><link", "line 1|not XML|:1:"),
            ("x", "<sdf version='1.6'><model name='m'/></sdf>", "no links"),
            (
                "x",
                "<sdf version='1.6'><model name='m'><link name='a'><collision name='c'><geometry><box><size>1 1"
                "</size></box></geometry></collision></link></model></sdf>",
                ":1",
            ),
        ):
            refused = on.call(SPAWN_SDF_MODEL, gz.SpawnModel(model_name=name, model_xml=xml))
            assert not refused.success
            assert any(each in refused.status_message for each in reason.split("|")), refused.status_message


def test_an_sdf_names_no_file_outside_the_folders(tmp_path: Path) -> None:
    """Models from the network may read meshes only in the fleet's folders; unsupported elements are logged."""
    text = (
        '<sdf version="1.6"><model name="m"><static>1</static><link name="l"><wheel/><collision name="c"><geometry>'
        "<mesh><uri>file://{}</uri></mesh></geometry></collision></link></model></sdf>"
    )
    secret, mine = tmp_path / "secret.stl", tmp_path / "mine"
    mine.mkdir()
    for file in (secret, mine / "box.stl"):
        write_stl(file, shape_mesh(BoxShape((0.2, 0.2, 0.2))))
    with run_joint_simulation(robot_entry("arm", "arm", y=5.0), folders=(str(mine),)) as on:
        asked = gz.SpawnModel(model_name="m", model_xml=text.format(secret), initial_pose=at(2.0, 0.0, 1.0))
        refused = on.call(SPAWN_SDF_MODEL, asked)
        assert not refused.success
        assert "secret.stl" in refused.status_message
        asked = gz.SpawnModel(model_name="m", model_xml=text.format(mine / "box.stl"), initial_pose=at(2.0, 0.0, 1.0))
        made = on.call(SPAWN_SDF_MODEL, asked)
        assert made.success, made.status_message
        assert "m: notes on its SDF: " in on.log
        assert "<wheel>" in on.log


def test_a_model_with_a_joint_swings() -> None:
    text = """<sdf version="1.5"><model name="pendulum">
      <link name="base"><inertial><mass>50</mass></inertial>
        <collision name="c"><pose>0 0 0.05 0 0 0</pose><geometry><box><size>1 1 0.1</size></box></geometry></collision>
      </link>
      <link name="rod"><pose>0 0.6 1 0 0 0</pose><inertial><pose>0 0.3 0 0 0 0</pose><mass>1</mass></inertial>
        <collision name="c"><pose>0 0.3 0 0 0 0</pose><geometry><sphere><radius>0.05</radius></sphere></geometry>
        </collision>
      </link>
      <joint name="hinge" type="revolute"><parent>base</parent><child>rod</child><axis><xyz>1 0 0</xyz></axis></joint>
    </model></sdf>"""
    with run_joint_simulation(robot_entry("arm", "arm", y=5.0)) as on:
        made = on.call(SPAWN_SDF_MODEL, gz.SpawnModel(model_name="swing", model_xml=text))
        assert made.success, made.status_message
        rod = on.call(GET_LINK_STATE, gz.GetLinkState(link_name="swing::rod")).link_state.pose.position
        assert (rod.x, rod.y, rod.z) == pytest.approx((0.0, 0.6, 1.0), abs=1e-3)
        on.run(0.3)
        hinge = on.call(GET_JOINT_PROPERTIES, gz.GetJointProperties(joint_name="swing::hinge"))
        assert hinge.type == 1
        assert hinge.position[0] < -0.3


def test_time_and_physics() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger")) as on:
        on.run(0.1)
        assert on.call(GET_WORLD_PROPERTIES, gz.GetWorldProperties()).sim_time == pytest.approx(0.1)
        on.call(PAUSE_PHYSICS, EmptyService())
        physics = on.call(GET_PHYSICS_PROPERTIES, gz.GetPhysicsProperties())
        assert (physics.success, physics.pause, physics.time_step) == (True, True, 0.005)
        assert physics.gravity.z == pytest.approx(-9.81)
        on.call(UNPAUSE_PHYSICS, EmptyService())
        assert not on.simulation.paused
        same = gz.SetPhysicsProperties(
            time_step=physics.time_step, max_update_rate=physics.max_update_rate, gravity=physics.gravity
        )
        assert on.call(SET_PHYSICS_PROPERTIES, same).success
        for wanted, text in (
            (gz.SetPhysicsProperties(time_step=0.001), "time_step is fixed at 0.005 s"),
            (gz.SetPhysicsProperties(gravity=Vector3(z=-1.6)), "gravity is fixed at"),
            (gz.SetPhysicsProperties(gravity=Vector3(z=-9.81), max_update_rate=7.0), "param set /sim factor"),
        ):
            refused = on.call(SET_PHYSICS_PROPERTIES, wanted)
            assert not refused.success
            assert text in refused.status_message
        on.call(SET_MODEL_STATE, gz.SetModelState(model_state=gz.ModelState(model_name="tb3", pose=at(1, 1))))
        on.call(RESET_WORLD, EmptyService())
        assert place(on, "tb3")[:2] == pytest.approx((0.0, 0.0), abs=1e-6)
        assert on.simulation.tick > 0
        on.call(RESET_SIMULATION, EmptyService())
        assert on.simulation.tick == 0


def courier(name: str = "r", *replacements: tuple[str, str], **more: Any) -> gz.SpawnModel:
    """Return the request for a courier in a namespace of its own, with changes of its URDF."""
    urdf = COURIER
    for old, new in replacements:
        assert old in urdf
        urdf = urdf.replace(old, new)
    return gz.SpawnModel(model_name=name, model_xml=urdf, robot_namespace=name, **more)


def test_each_topic_of_a_robot_has_one_publication_whatever_its_tags_say() -> None:
    """Names of other topics, and the same second name of two topics."""
    with run_joint_simulation(robot_entry("arm", "arm", y=5.0)) as on:
        odometry = on.subscribe(ODOM, "/r/odom")
        strange = courier("r", ("pose_truth", "odom"), ("imu/data", "data"), ("laser/scan", "data"))
        for _ in range(2):
            made = on.call(SPAWN_URDF_MODEL, strange)
            assert made.success, made.status_message
            topics = [(each.name, each.topic.name) for each in on.node.publishers]
            assert ("/r/data", IMU.name) in topics
            assert len(dict(topics)) == len(topics)
            on.run(0.3)
            gone = on.call(DELETE_MODEL, gz.DeleteModel(model_name="r"))
            assert gone.success, gone.status_message
            assert not [each.name for each in on.node.publishers if each.name.startswith("/r/")]
        odometry.update()
        assert {each.header.frame_id for each, _ in odometry.messages} == {"r/odom_wheels"}


def test_a_spawn_that_fails_late_leaves_nothing_behind() -> None:
    with run_joint_simulation(robot_entry("arm", "arm", y=5.0)) as on:

        def ends() -> tuple[list[str], list[str], tuple[str, ...]]:
            node = on.node
            return [e.name for e in node.publishers], [e.name for e in node.subscribers], on.simulation.world.names

        before = ends()
        refused = on.call(SPAWN_URDF_MODEL, courier("r", ("laser/scan", "s" * 245)))
        assert "a name has at most 247" in refused.status_message
        assert ends() == before
        made = on.call(SPAWN_URDF_MODEL, courier("r", ("laser/scan", "laser/1/scan")))
        assert made.success, made.status_message


def test_an_imported_robot_is_moved_onto_the_ground() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger")) as on:
        made = on.call(SPAWN_URDF_MODEL, courier("r", initial_pose=at(3.0, 0.0)))
        assert made.success, made.status_message
        height = place(on, "r")[2]
        assert height > 0.01

        def move(name: str, z: float) -> gz.SetModelStateResponse:
            state = gz.ModelState(model_name=name, pose=at(5.0, 2.0, z))
            return on.call(SET_MODEL_STATE, gz.SetModelState(model_state=state))

        moved = move("r", 0.0)
        assert moved.success, moved.status_message
        assert place(on, "r") == pytest.approx((5.0, 2.0, height), abs=1e-4)
        assert move("r", 0.5).success
        assert place(on, "r")[2] == pytest.approx(0.5)
        for name in ("r", "tb3"):
            assert "would overlap with the ground" in move(name, -0.05).status_message
