"""The transforms of a robot's links, by the rules of robot_state_publisher."""

from __future__ import annotations

import pytest

from messages.sensor import JointState
from messages.std import Header, Time
from models.urdf import parse_urdf
from services.state.link_transforms import LinkTransforms
from tests.services.state.sample_urdfs import GRIPPER, joint_urdf, robot_urdf

MS = 1_000_000


def state(ms: int, **positions: float) -> JointState:
    header = Header(stamp=Time.of(ms * MS))
    return JointState(header=header, name=tuple(positions), position=tuple(positions.values()))


def links(ignore: bool = False) -> LinkTransforms:
    return LinkTransforms(parse_urdf(GRIPPER), "tb3_0/", 20 * MS, ignore)


def told(of: LinkTransforms, states: JointState, now: int | None = None) -> dict[str, float]:
    """Return the moving child frames, each with the largest component of its transform."""
    transforms = of.moving_transforms(states, states.header.stamp.ns if now is None else now).transforms
    return {
        each.child_frame_id: max(
            (each.transform.translation.x, each.transform.translation.y, each.transform.translation.z), key=abs
        )
        for each in transforms
    }


def test_fixed_joints_are_told_all_together_with_prefixes() -> None:
    first, second = links().fixed_transforms(5 * MS)
    assert (first.header.frame_id, first.child_frame_id) == ("tb3_0/base", "tb3_0/post")
    assert (first.header.stamp.ns, first.transform.translation.z) == (5 * MS, 0.5)
    assert (second.header.frame_id, second.child_frame_id) == ("tb3_0/hand", "eye"), "a leading slash: no prefix"


def test_a_joint_state_moves_its_joints_with_its_own_stamp() -> None:
    transforms = links().moving_transforms(state(40, shoulder=0.5, nobody=1.0), 45 * MS).transforms
    assert [(each.header.frame_id, each.child_frame_id) for each in transforms] == [("tb3_0/post", "tb3_0/arm")]
    assert transforms[0].header.stamp.ns == 40 * MS
    assert transforms[0].transform.rotation.y == pytest.approx(0.24740395925452294)


def test_followers_move_with_their_leader_through_chains() -> None:
    found = told(links(), state(0, right=0.03))
    assert found == pytest.approx({"tb3_0/right_finger": 0.03, "tb3_0/left_finger": -0.029, "tb3_0/nail": 0.0})
    nail = next(
        each
        for each in links().moving_transforms(state(0, right=0.03), 0).transforms
        if each.child_frame_id.endswith("nail")
    )
    assert nail.transform.rotation.x == pytest.approx(-0.14449240311)


def test_what_a_joint_state_says_of_a_follower_counts_more() -> None:
    assert told(links(), state(0, right=0.03, left=-0.01))["tb3_0/left_finger"] == pytest.approx(-0.01)


def test_a_follower_without_its_leader_stays_where_it_is() -> None:
    assert told(links(), state(0, shoulder=0.1)).keys() == {"tb3_0/arm"}


def test_each_joint_is_told_at_most_fifty_times_a_second() -> None:
    of = links()
    assert [len(told(of, state(ms, shoulder=0.1))) for ms in (0, 10, 19, 20, 30, 40)] == [1, 0, 0, 1, 0, 1]
    assert told(of, state(50, shoulder=0.1, wrist=0.1)).keys() == {"tb3_0/hand"}, "each joint for itself"
    always = links(ignore=True)
    assert [len(told(always, state(ms, shoulder=0.1))) for ms in (0, 1, 1)] == [1, 1, 1]


def test_one_stamp_from_the_future_does_not_silence_a_joint() -> None:
    of = links()
    assert told(of, state(3_600_000, shoulder=0.1), now=100 * MS)
    assert not told(of, state(140, shoulder=0.1), now=140 * MS)
    assert told(of, state(1200, shoulder=0.1), now=1200 * MS)


def test_time_going_back_tells_all_again() -> None:
    of = links()
    assert told(of, state(9000, shoulder=0.1))
    assert not told(of, state(0, shoulder=0.1))
    of.reset()
    assert told(of, state(0, shoulder=0.1))


def test_what_makes_no_sense_is_refused_and_counted() -> None:
    of = links()
    assert "no positions" in of.moving_transforms(JointState(name=("shoulder",)), 0).warning
    assert "twice" in of.moving_transforms(JointState(name=("wrist", "wrist"), position=(1, 2)), 0).warning
    assert of.rejected == 2


def test_an_old_joint_state_is_told_and_complained_of() -> None:
    late = links().moving_transforms(state(0, shoulder=0.1), 30_001 * MS)
    assert len(late.transforms) == 1
    assert late.warning.startswith("the joint state is 30.0 s old")
    assert links().moving_transforms(state(0, shoulder=0.1), 30_000 * MS).warning == ""


def test_joints_that_float_have_no_frames() -> None:
    of = LinkTransforms(
        parse_urdf(robot_urdf(joint_urdf("f", "floating", "a", "b"), joint_urdf("p", "planar", "b", "c"))), "", 20 * MS
    )
    assert of.frames == frozenset()
    assert of.fixed_transforms(0) == of.moving_transforms(state(0, f=1.0), 0).transforms == ()


def test_a_follower_that_would_be_endlessly_far_is_left_out() -> None:
    chain = [joint_urdf("j0", "continuous", "l0", "l1")]
    chain += [
        joint_urdf(f"j{n}", "continuous", f"l{n}", f"l{n + 1}", f'<mimic joint="j{n - 1}" multiplier="1e6"/>')
        for n in range(1, 60)
    ]
    moved = (
        LinkTransforms(parse_urdf(robot_urdf(*chain)), "", 20 * MS).moving_transforms(state(0, j0=1.0), 0).transforms
    )
    assert [each.child_frame_id for each in moved] == ["l1", "l2", "l3"]
