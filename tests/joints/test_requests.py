"""What may be asked of joints, links and models: Gazebo's world services, scoped by model."""

from __future__ import annotations

import math
from typing import Any

import pytest

from messages.base import Message
from messages.gazebo import ApplyEffort, ApplyWrench, JointName, LinkName, SetConfiguration
from messages.geometry import Point, Pose, Quaternion, Twist, Vector3, Wrench
from messages.joints import JointEffort
from messages.parameters import Assignment
from messages.requests import (
    APPLY_EFFORT,
    APPLY_WRENCH,
    CLEAR_EFFORT,
    CLEAR_WRENCH,
    DELETE,
    GET_STATE,
    JOINT_PROPERTIES,
    LINK_PROPERTIES,
    LINK_STATE,
    MODEL_PROPERTIES,
    RESET_WORLD,
    SET_CONFIGURATION,
    SET_STATE,
    SPAWN,
    WORLD_PROPERTIES,
    Name,
    Request,
)
from messages.simulation import GetModelState, SetModelState, SpawnModel
from messages.std import Empty, Time
from services.runtime.errors import CallFailed
from tests.joints.scene import Scenery, entry, scene


def effort(
    value: float, duration: float = 0.1, joint: str = "bear_link", model: str = "", start: int = 0
) -> ApplyEffort:
    """A job that is asked for."""
    job = JointEffort(joint_name=joint, effort=value, duration=duration, start_time=Time.of(start))
    return ApplyEffort(model=model, job=job)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (effort(5.0), "5 on arm::bear_link from now for 0.1 s"),
        (effort(5.0, joint="arm::bear_link"), "5 on arm::bear_link from now for 0.1 s"),
        (effort(-5.0, -1.0, "arm/bear_link"), "-5 on arm::bear_link from now until it is cleared"),
        (effort(5.0, 0.0, model="arm"), "from now for one physics step of 5 ms, the shortest there is"),
        (effort(5.0, 2.0, model="arm", start=3_000_000_000), "from 3 s for 2 s"),
    ],
)
def test_an_effort_is_applied_and_the_reply_says_how(asked: ApplyEffort, says: str) -> None:
    with scene() as on:
        assert says in on.ask(APPLY_EFFORT, asked).text
        assert on.joint().jobs == 1


def test_efforts_wait_act_and_are_cleared() -> None:
    with scene() as on:
        on.ask(APPLY_EFFORT, effort(5.0, -1.0, start=50_000_000))
        on.run(0.05)
        assert (on.joint().applied_effort, on.joint().jobs) == (0.0, 1)
        on.run(0.01)
        assert on.joint().applied_effort == 5.0
        assert on.ask(CLEAR_EFFORT, JointName(joint_name="arm::bear_link")).text == "1 job of arm::bear_link dropped"
        on.run(0.005)
        assert (on.joint().applied_effort, on.joint().jobs) == (0.0, 0)
        on.ask(APPLY_EFFORT, effort(5.0, -1.0))
        on.run(0.05)
        on.ask(RESET_WORLD, Empty())
        assert on.joint().jobs == 0


def test_what_a_joint_is_and_does() -> None:
    with scene(entry("arm", "arm_corrected", joint_parameters={"damping": 2.0}), entry("tb3", "burger", x=3.0)) as on:
        on.push(400.0, 1.0)
        on.run(0.02)
        found = on.joint()
        assert (found.model, found.type, found.damping, found.friction) == ("arm", "revolute", 2.0, 0.0)
        assert (found.lower, found.upper, found.effort_limit, found.velocity_limit) == (-1.5708, 1.5708, 200.0, 20.0)
        assert found.applied_effort == 200.0, "clamped"
        assert found.rate > 5.0
        wheel = on.ask(JOINT_PROPERTIES, JointName(model="tb3", joint_name="wheel_left_joint"))
        assert (wheel.type, wheel.lower, wheel.jobs) == ("continuous", None, 0)


