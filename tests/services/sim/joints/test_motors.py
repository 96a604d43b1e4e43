"""Joints commanded by a controller manager, in real physics: within their limits, and safe when the commands end."""

from __future__ import annotations

import pytest

from messages.joints import JointCommand, JointTarget
from services.sim.physics.world import Motor
from tests.harness.joint_rig import JointRig, joint_rig


def drive(rig: JointRig, seconds: float, **positions: float) -> float:
    """Command positions at 100 Hz; return the shoulder's greatest speed [rad/s]."""
    fastest = 0.0
    for _ in range(round(seconds * 100)):
        rig.command("position", **positions)
        rig.step(0.01)
        fastest = max(fastest, abs(rig.velocity("shoulder")))
    return fastest


def test_positions_are_reached_at_the_limits_of_the_urdf_without_overshoot() -> None:
    with joint_rig() as rig:
        fastest = drive(rig, 0.3, waist=2.0, shoulder=-1.0, elbow=1.5, gripper=0.03)
        assert fastest == pytest.approx(2.0, abs=0.02), "the shoulder's velocity limit"
        assert -1.0 < rig.position("shoulder") < -0.5
        highest = 0.0
        for _ in range(100):
            drive(rig, 0.01, waist=2.0, shoulder=-1.0, elbow=1.5, gripper=0.03)
            highest = max(highest, rig.position("waist"))
        assert highest <= 2.0 + 1e-6
        for joint, wanted in (("waist", 2.0), ("shoulder", -1.0), ("elbow", 1.5), ("gripper", 0.03)):
            assert rig.position(joint) == pytest.approx(wanted, abs=1e-4)
        assert rig.position("mirrored_gripper") == pytest.approx(0.025, abs=1e-4), "half of the gripper's, and 0.01"
        drive(rig, 0.5, gripper=0.03, mirrored_gripper=0.0)
        assert rig.position("mirrored_gripper") == pytest.approx(0.0, abs=1e-4), "its own command wins"
        drive(rig, 2.0, shoulder=-7.0, gripper=1.0)
        assert rig.position("shoulder") == pytest.approx(-2.0, abs=1e-3), "its lower limit"
        assert rig.position("gripper") == pytest.approx(0.04, abs=1e-3), "its upper limit"


def test_a_position_that_moves_on_is_followed_between_commands() -> None:
    with joint_rig() as rig:
        rig.command("position", duration=0.2, shoulder=0.0)
        rig.step(0.1)
        for tick in range(5):
            rig.command("position", rate=1.0, shoulder=tick * 0.05)
            for step in range(10):
                rig.step()
                assert rig.position("shoulder") == pytest.approx(tick * 0.05 + (step + 1) * 0.005, abs=2e-3)


def test_a_velocity_is_kept_up_to_the_end_of_the_range() -> None:
    with joint_rig() as rig:
        for _ in range(50):
            rig.command("velocity", waist=0.7, elbow=9.0, gripper=0.01)
            rig.step(0.01)
        assert rig.velocity("waist") == pytest.approx(0.7, abs=1e-3)
        assert rig.velocity("elbow") == pytest.approx(3.0, abs=1e-3), "its velocity limit"
        assert rig.position("gripper") == pytest.approx(0.005, abs=1e-4)
        for _ in range(100):
            rig.command("velocity", elbow=3.0)
            rig.step(0.01)
        assert rig.position("elbow") == pytest.approx(2.5, abs=0.03)


def test_an_effort_acts_within_its_limit_and_is_told() -> None:
    with joint_rig() as rig:
        rig.command("effort", elbow=1000.0, shoulder=0.0)
        rig.step()
        told = dict(zip(rig.body.joints, rig.motors.readings(rig.body.joint_readings()).effort, strict=True))
        assert (told["elbow"], told["shoulder"]) == (20.0, 0.0)
        assert rig.velocity("elbow") > 1.0


def test_what_is_commanded_no_more_is_held_and_what_felt_an_effort_is_free() -> None:
    with joint_rig() as rig:
        drive(rig, 1.0, shoulder=-0.5, elbow=0.0)
        before = rig.position("shoulder")
        rig.step(1.0)
        assert rig.position("shoulder") == pytest.approx(before, abs=1e-3), "the command was over after 0.1 s"
        rig.command("velocity", waist=1.0)
        rig.step(0.05)
        rig.motors.publisher_lost(rig.publisher.publisher)
        rig.step(0.1)
        assert rig.velocity("waist") == pytest.approx(0.0, abs=5e-3)
        for _ in range(3):
            rig.command("effort", shoulder=0.0)
            rig.step(0.01)
        rig.step(1.0)
        assert rig.position("shoulder") > 1.0, "gravity has it, and lets it fall"


def test_an_emergency_stop_holds_every_joint_that_was_commanded() -> None:
    with joint_rig() as rig:
        drive(rig, 0.2, shoulder=-0.5)
        elbow = JointTarget(joint_name="elbow", interface="effort", value=0.5)
        waist = JointTarget(joint_name="waist", interface="velocity", value=1.0)
        rig.send(JointCommand(duration=1.0, targets=(elbow, waist)))
        rig.step(0.05)
        rig.motors.stop(True)
        places = {joint: rig.position(joint) for joint in rig.body.joints}
        rig.command("position", shoulder=1.5, waist=1.0, elbow=-1.0)
        rig.step(1.0)
        for joint in ("waist", "elbow"):
            assert rig.position(joint) == pytest.approx(places[joint], abs=0.02), joint
        rig.motors.stop(False)
        rig.step(0.5)
        assert rig.position("elbow") == pytest.approx(places["elbow"], abs=0.02), "a release moves nothing"
        drive(rig, 1.0, elbow=0.5)
        assert rig.position("elbow") == pytest.approx(0.5, abs=1e-3)


def test_joints_of_the_base_and_unknown_ones_are_refused_and_the_others_move() -> None:
    with joint_rig(Motor("waist", 20.0)) as rig:
        assert rig.motors.joints == ("shoulder", "elbow", "gripper", "mirrored_gripper")
        drive(rig, 1.0, waist=1.0, wrist=1.0, elbow=0.5)
        assert rig.topic.refused == 200
        assert "arm::waist is driven by the robot's base: command cmd_vel instead" in rig.log.getvalue()
        assert rig.topic.reason.startswith("arm: unknown joint 'wrist'")
        assert rig.position("elbow") == pytest.approx(0.5, abs=1e-3)
        assert rig.position("waist") == pytest.approx(0.0, abs=1e-3)


def test_a_command_that_was_on_its_way_for_too_long_moves_nothing() -> None:
    with joint_rig() as rig:
        rig.motors._delays.estimate = lambda origin: 0.3  # type: ignore[method-assign]
        target = JointTarget(joint_name="waist", interface="velocity", value=1.0)
        rig.publisher.publish(JointCommand(targets=(target,)))
        rig.topic.update()
        rig.motors.apply_commands(rig.topic, rig.now, set(), 1.0)
        rig.step(0.2)
        assert rig.topic.reason == "a command of 0.1 s that is 0.300 s old has expired"
        assert rig.velocity("waist") == 0.0
