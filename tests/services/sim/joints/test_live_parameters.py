"""Parameters of a model's joints while they move: immediate, atomic changes, and the owner of the values."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from messages.requests import DELETE, RESET, SPAWN, Name
from messages.simulation import Assignment, SpawnModel
from messages.std import Empty
from tests.harness.fake_parameter_service import FakeParameterService
from tests.harness.waiting import wait_until
from tests.services.sim.joints.joint_simulation import JointSimulation, robot_entry, run_joint_simulation

SET = "/arm/joints"


@contextmanager
def tuned(**parameters: Any) -> Iterator[tuple[JointSimulation, FakeParameterService]]:
    """Run an arm whose parameter set a fake parameter service owns."""
    with (
        run_joint_simulation(robot_entry("arm", joint_parameters=parameters)) as on,
        FakeParameterService(on.bus) as params,
    ):
        wait_until(lambda: on.node.spin_once() or params.announcements)
        yield on, params


def tell(on: JointSimulation, params: FakeParameterService, **values: Any) -> None:
    params.publish(SET, values)
    on.run(0.02)


def test_the_set_is_told_with_the_figures_of_its_urdf_and_fleet() -> None:
    with tuned(effort_mode="sum", friction=2.0) as (_, params):
        (asked,) = params.announcements
        described = {each.name: each for each in asked.parameters}
        assert (asked.set, asked.node) == (SET, "/sim")
        assert {each.name: each.value for each in asked.fleet} == {"effort_mode": "sum", "friction": 2.0}
        assert (described["damping"].default, described["friction"].default) == (0.0, 0.0)
        assert [each.name for each in asked.parameters if not each.live] == ["enable_link_tf"]


def test_how_efforts_become_one_changes_while_they_act() -> None:
    with tuned() as (on, params):
        tell(on, params, effort_mode="sum")
        assert on.log.count('effort_mode = "sum": jobs that overlap add up') == 1
        on.publish_effort(900.0, 0.5)
        on.publish_effort(900.0, 0.5)
        on.run(0.01)
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (1000.0, 2)
        tell(on, params, effort_clamp="each")
        assert on.joint_properties().applied_effort == 1800.0
        tell(on, params, effort_mode="replace")
        assert (on.joint_properties().applied_effort, on.joint_properties().jobs) == (900.0, 1)
        tell(on, params, velocity_rule="gazebo")
        assert on.joint_properties().rate > 0
        assert on.joint_properties().applied_effort == 0.0, "it moves, and 0 is its fastest"


def test_damping_and_friction_change_while_it_swings_and_stay_after_a_reset() -> None:
    with tuned() as (on, params):
        on.run(0.5)
        tell(on, params, damping=500.0)
        assert on.joint_properties().damping == 500.0
        before = on.joint_properties().position
        on.run(0.5)
        assert abs(on.joint_properties().position - before) < 0.02, "it creeps"
        tell(on, params, damping=None, friction=50.0)
        assert (on.joint_properties().damping, on.joint_properties().friction) == (0.0, 50.0)
        before = on.joint_properties().position
        on.run(1.0)
        assert on.joint_properties().position == pytest.approx(before, abs=1e-3), "gravity asks for 14 N m"
        on.call(RESET, Empty())
        on.run(1.0)
        assert on.joint_properties().position == pytest.approx(0.0, abs=1e-3)
        tell(on, params, friction=0.0)
        on.run(1.0)
        assert abs(on.joint_properties().position) > 0.02, "nothing holds it"


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"damping": -1.0, "effort_mode": "sum"}, "damping = -1"),
        ({"velocity_rule": "none", "effort_mode": "sum"}, "velocity_rule = 'none'"),
    ],
)
def test_what_is_out_of_bounds_changes_nothing_and_is_taken_back(values: dict[str, Any], says: str) -> None:
    with tuned() as (on, params):
        tell(on, params, **values)
        on.publish_effort(30.0)
        on.publish_effort(20.0)
        on.run(0.01)
        assert on.joint_properties().applied_effort == 20.0
        wait_until(lambda: on.node.spin_once() or params.undo_requests)
        assert says in params.undo_requests[0].who
        assert says in on.log


def test_one_that_is_spawned_has_a_set_and_one_that_is_gone_has_none() -> None:
    with tuned() as (on, params):
        on.call(DELETE, Name(name="arm"))
        assert not any(each.name.startswith(SET) for each in on.node.subscribers)
        told = (Assignment(name="damping", value=3.0),)
        on.call(SPAWN, SpawnModel(name="arm", model="arm_corrected", namespace="left", parameters=told))
        # In any order: the new set, and that the deleted model's set is no longer used.
        wait_until(lambda: on.node.spin_once() or len(params.announcements) == 3)
        assert {(each.set, each.leaves) for each in params.announcements} == {
            (SET, False),
            (SET, True),
            ("/left/joints", False),
        }
        params.publish("/left/joints", {"damping": 4.0})
        on.run(0.02)
        assert on.joint_properties().damping == 4.0