REFUSED: list[tuple[Request[Any, Any], Message, str]] = [
    (APPLY_EFFORT, effort(1.0, joint="arm::elbow"), r"arm: unknown joint 'elbow' \(known: bear_link\)"),
    (APPLY_EFFORT, effort(1.0, joint="elbow"), "unknown joint 'elbow'.*known: .*arm::bear_link.*tb3::wheel_left_joint"),
    (
        APPLY_EFFORT,
        effort(1.0, joint="bear_link"),
        "2 models have a joint 'bear_link': say which, arm::bear_link or",
    ),
    (APPLY_EFFORT, effort(1.0, model="arn"), "unknown model 'arn'; did you mean 'arm'"),
    (APPLY_EFFORT, effort(1.0, joint="arn::bear_link"), "unknown model 'arn'; did you mean 'arm'"),
    (APPLY_EFFORT, effort(1.0, joint="wheel_left_joint"), "is a wheel, which its base drives: command /tb3/cmd_vel"),
    (APPLY_EFFORT, effort(1e9, model="arm"), "job.effort"),
    (SET_CONFIGURATION, SetConfiguration(model="arm", joint_names=("bear_link",)), "1 joint names and 0 positions"),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="arm", joint_names=("bear_link",), joint_positions=(1.6,)),
        "bear_link = 1.6: its limits are -1.5708 and 1.5708",
    ),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="arm", joint_names=("bear_link",) * 2, joint_positions=(0.1, 0.2)),
        "named twice",
    ),
    (
        SET_CONFIGURATION,
        SetConfiguration(model="tb3", joint_names=("wheel_left_joint",), joint_positions=(1.0,)),
        "which odometry counts",
    ),
    (APPLY_WRENCH, ApplyWrench(body_name="arm::elbow"), "arm: unknown link 'elbow'.*known: bear_link, end_link, root"),
    (APPLY_WRENCH, ApplyWrench(body_name="tb3", reference_frame="mars"), "unknown link 'mars'"),
    (
        APPLY_WRENCH,
        ApplyWrench(body_name="tb3", wrench=Wrench(force=Vector3(x=1e6))),
        "100000 in each axis is the most",
    ),
    (LINK_STATE, LinkName(link_name="tb3::base_scna"), "did you mean 'base_scan'"),
    (GET_STATE, GetModelState(name="tb3", relative_entity="arn"), "unknown link 'arn'"),
    (SET_STATE, SetModelState(name="tb3", reference_frame="two::x"), "two: unknown link 'x'"),
    (SET_STATE, SetModelState(name="arm", twist=Twist.planar(1.0, 0.0)), "held in the world"),
    (SPAWN, SpawnModel(name="new", model="burger", reference_frame="nowhere"), "unknown link 'nowhere'"),
    (
        SPAWN,
        SpawnModel(name="new", model="arm", pose=Pose.planar(-4, 0), joint_names=("elbow",), joint_positions=(1.0,)),
        "unknown joint 'elbow'",
    ),
    (
        SPAWN,
        SpawnModel(name="new", model="arm", parameters=(Assignment(name="dampin", value=1.0),)),
        "new: unknown parameter 'dampin'; did you mean 'damping'",
    ),
]


@pytest.fixture(scope="module")
def crowd() -> Any:
    """Two arms and a burger."""
    with scene(entry("arm"), entry("two", x=4.0), entry("tb3", "burger", x=2.0)) as on:
        yield on


@pytest.mark.parametrize(("request_", "asked", "says"), REFUSED)
def test_what_is_refused_names_what_there_is(
    crowd: Scenery, request_: Request[Any, Any], asked: Message, says: str
) -> None:
    before = [robot.name for robot in crowd.stage.robots]
    with pytest.raises(CallFailed, match=says):
        crowd.ask(request_, asked)
    assert [robot.name for robot in crowd.stage.robots] == before


def test_joints_are_put_where_they_are_told() -> None:
    with scene() as on:
        on.push(100.0, 0.1)
        on.run(0.5)
        wanted = SetConfiguration(model="arm", joint_names=("arm::bear_link",), joint_positions=(-0.7,))
        reply = on.ask(SET_CONFIGURATION, wanted)
        assert (reply.name, reply.position, reply.velocity) == (("bear_link",), (-0.7,), (0.0,))
        before = on.ask(SET_CONFIGURATION, SetConfiguration(model="arm")).position
        assert before == (-0.7,), "who is not named stays"


def test_an_arm_is_not_swung_into_a_robot_and_a_robot_not_put_into_an_arm() -> None:
    """At 75 degrees the head is at x = 0.74 m and z = 1.1 m, and out of the way at 0."""
    high = Pose(position=Point(x=0.75, z=1.03))
    with scene() as on:
        on.ask(SPAWN, SpawnModel(name="tb3", model="burger", pose=high))
        up = SetConfiguration(model="arm", joint_names=("bear_link",), joint_positions=(math.radians(75),))
        with pytest.raises(CallFailed, match=r"'arm' at .* would overlap with 'tb3'"):
            on.ask(SET_CONFIGURATION, up)
        assert on.joint().position == 0.0
        on.ask(DELETE, Name(name="tb3"))
        on.ask(SET_CONFIGURATION, up)
        with pytest.raises(CallFailed, match=r"'tb3' at .* would overlap with 'arm'"):
            on.ask(SPAWN, SpawnModel(name="tb3", model="burger", pose=high))


