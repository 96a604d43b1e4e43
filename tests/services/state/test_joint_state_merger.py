"""Joint states are merged by the rules of joint_state_publisher."""

from __future__ import annotations

from typing import Any

import pytest

from messages.sensor import JointState
from models.urdf import BadUrdf, parse_urdf
from services.state import StateParameters
from services.state.joint_state_merger import JointStateMerger
from tests.services.state.sample_urdfs import GRIPPER, joint_urdf, robot_urdf


def merger(urdf: str = GRIPPER, **values: Any) -> JointStateMerger:
    return JointStateMerger(parse_urdf(urdf), StateParameters(**values))


def positions(of: JointStateMerger) -> dict[str, float]:
    state = of.merged(0)
    return dict(zip(state.name, state.position, strict=True)) if state else {}


def told(**values: float) -> JointState:
    return JointState(name=tuple(values), position=tuple(values.values()))


def test_without_a_source_nothing_is_told_unless_asked_for() -> None:
    assert merger().merged(0) is None


def test_default_positions_are_zero_or_amid_the_limits() -> None:
    found = positions(merger(publish_default_positions=True))
    wanted = {"shoulder": 0, "wrist": 0, "right": 0.03, "left": -0.029, "tip": -0.29}
    assert found == pytest.approx(wanted)
    state = merger(publish_default_positions=True).merged(7_000_000)
    assert state is not None
    assert (state.header.stamp.ns, state.velocity, state.effort) == (7_000_000, (), ())


def test_zeros_may_be_other_than_zero() -> None:
    found = positions(merger(publish_default_positions=True, zeros=("shoulder=1.5", "right=0.02")))
    assert (found["shoulder"], found["left"]) == (1.5, pytest.approx(-0.019))


def test_sources_are_merged_and_the_last_word_counts() -> None:
    of = merger()
    of.add(told(shoulder=0.3, nobody=9.0))
    of.add(JointState(name=("right",), position=(0.04,), velocity=(0.5,)))
    of.add(told(shoulder=0.4))
    of.add(JointState(name=("wrist",), velocity=(1.0,)))
    of.add(told(left=5.0))
    assert positions(of) == pytest.approx({"shoulder": 0.4, "right": 0.04, "left": -0.039, "tip": -0.39})


def test_velocities_and_efforts_come_when_all_have_them() -> None:
    of = merger(publish_default_positions=True, publish_default_velocities=True, publish_default_efforts=True)
    of.add(JointState(name=("right",), position=(0.04,), velocity=(0.5,), effort=(2.0,)))
    state = of.merged(0)
    assert state is not None
    assert dict(zip(state.name, state.velocity, strict=True)) == {
        "shoulder": 0.0,
        "wrist": 0.0,
        "right": 0.5,
        "left": -0.5,
        "tip": -5.0,
    }
    assert dict(zip(state.name, state.effort, strict=True))["left"] == 2.0


def test_joints_may_depend_on_others_by_parameters() -> None:
    of = merger(dependent_joints=("wrist=shoulder*-2+0.5", "left = right"), use_mimic_tags=False)
    of.add(told(shoulder=0.1, right=0.02, tip=0.7))
    assert positions(of) == pytest.approx({"shoulder": 0.1, "wrist": 0.3, "right": 0.02, "left": 0.02, "tip": 0.7})


def test_the_smallest_limits_count() -> None:
    soft = '<limit lower="0" upper="2"/><safety_controller soft_lower_limit="1" k_velocity="1"/>'
    urdf = robot_urdf(joint_urdf("j", "revolute", "a", "b", soft))
    assert positions(merger(urdf, publish_default_positions=True)) == {"j": 1.5}
    assert positions(merger(urdf, publish_default_positions=True, use_smallest_joint_limits=False)) == {"j": 0.0}


def test_joints_without_a_source_go_to_and_fro() -> None:
    of = merger(publish_default_positions=True, delta=0.75)
    of.add(told(wrist=0.1))
    seen = []
    for _ in range(8):
        seen.append(positions(of)["shoulder"])
        of.step_defaults()
    assert seen == [0, 0.75, 1.5, 2, 1.25, 0.5, -0.25, -1]
    assert positions(of)["wrist"] == 0.1


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"zeros": ("elbow=1",)}, "no joint 'elbow' that moves .known: shoulder, wrist"),
        ({"zeros": ("mount=1",)}, "no joint 'mount' that moves"),
        ({"zeros": ("shoulder",)}, "not joint=number"),
        ({"zeros": ("shoulder=nan",)}, "not joint=number"),
        ({"zeros": ("shoulder=3",)}, "shoulder = 3 is outside -1 to 2"),
        ({"zeros": ("left=0",)}, "'left' follows 'right'"),
        ({"dependent_joints": ("left",)}, "not joint=other"),
        ({"dependent_joints": ("left=thumb",)}, "no joint 'thumb'"),
        ({"dependent_joints": ("shoulder=wrist", "wrist=shoulder")}, "in a loop"),
        ({"dependent_joints": ("right=tip",)}, "in a loop"),
    ],
)
def test_what_its_joints_do_not_allow_is_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises(BadUrdf, match=text):
        merger(**values)
