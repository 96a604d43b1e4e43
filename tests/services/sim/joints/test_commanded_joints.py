"""A wheeled robot's other joints, in the whole simulation: they obey ``joint_command``, the wheels ``cmd_vel``."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import msgspec
import pytest

from messages.gazebo import SetConfiguration
from messages.geometry import Twist
from messages.joints import JointCommand, JointTarget
from messages.requests import APPLY_EFFORT, RESET, SET_CONFIGURATION
from messages.std import Bool, Empty, Header, Time
from messages.topics import CMD_VEL, E_STOP, JOINT_COMMAND, JOINT_FEEDBACK, JOINT_STATES
from models import model_config_path, urdf_path
from models.robot_source import resolve_robot
from services.runtime.errors import CallFailed
from tests.services.sim.joints.joint_simulation import (
    JointSimulation,
    effort_request,
    robot_entry,
    run_joint_simulation,
)

PAN_TILT = """
  <link name="pan"><inertial><mass value="0.1"/>
    <inertia ixx="0.0001" iyy="0.0001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tilt"><inertial><mass value="0.1"/>
    <inertia ixx="0.0001" iyy="0.0001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="pan_joint" type="continuous"><parent link="base_link"/><child link="pan"/>
    <origin xyz="0 0 0.2"/><axis xyz="0 0 1"/><limit effort="1" velocity="3"/></joint>
  <joint name="tilt_joint" type="revolute"><parent link="pan"/><child link="tilt"/>
    <origin xyz="0 0 0.05"/><axis xyz="0 1 0"/><limit lower="-0.5" upper="0.8" effort="1" velocity="3"/></joint>
</robot>"""


@pytest.fixture
def model(tmp_path: Path) -> str:
    """A burger with a pan-tilt unit, as a user's folder."""
    text = urdf_path("burger").read_text()
    (tmp_path / "robot.urdf").write_text(text.replace("</robot>", PAN_TILT))
    (tmp_path / "model.toml").write_text(model_config_path("burger").read_text())
    return resolve_robot(str(tmp_path), tmp_path).model


def command(on: JointSimulation, **positions: float) -> None:
    targets = tuple(JointTarget(joint_name=joint, value=value) for joint, value in positions.items())
    stamp = Time.of(on.simulation.now)
    on.publish(JOINT_COMMAND, JointCommand(header=Header(stamp=stamp), targets=targets), "r", "/r/controller_manager")


def drive(on: JointSimulation, seconds: float, **positions: float) -> None:
    """Drive the base straight ahead and command joints, at 50 Hz."""
    for _ in range(round(seconds * 50)):
        on.publish(CMD_VEL, Twist.planar(0.2, 0.0), "r", "/driver")
        command(on, **positions)
        on.run(0.02)


def joints(on: JointSimulation) -> dict[str, float]:
    body = on.simulation.world.body("r")
    return dict(zip(body.joints, body.joint_readings().position, strict=True))


def test_a_pan_tilt_and_the_wheels_of_one_robot_both_move(model: str) -> None:
    with run_joint_simulation(robot_entry("r", model, joint_state_rate=40.0)) as on:
        states, feedback = (
            on.subscribe(JOINT_STATES, "/r/joint_states"),
            on.subscribe(JOINT_FEEDBACK, "/r/joint_feedback"),
        )
        on.run(0.2)
        assert on.simulation.input_steps == 4
        drive(on, 2.0, pan_joint=1.0, tilt_joint=2.0)
        told = joints(on)
        assert told["pan_joint"] == pytest.approx(1.0, abs=0.01)
        assert told["tilt_joint"] == pytest.approx(0.8, abs=0.01), "the end of its range"
        assert on.simulation.find("r").pose.position[0] == pytest.approx(0.4, abs=0.03)
        assert abs(on.simulation.find("r").pose.position[1]) < 0.01
        for each in (states, feedback):
            each.update()
        assert len(states.messages) == pytest.approx(2.2 * 40, abs=1)
        stamps = [each.header.stamp.ns for each, _ in feedback.messages]
        assert {later - earlier for earlier, later in pairwise(stamps)} == {5_000_000}
        assert stamps[0] <= 220_000_000, "from the first command on"
        assert on.simulation.input_steps == 1, "in real time it listens at each step"


def test_the_wheels_obey_the_base_alone(model: str) -> None:
    with run_joint_simulation(robot_entry("r", model)) as on:
        drive(on, 0.5, wheel_left_joint=3.0, pan_joint=0.5)
        [topic] = [each for each in on.node.subscribers if each.name == "/r/joint_command"]
        assert topic.refused == 25
        assert topic.reason == "r::wheel_left_joint is driven by the robot's base: command cmd_vel instead"
        assert joints(on)["pan_joint"] == pytest.approx(0.5, abs=0.01)