def test_a_wrench_lifts_turns_and_ends() -> None:
    """In the air: 1.0037 kg under 20 N for 21 steps; then only gravity."""
    with scene(entry("tb3", "burger")) as on:
        for link, share in (("base_footprint", 0.001), ("base_link", 0.999)):
            push = Wrench(force=Vector3(z=20.0 * share))
            on.ask(
                APPLY_WRENCH,
                ApplyWrench(body_name=f"tb3::{link}", wrench=push, duration=0.1, reference_point=Point(x=-0.03)),
            )
        on.run(0.105)
        up = on.stage.world.state("tb3").linear[2]
        assert up == pytest.approx((20.0 / 1.00373 - 9.81) * 0.105, rel=0.03)
        on.run(0.05)
        assert on.stage.world.state("tb3").linear[2] == pytest.approx(up - 9.81 * 0.05, abs=0.02)


@pytest.mark.parametrize("link", ["base_footprint", "base_link"])
@pytest.mark.parametrize(("frame", "axis"), [("", 0), ("world", 0), ("tb3", 1), ("tb3::base_scan", 1)])
def test_a_wrench_is_in_the_axes_of_its_frame(link: str, frame: str, axis: int) -> None:
    """The robot looks along the world's y axis and falls."""
    with scene() as on:
        yaw = Pose(position=Point(x=3.0, z=1.0), orientation=Quaternion.from_yaw(math.pi / 2))
        on.ask(SPAWN, SpawnModel(name="tb3", model="burger", pose=yaw))
        twist = Wrench(torque=Vector3(x=0.01))
        on.ask(APPLY_WRENCH, ApplyWrench(body_name=f"tb3::{link}", reference_frame=frame, wrench=twist, duration=1.0))
        on.run(0.05)
        spin = on.stage.world.state("tb3").angular
        assert spin[axis] > 0.1
        assert abs(spin[1 - axis]) < 0.02


