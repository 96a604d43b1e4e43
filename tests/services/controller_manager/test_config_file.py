"""Controller YAML files of ROS 1 and ROS 2, and the messages about mistakes in them."""

from __future__ import annotations

from pathlib import Path

import pytest

from models.urdf import JointLimits
from services.controller_manager.config import Gains, ManagerConfig, Tolerance
from services.controller_manager.config_file import MAX_BYTES, parse_config, read_config
from services.runtime.errors import BadInput
from tests.harness.cases import case

ROS_1 = """\
# Copied into every package.
arm0:
  joint_state_controller:
    type: joint_state_controller/JointStateController
    publish_rate: 50
  shoulder_controller:
    type: effort_controllers/JointPositionController
    joint: shoulder
    pid: {p: 100.0, i: 0.01, d: 10.0, i_clamp: 5, i_clamp_max: 3}
  arm_controller:
    type: "velocity_controllers/JointTrajectoryController"
    joints: [shoulder, elbow]
    gains:
      shoulder: {p: 1, d: 0, i: 0}
      elbow: {p: 2.0}
    velocity_ff: {elbow: 1.0}
    constraints:
      goal_time: 0.6
      elbow: {trajectory: 0.1, goal: 0.05}
    stop_trajectory_duration: 0.5
    state_publish_rate: 25
  gazebo_ros_control:
    pid_gains:
      elbow: {p: 20.0, d: 1}
"""
ROS_2 = """\
controller_manager:
  ros__parameters:
    update_rate: 50
    joint_state_broadcaster:
      type: joint_state_broadcaster/JointStateBroadcaster
    arm_controller:
      type: joint_trajectory_controller/JointTrajectoryController
    drive:
      type: diff_drive_controller/DiffDriveController
    velocities.type: forward_command_controller/ForwardCommandController
/**:
  arm_controller:
    ros__parameters:
      joints: [shoulder, elbow]
      command_interfaces: [position, velocity]
      state_interfaces: [position]
      constraints:
        stopped_velocity_tolerance: 0.2
        shoulder.goal: 0.01
velocities:
  ros__parameters:
    joints: [waist]
    interface_name: velocity
drive:
  ros__parameters: {left_wheel_names: [l], right_wheel_names: [r]}
"""


def parsed(text: str, namespace: str = "/arm0") -> ManagerConfig:
    return parse_config(Path("c.yaml"), text, namespace)


def test_a_file_of_ros_1() -> None:
    config = parsed(ROS_1)
    states, shoulder, arm = config.controllers
    assert (states.kind, states.joints, config.update_rate) == ("state", (), 100.0)
    assert (shoulder.interface, shoulder.commanded, shoulder.joints) == ("effort", "position", ("shoulder",))
    assert shoulder.gains["shoulder"].bounds == (-5.0, 3.0)
    assert shoulder.where == "c.yaml:7"
    assert arm.interface == "velocity"
    assert arm.gains == {"shoulder": Gains(p=1.0), "elbow": Gains(p=2.0, ff_velocity_scale=1.0)}
    assert arm.trajectory is not None
    assert arm.trajectory.constraints == {"elbow": Tolerance(trajectory=0.1, goal=0.05)}
    assert (arm.trajectory.goal_time, arm.trajectory.state_publish_rate) == (0.6, 25.0)
    assert config.hardware_gains == {"elbow": Gains(p=20.0, d=1.0)}
    assert config.joints == {
        "shoulder": ("shoulder_controller", "c.yaml:7"),
        "elbow": ("arm_controller", "c.yaml:11"),
    }
    assert config.joint_state_rate == 50.0
    assert config.notes == ("c.yaml:20: unknown key stop_trajectory_duration is ignored",)


def test_the_namespace_on_top_may_be_missing_or_another() -> None:
    lines = ROS_1.splitlines()
    bare = "\n".join(line.removeprefix("  ") for line in lines if line != "arm0:")
    assert [each.name for each in parsed(bare).controllers] == [each.name for each in parsed(ROS_1).controllers]
    other = parsed(ROS_1, "/tb3_0")
    assert len(other.controllers) == 3
    assert (
        other.notes[0] == "c.yaml: the namespace /arm0 of its controllers is ignored: they run in the robot's, /tb3_0"
    )
    assert other.hardware_gains
    two = ROS_1 + "arm1:\n  c: {type: position_controllers/JointPositionController, joint: elbow}\n"
    assert [each.name for each in parsed(two, "arm1").controllers] == ["c"]
    with pytest.raises(BadInput, match=r"only controllers of /arm0, /arm1, none of the robot /arm2"):
        parsed(two, "arm2")


def test_a_file_of_ros_2() -> None:
    config = parsed(ROS_2)
    arm, velocities, states = config.controllers
    assert config.update_rate == 50.0
    assert (arm.name, arm.interface, arm.joints, arm.gains) == ("arm_controller", "position", ("shoulder", "elbow"), {})
    assert arm.trajectory is not None
    assert arm.trajectory.waits_for_goal
    assert arm.trajectory.stopped_velocity_tolerance == 0.2
    assert arm.trajectory.constraints == {"shoulder": Tolerance(goal=0.01)}
    assert (velocities.kind, velocities.interface, velocities.commanded) == ("group", "velocity", "velocity")
    assert states.kind == "state"
    assert config.notes == ("c.yaml:9: drive is skipped: the simulation drives the base by cmd_vel itself",)


