"""The set of a model's joints while they move: what changes at once, whole or not at all, and who owns the values."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from messages.requests import DELETE, RESET, SPAWN, Name
from messages.simulation import Assignment, SpawnModel
from messages.std import Empty
from tests.joints.scene import Scenery, entry, scene
from tests.runtime.authority import Authority
from tests.waiting import until

SET = "/arm/joints"


@contextmanager
def tuned(**parameters: Any) -> Iterator[tuple[Scenery, Authority]]:
    """An arm whose set a parameter service by hand knows."""
    with scene(entry("arm", joint_parameters=parameters)) as on, Authority(on.bus) as params:
        until(lambda: on.node.turn() or params.announced)
        yield on, params


def tell(on: Scenery, params: Authority, **values: Any) -> None:
    params.publish(SET, values)
    on.run(0.02)


def test_the_set_is_told_with_the_figures_of_its_urdf_and_fleet() -> None:
    with tuned(effort_mode="sum", friction=2.0) as (_, params):
        (asked,) = params.announced
        described = {each.name: each for each in asked.parameters}
        assert (asked.set, asked.node) == (SET, "/sim")
        assert {each.name: each.value for each in asked.fleet} == {"effort_mode": "sum", "friction": 2.0}
        assert (described["damping"].default, described["friction"].default) == (0.0, 0.0)
        assert [each.name for each in asked.parameters if not each.live] == ["enable_link_tf"]


def test_how_efforts_become_one_changes_while_they_act() -> None:
    with tuned() as (on, params):
        tell(on, params, effort_mode="sum")
        assert on.log.count('effort_mode = "sum": jobs that overlap add up') == 1
        on.push(900.0, 0.5)
        on.push(900.0, 0.5)
        on.run(0.01)
        assert (on.joint().applied_effort, on.joint().jobs) == (1000.0, 2)
        tell(on, params, effort_clamp="each")
        assert on.joint().applied_effort == 1800.0
        tell(on, params, effort_mode="replace")
        assert (on.joint().applied_effort, on.joint().jobs) == (900.0, 1)
        tell(on, params, velocity_rule="gazebo")
        assert on.joint().rate > 0
        assert on.joint().applied_effort == 0.0, "it moves, and 0 is its fastest"


def test_damping_and_friction_change_while_it_swings_and_stay_after_a_reset() -> None:
    with tuned() as (on, params):
        on.run(0.5)
        tell(on, params, damping=500.0)
        assert on.joint().damping == 500.0
        before = on.joint().position
        on.run(0.5)
        assert abs(on.joint().position - before) < 0.02, "it creeps"
        tell(on, params, damping=None, friction=50.0)
        assert (on.joint().damping, on.joint().friction) == (0.0, 50.0)
        before = on.joint().position
        on.run(1.0)
        assert on.joint().position == pytest.approx(before, abs=1e-3), "gravity asks for 14 N m"
        on.ask(RESET, Empty())
        on.run(1.0)
        assert on.joint().position == pytest.approx(0.0, abs=1e-3)
        tell(on, params, friction=0.0)
        on.run(1.0)
        assert abs(on.joint().position) > 0.02, "nothing holds it"


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
        on.push(30.0)
        on.push(20.0)
        on.run(0.01)
        assert on.joint().applied_effort == 20.0
        until(lambda: on.node.turn() or params.undone)
        assert says in params.undone[0].who
        assert says in on.log


def test_one_that_is_spawned_has_a_set_and_one_that_is_gone_has_none() -> None:
    with tuned() as (on, params):
        on.ask(DELETE, Name(name="arm"))
        assert not any(each.name.startswith(SET) for each in on.node.inputs)
        told = (Assignment(name="damping", value=3.0),)
        on.ask(SPAWN, SpawnModel(name="arm", model="arm_corrected", namespace="left", parameters=told))
        until(lambda: on.node.turn() or len(params.announced) > 1)
        assert params.announced[-1].set == "/left/joints"
        params.publish("/left/joints", {"damping": 4.0})
        on.run(0.02)
        assert on.joint().damping == 4.0
