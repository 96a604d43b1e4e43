"""Models and links: states relative to other entities, moving, spawning, and properties."""

from __future__ import annotations

import math

import pytest

from messages.gazebo import LinkName, SetConfiguration
from messages.gazebo_services import GAZEBO_REQUESTS
from messages.geometry import Point, Pose, Twist
from messages.parameters import Assignment
from messages.requests import (
    DELETE,
    GET_STATE,
    LINK_PROPERTIES,
    LINK_STATE,
    MODEL_PROPERTIES,
    SET_CONFIGURATION,
    SET_STATE,
    SIM_REQUESTS,
    SPAWN,
    WORLD_PROPERTIES,
    Name,
)
from messages.simulation import GetModelState, SetModelState, SpawnModel
from messages.std import Empty
from messages.topics import LINK_STATES, MODEL_STATES
from services.sim.actuation import BaseActuation, JointActuation
from tests.services.sim.joints.joint_simulation import robot_entry, run_joint_simulation


def test_joints_are_put_where_they_are_told() -> None:
    with run_joint_simulation() as on:
        on.publish_effort(100.0, 0.1)
        on.run(0.5)
        wanted = SetConfiguration(model="arm", joint_names=("arm::bear_link",), joint_positions=(-0.7,))
        reply = on.call(SET_CONFIGURATION, wanted)
        assert (reply.name, reply.position, reply.velocity) == (("bear_link",), (-0.7,), (0.0,))
        before = on.call(SET_CONFIGURATION, SetConfiguration(model="arm")).position
        assert before == (-0.7,), "who is not named stays"


def test_states_are_seen_from_an_entity_and_set_in_its_frame() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger"), robot_entry("p3dx", "p3dx", x=3.0)) as on:
        on.call(SET_STATE, SetModelState(name="p3dx", pose=Pose.planar(3.0, 1.0, math.pi / 2)))
        seen = on.call(GET_STATE, GetModelState(name="tb3", relative_entity="p3dx"))
        assert (seen.pose.position.x, seen.pose.position.y) == pytest.approx((-1.0, 3.0), abs=1e-6)
        assert seen.pose.orientation.yaw == pytest.approx(-math.pi / 2)
        moved = SetModelState(
            name="tb3", pose=Pose.planar(2.0, 0.0), twist=Twist.planar(0.1, 0.0), reference_frame="p3dx"
        )
        state = on.call(SET_STATE, moved)
        assert (state.pose.position.x, state.pose.position.y) == pytest.approx((3.0, 3.0), abs=1e-6)
        assert state.pose.orientation.yaw == pytest.approx(math.pi / 2)
        assert on.simulation.world.body("tb3").state().linear == pytest.approx((0.0, 0.1, 0.0), abs=1e-9)
        in_world = on.call(GET_STATE, GetModelState(name="tb3", relative_entity="world"))
        assert in_world.twist.linear.y == pytest.approx(0.1)
        assert on.call(GET_STATE, GetModelState(name="tb3")).twist.linear.x == pytest.approx(0.1)


def test_an_arm_can_be_moved_and_its_frame_follows() -> None:
    with run_joint_simulation() as on:
        on.call(SET_STATE, SetModelState(name="arm", pose=Pose.planar(2.0, 1.0)))
        tip = on.call(LINK_STATE, LinkName(link_name="arm::end_link"))
        assert (tip.pose.position.x, tip.pose.position.y, tip.pose.position.z) == pytest.approx(
            (1.9816, 1.1057, 0.5591), abs=1e-3
        )
        on.run(0.1)
        assert on.call(GET_STATE, GetModelState(name="arm")).pose.position.x == 2.0


def test_a_link_is_told_how_its_origin_moves() -> None:
    with run_joint_simulation() as on:
        on.publish_effort(100.0, 0.2)
        on.run(0.2)
        tip = on.call(LINK_STATE, LinkName(link_name="end_link"))
        rate = on.joint_properties().rate
        v, w = tip.twist.linear, tip.twist.angular
        assert math.hypot(v.x, v.z) == pytest.approx(rate * math.hypot(0.74383, 0.00225), rel=1e-3)
        assert w.y == pytest.approx(-rate, rel=1e-3)
        own = on.call(LINK_STATE, LinkName(link_name="end_link", reference_frame="end_link"))
        assert (own.pose.position, own.twist) == (Point(), Twist())
        assert own.pose.orientation.w == pytest.approx(1.0, abs=1e-12)