def test_mistakes_are_told_with_their_line() -> None:
    one = "c:\n  type: position_controllers/JointPositionController\n  joint: elbow\n"
    laughs = "a0: &a0 [1]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 20)}]\n" for n in range(1, 9))
    two = ROS_2.replace("velocities.type: forward", "velocities.type: foward")
    for text, told in (
        (
            ROS_1.replace("    joint: shoulder", "    jiont: shoulder"),
            r"c\.yaml:6: .*shoulder_controller: joint is miss",
        ),
        (
            ROS_1.replace("StateController\n", "StatController\n"),
            r"c\.yaml:4: .*unknown type of controller .*did you m",
        ),
        (
            ROS_1.replace("      elbow: {trajectory", "      elbo: {trajectory"),
            r"c\.yaml:19: unknown constraint 'elbo'",
        ),
        (ROS_1.replace("p: 100.0", "p: fast"), r"c\.yaml:9: .*pid\.p: Expected `float`, got `str`"),
        (ROS_1.replace("p: 100.0", "p: .nan"), r"c\.yaml:9: .*pid\.p: Expected `float`"),
        (ROS_1.replace("    pid: {p: 100.0", "    dip: {p: 100.0"), r"c\.yaml:7: .*needs gains: pid: \{p"),
        (
            ROS_1.replace("      elbow: {p: 2.0}", ""),
            r"c\.yaml:11: arm_controller: velocity needs gains for each joint",
        ),
        (ROS_1.replace("goal_time: 0.6", "goal_time: -1"), r"c\.yaml:18: .*goal_time: Expected `float` >= 0"),
        (ROS_1.replace("[shoulder, elbow]", "[elbow, elbow]"), r"c\.yaml:12: the joint 'elbow' occurs twice"),
        (ROS_2.replace("position, velocity]", "torque]"), r"c\.yaml:15: unknown interface 'torque' \(known: effort, p"),
        (two, r"c\.yaml:10: velocities: unknown type of controller 'foward"),
        (ROS_2.replace("[waist]", "[]"), r"c\.yaml:22: velocities\.joints: Expected `array` of length >= 1"),
        (ROS_2.replace("update_rate: 50", "update_rate: 1e9"), r"c\.yaml:3: controller_manager\.update_rate: "),
        (one + one, r"c\.yaml: line 4: c is given twice"),
        (one.replace("c:", "'c d':"), r"c\.yaml:2: 'c d' is not a valid controller name"),
        ("a: {b: 1}", r"c\.yaml:1: there is no controller in this file"),
        ("- a", r"c\.yaml:1: expected a table of controllers"),
        ("a: [", r"c\.yaml: while parsing"),
        ("a: " + "{b: " * 13 + "1" + "}" * 13, r"c\.yaml: more than 20000 values, or tables more than 12 deep"),
        ("a: &a {b: 1, c: *a}", r"c\.yaml: more than 20000 values"),
        (laughs, r"c\.yaml: more than 20000 values"),
    ):
        with case(told), pytest.raises(BadInput, match=told):
            parsed(text)


def test_what_is_ignored_is_named() -> None:
    assert (
        parsed(
            ROS_1.replace("goal_time: 0.6", "goal_time: 0.6").replace("state_publish_rate", "state_publsh_rate")
        ).notes[-1]
        == "c.yaml:21: unknown key state_publsh_rate is ignored; did you mean 'state_publish_rate'?"
    )
    gripper = ROS_2.replace("diff_drive_controller/DiffDriveController", "gripper/Controller")
    with pytest.raises(BadInput, match=r"c\.yaml:9: drive: unknown type .*; to leave it out, name those to run"):
        parsed(gripper)
    chosen = parse_config(Path("c.yaml"), gripper, "arm0", ("arm_controller",))
    assert chosen.notes == ("c.yaml:9: drive is skipped: unknown type gripper/Controller",)
    silent = parsed(ROS_1.replace("i_clamp: 5, i_clamp_max: 3", ""))
    assert "c.yaml:9: i = 0.01 has no effect, as i_clamp = 0 clamps the integral term to 0" in silent.notes


def test_joints_are_those_of_the_robot() -> None:
    limits = {"shoulder": JointLimits("revolute"), "elbow": JointLimits("fixed")}
    with pytest.raises(BadInput, match=r"c\.yaml:11: arm_controller: the joint elbow is fixed: it does not move"):
        parsed(ROS_1).check_joints(limits)
    with pytest.raises(
        BadInput, match=r"c\.yaml:7: shoulder_controller: unknown joint 'shoulder'; did you mean 'should"
    ):
        parsed(ROS_1).check_joints({"should": JointLimits("revolute")})


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no controller file .*missing\.yaml"):
        read_config(tmp_path / "missing.yaml", "arm")
    (tmp_path / "large.yaml").write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(BadInput, match=r"large\.yaml: more than \d+ bytes"):
        read_config(tmp_path / "large.yaml", "arm")
