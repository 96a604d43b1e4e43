"""The controller manager with an arm in PyBullet: requests of ROS programs, and the resulting joint positions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from messages.actionlib import GoalID, GoalStatusArray, Status
from messages.control import (
    FollowJointTrajectoryActionFeedback,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryActionResult,
    FollowJointTrajectoryGoal,
    JointControllerState,
    JointTolerance,
    JointTrajectoryControllerState,
    TrajectoryError,
)
from messages.elea import EmergencyStop, EmergencyStops
from messages.sensor import JointState
from messages.std import Duration, Float64, Float64MultiArray, Header, String, Time
from messages.topics import JOINT_FEEDBACK, ROBOT_DESCRIPTION, STOPS, Quality, Topic
from messages.trajectory import JointTrajectory
from services.runtime.errors import BadInput
from tests.harness.joint_rig import URDF
from tests.services.controller_manager.arm_stand import CONTROLLERS, ArmStand, arm_stand, trajectory

ACTION = "arm_controller/follow_joint_trajectory"


def topic(name: str, record: Any, quality: Quality = Quality.EVENT) -> Topic[Any]:
    return Topic(name, record, 0, quality, "", 1 << 20)


COMMAND = topic("arm_controller/command", JointTrajectory)
GOAL, CANCEL = topic(f"{ACTION}/goal", FollowJointTrajectoryActionGoal), topic(f"{ACTION}/cancel", GoalID)
RESULT = topic(f"{ACTION}/result", FollowJointTrajectoryActionResult)
STATUS = topic(f"{ACTION}/status", GoalStatusArray)
FEEDBACK = topic(f"{ACTION}/feedback", FollowJointTrajectoryActionFeedback)


def send_goal(stand: ArmStand, name: str, asked: JointTrajectory, **terms: Any) -> None:
    goal = FollowJointTrajectoryGoal(trajectory=asked, **terms)
    stand.service.publish(GOAL, FollowJointTrajectoryActionGoal(goal_id=GoalID(id=name), goal=goal))


def results(stand: ArmStand) -> list[tuple[str, Status, TrajectoryError, str]]:
    """Return goal id, state, error code and reason of each received result."""
    return [
        (
            each.status.goal_id.id,
            Status(each.status.status),
            TrajectoryError(each.result.error_code),
            each.result.error_string,
        )
        for each in stand.service.drain(RESULT)
    ]


def test_it_holds_the_joints_and_then_follows_a_trajectory(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.run(0.5)
        assert stand.rig.position("shoulder") == pytest.approx(0.0, abs=0.01), "held against gravity"
        ways = trajectory(
            (1.0, {"elbow": 1.0, "shoulder": -1.0, "waist": 4.0}), (2.0, {"elbow": 0.0, "shoulder": 0.5, "waist": 4.0})
        )
        stand.service.publish(COMMAND, ways)
        stand.service.drain(topic("arm_controller/state", JointTrajectoryControllerState))
        stand.run(1.0)
        for joint, wanted in (("elbow", 1.0), ("shoulder", -1.0), ("waist", 4.0 - math.tau)):
            assert stand.rig.position(joint) == pytest.approx(wanted, abs=0.02), joint
        states = stand.service.drain(topic("arm_controller/state", JointTrajectoryControllerState))
        assert len(states) == 50
        assert states[-1].joint_names == ("waist", "shoulder", "elbow")
        assert max(abs(each.error.positions[1]) for each in states[5:]) < 0.01
        stand.run(2.0)
        assert stand.rig.position("shoulder") == pytest.approx(0.5, abs=1e-3)
        assert stand.rig.velocity("shoulder") == pytest.approx(0.0, abs=1e-3)


def test_a_goal_is_followed_told_of_and_reached(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.run(0.1)
        send_goal(stand, "up", trajectory((1.0, {"shoulder": -0.8})))
        stand.run(0.9)
        assert results(stand) == []
        feedback = stand.service.drain(FEEDBACK)
        assert len(feedback) == 18, "20 Hz"
        assert feedback[-1].status.goal_id.id == "up"
        assert feedback[-1].feedback.actual.positions[1] == pytest.approx(-0.7, abs=0.05)
        stand.run(0.3)
        assert results(stand) == [("up", Status.SUCCEEDED, TrajectoryError.SUCCESSFUL, "goal reached")]
        told = [[Status(goal.status) for goal in each.status_list] for each in stand.service.drain(STATUS)]
        changes = [each for n, each in enumerate(told) if n == 0 or each != told[n - 1]]
        assert changes == [[], [Status.ACTIVE], [Status.SUCCEEDED]]
        assert len(told) >= 6, "5 Hz, and at each change"


def test_a_new_goal_preempts_a_cancellation_stops_and_bad_ones_are_rejected(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.run(0.1)
        send_goal(stand, "one", trajectory((2.0, {"shoulder": -1.0})))
        stand.run(0.5)
        send_goal(stand, "two", trajectory((2.0, {"elbow": 1.0})))
        stand.tick()
        assert results(stand) == [
            ("one", Status.PREEMPTED, TrajectoryError.SUCCESSFUL, "preempted by a newer trajectory")
        ]
        send_goal(stand, "bad", trajectory((2.0, {"elbw": 1.0})))
        send_goal(stand, "old", trajectory((0.1, {"elbow": 1.0}), stamp=0.2))
        stand.run(0.3)
        assert [each[:3] for each in results(stand)] == [
            ("bad", Status.REJECTED, TrajectoryError.INVALID_JOINTS),
            ("old", Status.REJECTED, TrajectoryError.OLD_HEADER_TIMESTAMP),
        ]
        assert "a goal is rejected: unknown joint 'elbw'; did you mean 'elbow'?" in stand.service.log
        stand.service.publish(CANCEL, GoalID())
        stand.tick()
        where = stand.rig.position("elbow")
        assert results(stand) == [("two", Status.PREEMPTED, TrajectoryError.SUCCESSFUL, "cancelled on request")]
        stand.run(0.5)
        assert 0.05 < where < 0.3
        assert stand.rig.position("elbow") == pytest.approx(where, abs=0.02), "it holds where it was"
        stand.service.publish(CANCEL, GoalID(id="early"))
        stand.tick()
        send_goal(stand, "early", trajectory((1.0, {"elbow": 1.0})))
        stand.tick()
        assert [each[:2] for each in results(stand)] == [("early", Status.RECALLED)]


def test_a_goal_is_aborted_on_its_way_and_at_its_end(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.run(0.1)
        send_goal(stand, "too fast", trajectory((0.2, {"shoulder": -1.5})))
        stand.run(0.5)
        [(name, status, code, why)] = results(stand)
        assert (name, status, code) == ("too fast", Status.ABORTED, TrajectoryError.PATH_TOLERANCE_VIOLATED)
        assert why.startswith("shoulder is 0.1")
        assert stand.rig.position("shoulder") > -0.9, "it was given up on the way"
        # Beyond the joint's range: it stops at the limit and never reaches the end.
        send_goal(
            stand,
            "too far",
            trajectory((1.5, {"elbow": 2.7})),
            goal_tolerance=(JointTolerance(name="elbow", position=0.05),),
            goal_time_tolerance=Duration.of(300_000_000),
        )
        stand.run(1.7)
        assert results(stand) == []
        stand.run(0.2)
        [(name, status, code, why)] = results(stand)
        assert (name, status, code) == ("too far", Status.ABORTED, TrajectoryError.GOAL_TOLERANCE_VIOLATED)
        assert why.startswith("elbow is 0.2 off, the limit is 0.05, 0.3")
        assert "arm_controller: the position 2.5" in stand.service.log
        assert "of elbow is clamped to 2.5, its limit in the URDF" in stand.service.log
        send_goal(stand, "nobody", trajectory((1.0, {"elbow": 0.0})), path_tolerance=(JointTolerance(name="nose"),))
        stand.tick()
        assert [each[1:3] for each in results(stand)] == [(Status.REJECTED, TrajectoryError.INVALID_JOINTS)]


def test_a_state_has_the_errors_of_its_own_desired_velocities_even_at_an_abort(tmp_path: Path) -> None:
    """Otherwise the derivative gain acts for one tick on the velocity of the aborted trajectory."""
    text = CONTROLLERS.replace("  allow_partial", "  state_publish_rate: 100\n  allow_partial")
    with arm_stand(tmp_path, text) as stand:
        stand.run(0.1)
        send_goal(stand, "too fast", trajectory((0.2, {"shoulder": -1.5})))
        stand.run(0.3)
        assert [each[1] for each in results(stand)] == [Status.ABORTED]
        states = stand.service.drain(topic("arm_controller/state", JointTrajectoryControllerState))
        assert len(states) == 40
        for each in states:
            pairs = zip(each.desired.velocities, each.actual.velocities, strict=True)
            assert each.error.velocities == tuple(desired - actual for desired, actual in pairs)


def test_controllers_of_numbers_hold_turn_and_refuse(tmp_path: Path) -> None:
    names = ("gripper_controller", "group_controller", "waist_controller")
    with arm_stand(tmp_path, controllers=names) as stand:
        group, gripper = (
            topic("group_controller/commands", Float64MultiArray),
            topic("gripper_controller/command", Float64),
        )
        waist = topic("waist_controller/command", Float64)
        stand.run(0.1)
        stand.service.publish(group, Float64MultiArray(data=(-0.5, 9.0)))
        stand.service.publish(gripper, Float64(data=0.02))
        stand.service.publish(waist, Float64(data=0.5))
        stand.run(2.0)
        assert stand.rig.position("shoulder") == pytest.approx(-0.5, abs=1e-3)
        assert stand.rig.position("elbow") == pytest.approx(2.5, abs=0.02)
        assert stand.rig.position("gripper") == pytest.approx(0.02, abs=1e-3)
        assert stand.rig.velocity("waist") == pytest.approx(0.5, abs=1e-3)
        assert "group_controller: the position 9 of elbow is clamped to 2.5" in stand.service.log
        state = stand.service.drain(topic("gripper_controller/state", JointControllerState))[-1]
        assert (state.set_point, state.p, state.i_clamp) == (0.02, 100.0, 5.0)
        assert state.process_value == pytest.approx(0.02, abs=1e-3)
        stand.service.publish(group, Float64MultiArray(data=(0.0,)))
        stand.run(0.5)
        assert stand.rig.position("shoulder") == pytest.approx(-0.5, abs=1e-3)
        assert (
            "group_controller: a command of 1 numbers is refused: the controller has 2 joints (shoulder, elbow)"
            in stand.service.log
        )


def test_efforts_follow_a_trajectory_by_their_gains(tmp_path: Path) -> None:
    with arm_stand(tmp_path, controllers=("effort_controller",), update_rate=100) as stand:
        stand.run(1.0)
        command = topic("effort_controller/joint_trajectory", JointTrajectory)
        stand.service.publish(command, trajectory((1.0, {"shoulder": -0.6, "elbow": 0.8})))
        stand.run(2.0)
        assert {each.interface for each in stand.command.targets} == {"effort"}
        assert stand.rig.position("shoulder") == pytest.approx(-0.6, abs=0.02)
        assert stand.rig.position("elbow") == pytest.approx(0.8, abs=0.02)


def test_gains_of_gazebo_ros_control_move_a_position_by_effort(tmp_path: Path) -> None:
    gains = "gazebo_ros_control:\n  pid_gains:\n    elbow: {p: 40, i: 40, d: 1, i_clamp: 10}\n"
    one = "elbow_controller: {type: position_controllers/JointPositionController, joint: elbow}\n"
    with arm_stand(tmp_path, text=one + gains) as stand:
        stand.run(0.5)
        stand.service.publish(topic("elbow_controller/command", Float64), Float64(data=0.4))
        stand.run(2.0)
        assert [each.interface for each in stand.command.targets] == ["effort"]
        assert stand.rig.position("elbow") == pytest.approx(0.4, abs=0.02)


def test_an_emergency_stop_ends_what_was_asked_for(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.run(0.1)
        send_goal(stand, "one", trajectory((2.0, {"shoulder": -1.0})))
        stand.run(0.5)
        stop = EmergencyStop(robot="arm", topic="/arm/e_stop", holder="/panel")
        other = EmergencyStop(robot="tb3_0", topic="/tb3_0/e_stop", holder="/panel")
        stand.service.publish(STOPS, EmergencyStops(stops=(other,)))
        stand.tick()
        assert results(stand) == [], "the stop of another robot"
        stand.service.publish(STOPS, EmergencyStops(stops=(other, stop)))
        stand.tick()
        where = stand.rig.position("shoulder")
        why = "an emergency stop of /panel holds the robot"
        assert results(stand) == [("one", Status.ABORTED, TrajectoryError.INVALID_GOAL, why)]
        assert stand.command.targets == ()
        send_goal(stand, "two", trajectory((2.0, {"shoulder": -1.0})))
        stand.run(0.5)
        assert results(stand) == [("two", Status.REJECTED, TrajectoryError.INVALID_GOAL, why)]
        stand.service.publish(STOPS, EmergencyStops())
        stand.run(1.0)
        assert stand.rig.position("shoulder") == pytest.approx(where, abs=0.02), "nothing is taken up again"


def test_without_the_joints_it_commands_none_and_begins_anew_with_them(tmp_path: Path) -> None:
    with arm_stand(tmp_path) as stand:
        stand.feedback = False
        stand.run(2.1)
        assert stand.command.targets == ()
        assert "nothing on /arm/joint_feedback, commanding nothing: is the robot in the simulation" in stand.service.log
        stand.feedback = True
        stand.run(0.1)
        send_goal(stand, "one", trajectory((5.0, {"shoulder": 1.0})))
        stand.tick()
        stand.feedback = False
        stand.run(0.2)
        assert stand.command.targets == ()
        assert [each[1:] for each in results(stand)] == [
            (Status.ABORTED, TrajectoryError.INVALID_GOAL, "no joint states are arriving any more")
        ]


def test_a_velocity_that_nobody_repeats_ends_where_that_is_asked_for(tmp_path: Path) -> None:
    with arm_stand(tmp_path, controllers=("waist_controller",), command_timeout=0.3) as stand:
        stand.run(0.1)
        stand.service.publish(topic("waist_controller/command", Float64), Float64(data=0.5))
        stand.run(0.3)
        assert stand.rig.velocity("waist") == pytest.approx(0.5, abs=1e-3)
        stand.run(0.1)
        assert stand.rig.velocity("waist") == pytest.approx(0.0, abs=1e-3)
        assert "waist_controller: no command for 0.3 s, its joints are stopped" in stand.service.log


def test_joints_that_the_robot_lacks_end_it_with_the_line(tmp_path: Path) -> None:
    wrong = CONTROLLERS.replace("joint: gripper", "joint: griper")
    with (
        pytest.raises(
            BadInput, match=r"controllers\.yaml:10: gripper_controller: unknown joint 'griper'; did you mean 'gr"
        ),
        arm_stand(tmp_path, text=wrong) as stand,
    ):
        stand.run(0.1)


def test_foreign_messages_neither_end_it_nor_move_a_joint(tmp_path: Path) -> None:
    with arm_stand(tmp_path, urdf="<robot") as stand:
        stand.run(0.1)
        assert "the robot_description is refused: line 1: the URDF is not XML" in stand.service.log
        assert stand.command.targets == ()
        stand.service.publish(ROBOT_DESCRIPTION, String(data=URDF.read_text()))
        stand.run(0.1)
        assert len(stand.command.targets) == 4
        stand.service.publish(ROBOT_DESCRIPTION, String(data="<robot><link name='a'/></robot>"))
        stand.run(0.1)
        assert "another robot_description is refused: " in stand.service.log
        assert len(stand.command.targets) == 4
        stand.feedback = False
        stand.service.publish(JOINT_FEEDBACK, JointState(header=Header(stamp=Time.of(stand.rig.now)), name=("elbow",)))
        stand.tick()
        assert stand.command.targets == ()
        assert "the joint feedback has no position and velocity of elbow, gripper, shoulder, waist" in stand.service.log
