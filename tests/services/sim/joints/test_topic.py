"""Jobs on the topic ``joint_effort``: effects, rejections, and their end with publishers, robots and resets."""

from __future__ import annotations

import math
import re

import pytest

from messages.base import encode
from messages.gazebo import ApplyEffort
from messages.geometry import Pose, Twist
from messages.joints import JointEffort
from messages.requests import APPLY_EFFORT, DELETE, RESET, SPAWN, Name
from messages.simulation import SpawnModel
from messages.std import Bool, Empty, Time
from messages.topics import CLOCK, CMD_VEL, E_STOP, JOINT_EFFORT, JOINT_STATES, ODOM, TF, TF_STATIC
from services.runtime.errors import BadInput, CallFailed
from services.runtime.transport.wire import encoding
from tests.services.sim.joints.joint_simulation import robot_entry, run_joint_simulation


def test_a_job_acts_for_its_time_and_is_told() -> None:
    with run_joint_simulation() as on:
        states = on.subscribe(JOINT_STATES, "/arm/joint_states")
        on.publish_effort(50.0)
        on.run(0.2)
        states.update()
        told = [(each.header.stamp.ns, each.effort[0]) for each, _ in states.messages]
        assert [stamp for stamp, _ in told] == [5_000_000 * step for step in range(40)], "at 200 Hz"
        assert [stamp for stamp, effort in told if effort] == [5_000_000 * step for step in range(1, 22)]
        assert on.joint_properties().position > 0.05


def test_sum_and_replace_on_the_topic() -> None:
    for mode, expected in (("replace", 20.0), ("sum", 50.0)):
        with run_joint_simulation(robot_entry("arm", joint_parameters={"effort_mode": mode})) as on:
            on.publish_effort(30.0)
            on.publish_effort(20.0)
            on.run(0.01)
            assert on.joint_properties().applied_effort == expected
            assert on.joint_properties().jobs == (1 if mode == "replace" else 2)


def job(
    joint: str = "bear_link", effort: float = 1.0, duration: float = 0.1, sec: int = 0, nano: int = 0
) -> JointEffort:
    """Return a job of 0.1 s."""
    return JointEffort(joint_name=joint, effort=effort, duration=duration, start_time=Time(sec=sec, nanosec=nano))


@pytest.mark.parametrize(
    ("sent", "says"),
    [
        (job("bear_lnk"), "unknown joint 'bear_lnk'; did you mean 'bear_link'"),
        (job("end_link"), r"unknown joint 'end_link'.*\(known: bear_link\)"),
        (job(effort=1e9), "<= 1000000"),
        (job(effort=math.nan), "effort"),
        (job(duration=-2.0), "duration"),
        (job(sec=9), "8.000 s ahead.*been reset"),
        (job(nano=1), "it has expired"),
    ],
)
def test_what_makes_no_sense_is_counted_and_told(sent: JointEffort, says: str) -> None:
    with run_joint_simulation() as on:
        on.run(1.0)
        on.publish(JOINT_EFFORT, sent)
        on.run(0.01)
        health = on.commands().health()
        assert health.refused == 1
        assert re.search(says, health.reason), health.reason
        assert on.joint_properties().jobs == 0


def test_a_foreign_program_may_send_and_garbage_is_refused() -> None:
    with run_joint_simulation() as on:
        put = on._transport.advertise("arm/joint_effort", encoding(JointEffort.ROS_TYPE), JOINT_EFFORT.quality).put
        put(encode(JointEffort(joint_name="bear_link", effort=5.0, duration=0.1)), attachment=b"")
        put(b"\xc1garbage", attachment=b"")
        on.run(0.01)
        assert on.joint_properties().applied_effort == 5.0
        assert (on.commands().foreign, on.commands().refused) == (2, 1)