def test_a_model_is_spawned_in_a_frame_with_joints_and_parameters() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger", x=1.0)) as on:
        asked = SpawnModel(
            name="new",
            model="arm",
            pose=Pose.planar(2.0, 0.0),
            reference_frame="tb3",
            joint_names=("bear_link",),
            joint_positions=(0.3,),
            parameters=(Assignment(name="effort_mode", value="sum"), Assignment(name="damping", value=3)),
        )
        assert on.call(SPAWN, asked).pose.position.x == pytest.approx(3.0)
        found = on.joint_properties("new")
        assert (found.position, found.damping) == (0.3, 3.0)
        arm = on.simulation.find("new").actuation
        assert isinstance(arm, JointActuation)
        assert arm.controller.effort_rule.mode == "sum"
        wheeled = SpawnModel(
            name="b",
            model="burger",
            parameters=(Assignment(name="cmd_vel_timeout", value=1.5),),
            pose=Pose.planar(-2.0, 0.0),
        )
        on.call(SPAWN, wheeled)
        base = on.simulation.find("b").actuation
        assert isinstance(base, BaseActuation)
        assert base.controller.config.timeout == 1.5


def test_the_states_of_all_are_told_in_gazebo_s_words_while_somebody_listens() -> None:
    with run_joint_simulation(robot_entry("arm"), robot_entry("tb3", "burger", x=3.0)) as on:
        before = on.node.advertise(MODEL_STATES), on.node.advertise(LINK_STATES)
        on.run(0.2)
        assert [each.sent for each in before] == [0, 0]
        models, links = (
            on.subscribe(MODEL_STATES, "/gazebo/model_states"),
            on.subscribe(LINK_STATES, "/gazebo/link_states"),
        )
        on.call(
            SET_STATE, SetModelState(name="tb3", pose=Pose.planar(3.0, 1.0, math.pi / 2), twist=Twist.planar(0.2, 0))
        )
        on.run(0.2)
        models.update()
        links.update()
        assert (len(models.messages), len(links.messages)) == (5, 5), "25 Hz"
        (first, _), *_ = models.messages
        assert first.name == ("arm", "tb3")
        assert first.pose[1].position.y == pytest.approx(1.0, abs=0.02)
        assert first.twist[1].linear.y == pytest.approx(0.2, abs=0.02), "in the world's axes"
        on.publish_state()
        links.update()
        ((told, _),) = links.messages
        assert told.name[:3] == ("arm::root", "arm::bear_link", "arm::end_link")
        assert {each.partition("::")[0] for each in told.name} == {"arm", "tb3"}
        for name in ("arm::end_link", "tb3::base_scan"):
            asked = on.call(LINK_STATE, LinkName(link_name=name))
            at = told.name.index(name)
            assert (told.pose[at], told.twist[at]) == (asked.pose, asked.twist)
        on.call(DELETE, Name(name="tb3"))
        on.run(0.05)
        models.update()
        assert models.messages[-1][0].name == ("arm",)


def test_what_is_declared_is_served() -> None:
    with run_joint_simulation() as on:
        assert {each.request.name for each in on.node.request_handlers} == {
            each.name for each in (*SIM_REQUESTS, *GAZEBO_REQUESTS)
        }


def test_properties_of_the_world_of_models_and_of_links() -> None:
    with run_joint_simulation(robot_entry("arm"), robot_entry("tb3", "burger", x=3.0, namespace="/robots/tb3")) as on:
        on.run(0.5)
        world = on.call(WORLD_PROPERTIES, Empty())
        assert (world.sim_time.ns, world.tick, world.model_names) == (500_000_000, 100, ("arm", "tb3"))
        assert (world.time_step, world.gravity.z, world.iterations, world.obstacles) == (0.005, -9.81, 50, ("crate",))
        arm, tb3 = (on.call(MODEL_PROPERTIES, Name(name=name)) for name in ("arm", "tb3"))
        assert (arm.links, arm.joints) == (("root", "bear_link", "end_link"), ("bear_link",))
        assert (arm.mass, arm.is_static, arm.driven) == (pytest.approx(52.001), True, False), (
            "what is held has its mass, too"
        )
        assert (tb3.namespace, tb3.base_frame, tb3.driven) == ("/robots/tb3", "tb3/base_footprint", True)
        link = on.call(LINK_PROPERTIES, LinkName(link_name="arm::bear_link"))
        assert (link.mass, link.inertia.z, link.com.position.y) == pytest.approx((2.0, 0.03565, -1.38324))