def test_wrenches_add_up_are_counted_cleared_and_end_with_their_body() -> None:
    with scene() as on:
        push = ApplyWrench(
            body_name="arm::bear_link",
            wrench=Wrench(force=Vector3(x=10.0)),
            duration=-1.0,
            reference_point=Point(y=-0.5),
        )
        for _ in range(2):
            assert "until it is cleared" in on.ask(APPLY_WRENCH, push).text
        on.run(3.0)
        assert on.ask(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 2
        assert on.ask(CLEAR_WRENCH, LinkName(link_name="arm::bear_link")).text == "2 jobs of arm::bear_link dropped"
        assert "it is held in the world" in on.ask(APPLY_WRENCH, ApplyWrench(body_name="arm")).text
        on.ask(APPLY_WRENCH, push)
        on.ask(DELETE, Name(name="arm"))
        on.ask(SPAWN, SpawnModel(name="arm", model="arm"))
        assert on.ask(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 0
        on.run(0.1)


def test_a_wrench_ends_with_the_entity_whose_axes_it_has() -> None:
    with scene(entry("arm"), entry("tb3", "burger", x=3.0)) as on:
        on.ask(APPLY_WRENCH, ApplyWrench(body_name="arm::bear_link", reference_frame="tb3", duration=-1.0))
        on.ask(DELETE, Name(name="tb3"))
        on.run(0.05)
        assert on.ask(LINK_PROPERTIES, LinkName(link_name="arm::bear_link")).wrenches == 0
        assert "the wrenches on arm::bear_link are dropped" in on.log


def test_states_are_seen_from_an_entity_and_set_in_its_frame() -> None:
    with scene(entry("tb3", "burger"), entry("p3dx", "p3dx", x=3.0)) as on:
        on.ask(SET_STATE, SetModelState(name="p3dx", pose=Pose.planar(3.0, 1.0, math.pi / 2)))
        seen = on.ask(GET_STATE, GetModelState(name="tb3", relative_entity="p3dx"))
        assert (seen.pose.position.x, seen.pose.position.y) == pytest.approx((-1.0, 3.0), abs=1e-6)
        assert seen.pose.orientation.yaw == pytest.approx(-math.pi / 2)
        moved = SetModelState(
            name="tb3", pose=Pose.planar(2.0, 0.0), twist=Twist.planar(0.1, 0.0), reference_frame="p3dx"
        )
        state = on.ask(SET_STATE, moved)
        assert (state.pose.position.x, state.pose.position.y) == pytest.approx((3.0, 3.0), abs=1e-6)
        assert state.pose.orientation.yaw == pytest.approx(math.pi / 2)
        assert on.stage.world.state("tb3").linear == pytest.approx((0.0, 0.1, 0.0), abs=1e-9)
        in_world = on.ask(GET_STATE, GetModelState(name="tb3", relative_entity="world"))
        assert in_world.twist.linear.y == pytest.approx(0.1)
        assert on.ask(GET_STATE, GetModelState(name="tb3")).twist.linear.x == pytest.approx(0.1)


def test_an_arm_can_be_moved_and_its_frame_follows() -> None:
    with scene() as on:
        on.ask(SET_STATE, SetModelState(name="arm", pose=Pose.planar(2.0, 1.0)))
        tip = on.ask(LINK_STATE, LinkName(link_name="arm::end_link"))
        assert (tip.pose.position.x, tip.pose.position.y, tip.pose.position.z) == pytest.approx(
            (1.9816, 1.1057, 0.5591), abs=1e-3
        )
        on.run(0.1)
        assert on.ask(GET_STATE, GetModelState(name="arm")).pose.position.x == 2.0


def test_a_link_is_told_how_its_origin_moves() -> None:
    with scene() as on:
        on.push(100.0, 0.2)
        on.run(0.2)
        tip = on.ask(LINK_STATE, LinkName(link_name="end_link"))
        rate = on.joint().rate
        v, w = tip.twist.linear, tip.twist.angular
        assert math.hypot(v.x, v.z) == pytest.approx(rate * math.hypot(0.74383, 0.00225), rel=1e-3)
        assert w.y == pytest.approx(-rate, rel=1e-3)
        own = on.ask(LINK_STATE, LinkName(link_name="end_link", reference_frame="end_link"))
        assert (own.pose.position, own.twist) == (Point(), Twist())
        assert own.pose.orientation.w == pytest.approx(1.0, abs=1e-12)


def test_a_model_is_spawned_in_a_frame_with_joints_and_parameters() -> None:
    with scene(entry("tb3", "burger", x=1.0)) as on:
        asked = SpawnModel(
            name="new",
            model="arm",
            pose=Pose.planar(2.0, 0.0),
            reference_frame="tb3",
            joint_names=("bear_link",),
            joint_positions=(0.3,),
            parameters=(Assignment(name="effort_mode", value="sum"), Assignment(name="damping", value=3)),
        )
        assert on.ask(SPAWN, asked).pose.position.x == pytest.approx(3.0)
        found = on.joint("new")
        assert (found.position, found.damping) == (0.3, 3.0)
        actuators = on.stage.find("new").actuators
        assert actuators is not None
        assert actuators.rule.mode == "sum"
        wheeled = SpawnModel(
            name="b",
            model="burger",
            parameters=(Assignment(name="cmd_vel_timeout", value=1.5),),
            pose=Pose.planar(-2.0, 0.0),
        )
        on.ask(SPAWN, wheeled)
        base = on.stage.find("b").base
        assert base is not None
        assert base.settings.timeout == 1.5


def test_properties_of_the_world_of_models_and_of_links() -> None:
    with scene(entry("arm"), entry("tb3", "burger", x=3.0, namespace="/robots/tb3")) as on:
        on.run(0.5)
        world = on.ask(WORLD_PROPERTIES, Empty())
        assert (world.sim_time.ns, world.tick, world.model_names) == (500_000_000, 100, ("arm", "tb3"))
        assert (world.time_step, world.gravity.z, world.iterations, world.obstacles) == (0.005, -9.81, 50, ("crate",))
        arm, tb3 = (on.ask(MODEL_PROPERTIES, Name(name=name)) for name in ("arm", "tb3"))
        assert (arm.links, arm.joints) == (("root", "bear_link", "end_link"), ("bear_link",))
        assert (arm.mass, arm.is_static, arm.driven) == (pytest.approx(2.001), True, False)
        assert (tb3.namespace, tb3.base_frame, tb3.driven) == ("/robots/tb3", "tb3/base_footprint", True)
        link = on.ask(LINK_PROPERTIES, LinkName(link_name="arm::bear_link"))
        assert (link.mass, link.inertia.z, link.com.position.y) == pytest.approx((2.0, 0.03565, -1.38324))