def test_what_waited_in_a_frozen_process_is_not_begun_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its age, wall time beyond the least delay seen, is subtracted from its duration."""
    ages = iter([0.0, 0.06, 0.5])
    with run_joint_simulation() as on:
        monkeypatch.setattr(on.simulation._delays, "estimate", lambda _: next(ages))
        for effort in (1.0, 2.0, 3.0):
            on.publish_effort(effort)
        on.run(0.5, factor=1.0)
        assert on.commands().refused == 1
        assert "sent 0.500 s ago is dropped" in on.commands().reason
    with run_joint_simulation() as on:
        monkeypatch.setattr(on.simulation._delays, "estimate", lambda _: 0.06)
        states = on.subscribe(JOINT_STATES, "/arm/joint_states")
        on.publish_effort(10.0)
        on.run(0.2, factor=1.0)
        states.update()
        assert len([each for each, _ in states.messages if each.effort[0]]) == 9, "0.04 s are left, both ends included"


def test_an_emergency_stop_drops_all_efforts_until_it_is_reset() -> None:
    with run_joint_simulation() as on:
        on.publish_effort(50.0, -1.0)
        on.run(0.05)
        on.publish(E_STOP, Bool(data=True), robot="")
        on.run(0.05)
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (0.0, 0)
        on.publish_effort(50.0)
        on.run(0.05)
        assert on.joint_properties().jobs == 0
        with pytest.raises(CallFailed, match="arm is stopped: each publisher that stopped it must send e_stop = false"):
            on.call(APPLY_EFFORT, ApplyEffort(job=JointEffort(joint_name="bear_link", effort=1.0)))
        on.publish(E_STOP, Bool(data=False), robot="")
        on.run(0.01)
        on.publish_effort(50.0)
        on.run(0.05)
        assert on.joint_properties().applied_effort == 50.0


def test_who_comes_while_all_are_stopped_is_stopped_too() -> None:
    """Even when no other robot is there to keep the stop."""
    late = SpawnModel(name="late", model="arm", pose=Pose.planar(3.0, 0.0))
    base = SpawnModel(name="base", model="burger", pose=Pose.planar(-3.0, 0.0))
    with run_joint_simulation() as on:
        on.call(DELETE, Name(name="arm"))
        on.publish(E_STOP, Bool(data=True), robot="")
        on.run(0.05)
        on.call(SPAWN, late)
        on.call(SPAWN, base)
        on.publish_effort(50.0, 1.0, robot="late")
        on.publish(CMD_VEL, Twist.planar(0.2, 0.0), robot="base")
        on.run(0.1)
        assert (on.joint_properties("late").jobs, on.joint_properties("late").applied_effort) == (0, 0.0)
        assert on.simulation.find("base").state().twist.linear.x == pytest.approx(0.0, abs=1e-3)
        on.publish(E_STOP, Bool(data=False), robot="")
        on.run(0.05)
        on.publish_effort(50.0, 1.0, robot="late")
        on.run(0.05)
        assert on.joint_properties("late").applied_effort == 50.0


def test_a_sender_that_goes_takes_what_has_no_end_with_it() -> None:
    with run_joint_simulation() as on:
        on.publish_effort(50.0, -1.0, sender="/dies")
        on.run(0.05)
        source = next(iter(on._outputs.values())).publisher
        on.simulation.find("arm").actuation.publisher_lost(source, on.simulation.now)
        on.run(0.05)
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (0.0, 0)


def test_reset_and_delete_drop_all_jobs() -> None:
    with run_joint_simulation() as on:
        on.publish_effort(50.0, -1.0)
        on.run(0.5)
        on.call(RESET, Empty())
        assert (on.joint_properties().jobs, on.joint_properties().applied_effort, on.joint_properties().position) == (
            0,
            0.0,
            0.0,
        )
        on.publish_effort(50.0, -1.0)
        on.run(0.5)
        on.call(DELETE, Name(name="arm"))
        assert not any(each.name == "/arm/joint_effort" for each in on.node.subscribers)
        on.call(SPAWN, SpawnModel(name="arm", model="arm"))
        on.run(0.5)
        assert on.joint_properties().jobs == 0
        assert abs(on.joint_properties().position) < 0.1


def test_two_arms_have_one_joint_name_and_do_not_meet() -> None:
    with run_joint_simulation(robot_entry("arm"), robot_entry("other", x=3.0)) as on:
        on.publish_effort(50.0, 1.0, robot="other")
        on.run(0.3)
        assert on.joint_properties("other").position > 0.3
        assert abs(on.joint_properties("arm").position) < 0.05


def test_a_doubtful_urdf_and_a_doubtful_mode_are_warned_of() -> None:
    with run_joint_simulation(
        robot_entry("seed"),
        robot_entry("gazebo", x=3.0, joint_parameters={"effort_mode": "sum", "velocity_rule": "gazebo"}),
        robot_entry("good", "arm_corrected", x=-3.0),
    ) as on:
        assert "seed: joint bear_link: the URDF's velocity limit of 0 counts as unspecified" in on.log
        assert "gazebo: joint bear_link: the URDF's velocity limit of 0 is a limit" in on.log
        assert 'gazebo: effort_mode = "sum": jobs that overlap add up' in on.log
        assert "good" not in on.log


def test_an_arm_stands_in_the_world_and_has_no_odometry() -> None:
    with run_joint_simulation(robot_entry("arm", x=1.5)) as on:
        fixed, moving = on.subscribe(TF_STATIC, "/tf_static"), on.subscribe(TF, "/tf")
        clock, odometry = on.subscribe(CLOCK, "/clock"), on.subscribe(ODOM, "/arm/odom")
        on.simulation.publish_static_tf()
        on.publish_effort(50.0)
        on.run(0.1)
        for each in (fixed, moving, clock, odometry):
            each.update()
        still = {each.child_frame_id: each for each in fixed.messages[-1][0].transforms}
        assert still["arm/root"].header.frame_id == "world"
        assert still["arm/root"].transform.translation.x == 1.5
        assert still["arm/end_link"].header.frame_id == "arm/bear_link"
        assert {each.child_frame_id for each in moving.messages[-1][0].transforms} == {"arm/bear_link"}
        assert odometry.messages == []
        assert len(clock.messages) == 20, "time is told as often as its joints, for who controls them"


@pytest.mark.parametrize(
    ("robot", "says"),
    [
        (
            robot_entry("arm", joint_parameters={"effort_mode": "both"}),
            "Invalid enum value 'both'.*joint_parameters.effort_mode",
        ),
        (robot_entry("arm", joint_parameters={"damping": -1}), "joint_parameters.damping"),
        (robot_entry("arm", joint_parameters={"clamp": True}), "unknown field `clamp`"),
        (robot_entry("arm", joints={"bear_link": 2.0}), "joint bear_link = 2: its limits are -1.5708 and 1.5708"),
        (robot_entry("arm", joints={"elbow": 0.1}), "unknown joint 'elbow'"),
    ],
)
def test_parameters_are_checked(robot: dict[str, object], says: str) -> None:
    with pytest.raises(BadInput, match=says), run_joint_simulation(robot):
        pass


def test_a_start_position_is_kept_through_a_reset() -> None:
    with run_joint_simulation(robot_entry("arm", joints={"bear_link": 0.5}, joint_parameters={"damping": 5.0})) as on:
        assert (on.joint_properties().position, on.joint_properties().damping) == (0.5, 5.0)
        on.run(1.0)
        assert on.joint_properties().position < 0.4
        on.call(RESET, Empty())
        assert on.joint_properties().position == 0.5
