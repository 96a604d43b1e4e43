"""The world's movable and moving bodies on the network: their states, and requests for them."""

import pytest

from messages import gazebo_msgs as gz
from messages.elea import ModelState
from messages.gazebo_services import (
    APPLY_BODY_WRENCH,
    GET_LINK_STATE,
    GET_MODEL_PROPERTIES,
    GET_MODEL_STATE,
    SET_LINK_STATE,
)
from messages.geometry import Twist
from messages.requests import GET_STATE, RESET, SET_STATE, WORLD_PROPERTIES
from messages.se3 import Pose3
from messages.simulation import GetModelState, SetModelState
from messages.std import Empty
from messages.topics import LINK_STATES, MODEL_STATES, WORLD_STATES
from models.bodies import BodyPart, BodyPath, BoxShape, SphereShape, WorldBody, WorldDescription
from services.runtime.errors import CallFailed
from services.sim.parameters import RobotEntry
from tests.services.sim.joints.joint_simulation import robot_entry, run_joint_simulation

CART = BodyPath(((-2.0, 0.0, 0.25), (-1.0, 0.0, 0.25)), 0.5, "loop")
SCENE = WorldDescription(
    bodies=(
        WorldBody("ball", (BodyPart(SphereShape(0.1)),), Pose3((2.0, 0.0, 0.1)), mass=0.5),
        WorldBody("wall", (BodyPart(BoxShape((1.0, 1.0, 1.0))),), Pose3((5.0, 0.0, 0.5))),
        WorldBody("cart", (BodyPart(BoxShape((0.4, 0.4, 0.4))),), Pose3((-2.0, 0.0, 0.25)), path=CART),
    )
)


def test_states_of_what_moves_are_published_ten_times_a_second() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger", y=3.0), scene=SCENE) as on:
        states = on.subscribe(WORLD_STATES, "/world/states")
        models = on.subscribe(MODEL_STATES, "/gazebo/model_states")
        on.run(1.0)
        states.update()
        told = [message for message, _ in states.messages]
        assert len(told) == 10
        assert {each.name for each in told} == {("ball", "cart")}
        assert [each.header.stamp.ns for each in told] == [step * 100_000_000 for step in range(10)]
        models.update()
        assert models.messages[0][0].name == ("tb3", "ball", "cart"), "models for Gazebo's programs"
        assert told[5].pose[1].position.x == pytest.approx(-1.75)
        assert told[5].twist[1].linear.x == pytest.approx(0.5)
        on.call(RESET, Empty())
        on.run(0.6)
        states.update()
        again = [message for message, _ in states.messages]
        assert again[:6] == told[:6]


def test_states_for_gazebo_s_programs_follow_the_robots_that_come_and_go() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger", y=3.0), scene=SCENE) as on:
        on.simulation.delete("tb3")
        models = on.subscribe(MODEL_STATES, "/gazebo/model_states")
        links = on.subscribe(LINK_STATES, "/gazebo/link_states")
        on.run(0.1)
        on.simulation.spawn(RobotEntry(name="late", model="burger"), Pose3.planar(0.0, 1.0))
        on.run(0.1)
        for each in (models, links):
            each.update()
        told = [message for message, _ in models.messages]
        assert (told[0].name, told[-1].name) == (("ball", "cart"), ("late", "ball", "cart"))
        assert told[-1].pose[0].position.y == pytest.approx(1.0, abs=1e-3)
        told = [message for message, _ in links.messages]
        assert (told[0].name, told[0].pose, told[0].twist) == ((), (), ())
        assert told[-1].name[0].startswith("late::")
        assert len(told[-1].pose) == len(told[-1].twist) == len(told[-1].name)


def test_a_movable_body_is_asked_for_and_moved_as_a_model_is() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger", y=3.0), scene=SCENE) as on:
        on.run(0.1)
        found = on.call(GET_STATE, GetModelState(name="ball"))
        assert isinstance(found, ModelState)
        assert (found.name, found.model) == ("ball", "")
        assert found.pose.position.x == pytest.approx(2.0, abs=1e-3)
        seen = on.call(GET_STATE, GetModelState(name="ball", relative_entity="tb3"))
        assert seen.pose.position.y == pytest.approx(-3.0, abs=1e-3)
        twist = Twist.planar(0.3, 0.0)
        moved = on.call(SET_STATE, SetModelState(name="ball", pose=Pose3((0.0, 1.0, 0.1)).to_msg(), twist=twist))
        assert moved.pose.position.y == pytest.approx(1.0)
        assert moved.twist.linear.x == pytest.approx(0.3)
        for name, told in {"cart": "'cart' follows its path", "wall": "unknown model 'wall'"}.items():
            with pytest.raises(CallFailed, match=told):
                on.call(SET_STATE, SetModelState(name=name, pose=Pose3((0.0, 8.0, 0.3)).to_msg()))
        with pytest.raises(CallFailed, match=r"'ball' at .* would overlap with wall"):
            on.call(SET_STATE, SetModelState(name="ball", pose=Pose3((5.0, 0.0, 0.3)).to_msg()))
        assert on.call(WORLD_PROPERTIES, Empty()).obstacles == ("ball", "wall", "cart")


def test_gazebo_s_name_of_the_link_of_a_body() -> None:
    with run_joint_simulation(robot_entry("tb3", "burger", y=3.0), scene=SCENE) as on:
        of = on.call(GET_MODEL_PROPERTIES, gz.GetModelProperties(model_name="ball"))
        link = f"ball::{of.canonical_body_name}"
        found = on.call(GET_LINK_STATE, gz.GetLinkState(link_name=link, reference_frame="tb3"))
        assert found.success, found.status_message
        assert (found.link_state.pose.position.x, found.link_state.pose.position.y) == pytest.approx((2.0, -3.0))
        seen = on.call(GET_MODEL_STATE, gz.GetModelState(model_name="tb3", relative_entity_name=link))
        assert (seen.pose.position.x, seen.pose.position.y) == pytest.approx((-2.0, 3.0))
        state = gz.LinkState(link_name=link, pose=Pose3((1.0, 0.0, 0.1)).to_msg())
        assert on.call(SET_LINK_STATE, gz.SetLinkState(link_state=state)).success
        assert on.simulation.world.world_body_state("ball").position[0] == pytest.approx(1.0)
        refused = on.call(APPLY_BODY_WRENCH, gz.ApplyBodyWrench(body_name=link))
        assert "ball is a body of the world: wrenches act on the links of spawned" in refused.status_message