def test_a_stop_holds_base_and_joints_and_a_reset_forgets_the_targets(model: str) -> None:
    with run_joint_simulation(robot_entry("r", model)) as on:
        drive(on, 0.2, pan_joint=2.0)
        on.publish(E_STOP, Bool(data=True), "r", "/panel")
        drive(on, 0.5, pan_joint=2.0)
        where, place = joints(on)["pan_joint"], on.simulation.find("r").pose.position[0]
        drive(on, 1.0, pan_joint=2.0)
        assert joints(on)["pan_joint"] == pytest.approx(where, abs=1e-3)
        assert where < 1.5
        assert on.simulation.find("r").pose.position[0] == pytest.approx(place, abs=1e-3)
        on.publish(E_STOP, Bool(data=False), "r", "/panel")
        drive(on, 1.0, pan_joint=2.0)
        assert joints(on)["pan_joint"] == pytest.approx(2.0, abs=0.01)
        on.call(RESET, Empty())
        on.run(0.2)
        assert joints(on)["pan_joint"] == pytest.approx(0.0, abs=0.01)


def test_efforts_on_them_and_new_positions_are_refused_with_the_alternative(model: str) -> None:
    with run_joint_simulation(robot_entry("r", model)) as on:
        for joint, told in (
            ("pan_joint", "r::pan_joint: robots with a base accept no effort jobs: command the joint on /r/joint_com"),
            ("wheel_left_joint", "r::wheel_left_joint is a wheel, which its base drives: command /r/cmd_vel instead"),
        ):
            with pytest.raises(CallFailed, match=told):
                on.call(APPLY_EFFORT, effort_request(1.0, joint=joint, model="r"))
        put = SetConfiguration(model="r", joint_names=("pan_joint",), joint_positions=(0.5,))
        with pytest.raises(CallFailed, match="the joints of r cannot be set, as they include the wheels"):
            on.call(SET_CONFIGURATION, put)


def turn_arm(on: JointSimulation, value: float, duration: float = 0.1, interface: str = "position") -> None:
    """Command the joint of the arm for ``duration`` [s] of 0.5 s."""
    target = msgspec.convert({"joint_name": "bear_link", "interface": interface, "value": value}, JointTarget)
    on.publish(JOINT_COMMAND, JointCommand(targets=(target,), duration=duration))
    on.run(0.5)


def test_a_reset_during_a_stop_holds_the_joints_where_it_puts_them() -> None:
    with run_joint_simulation(robot_entry("arm", "arm", joints={"bear_link": 0.5})) as on:
        turn_arm(on, 0.8, duration=1.0)
        on.publish(E_STOP, Bool(data=True), sender="/panel")
        on.run(0.2)
        on.call(RESET, Empty())
        on.run(1.0)
        assert on.joint_properties().position == pytest.approx(0.5, abs=1e-3)
        on.publish(E_STOP, Bool(data=False), sender="/panel")
        on.run(0.2)
        on.call(RESET, Empty())
        on.run(1.0)
        assert abs(on.joint_properties().position - 0.5) > 0.05, "it swings: nothing has commanded it since"


def test_a_joint_whose_command_is_over_is_held_where_it_is_set() -> None:
    put = SetConfiguration(model="arm", joint_names=("bear_link",), joint_positions=(-0.5,))
    with run_joint_simulation() as on:
        turn_arm(on, 0.3)
        on.call(SET_CONFIGURATION, put)
        on.run(0.5)
        assert on.joint_properties().position == pytest.approx(-0.5, abs=0.01)
        turn_arm(on, 0.3, duration=10.0)
        on.call(SET_CONFIGURATION, put)
        on.run(1.0)
        assert on.joint_properties().position == pytest.approx(0.3, abs=0.01), "a live command still counts"


def test_a_command_without_targets_ends_those_of_its_publisher_however_old_it_is() -> None:
    with run_joint_simulation() as on:
        states = on.subscribe(JOINT_STATES, "/arm/joint_states")

        def effort() -> float:
            on.run(0.1)
            states.update()
            message, _ = states.messages[-1]
            return message.effort[message.name.index("bear_link")]

        turn_arm(on, 5.0, duration=10.0, interface="effort")
        assert effort() == pytest.approx(5.0)
        on.publish(JOINT_COMMAND, JointCommand(duration=0.0))
        on.run(0.02, factor=1e9)
        [topic] = [each for each in on.node.subscribers if each.name == "/arm/joint_command"]
        assert (topic.refused, effort()) == (0, 0.0)
