"""The transform tree: lookups between any two frames at any known time, and errors with their cause."""

from __future__ import annotations

import math

import pytest
from hypothesis import given

from messages.geometry import Quaternion, Transform, TransformStamped, Vector3
from messages.se3 import IDENTITY, Pose3
from messages.std import Header, Time
from services.runtime.errors import Extrapolation, FrameLoop, NotConnected, NoTransform, UnknownFrame
from services.runtime.tf import buffer as frame_buffer
from services.runtime.tf.authority import MAX_AUTHORITIES
from services.runtime.tf.buffer import TransformBuffer, pose_in_world
from tests.messages.test_se3 import poses, same

S = 1_000_000_000
SIM, STATE = b"sim", b"state"


def tf(parent: str, child: str, rigid: Pose3 = IDENTITY, seconds: float = 0.0) -> TransformStamped:
    header = Header(stamp=Time.of(round(seconds * S)), frame_id=parent)
    return TransformStamped(header=header, child_frame_id=child, transform=rigid.to_transform())


def at(x: float, yaw: float = 0.0) -> Pose3:
    return Pose3((x, 0.0, 0.0), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))


@pytest.fixture
def robot() -> TransformBuffer:
    """World, odometry and base frames of two robots over two seconds, and a laser on the first."""
    buffer = TransformBuffer()
    buffer.add_static([tf("world", "a/odom", at(1.0)), tf("a/base", "a/laser", at(0.1)), tf("world", "b/odom")], SIM)
    for tick in range(51):
        t = tick / 25
        buffer.add([tf("a/odom", "a/base", at(t), t), tf("b/odom", "b/base", at(-t, t), t)], SIM)
    return buffer


def test_any_frame_is_found_in_any_other(robot: TransformBuffer) -> None:
    assert robot.lookup("world", "a/laser", S).transform.position == pytest.approx((2.1, 0, 0))
    assert robot.lookup("a/laser", "world", S).transform.position == pytest.approx((-2.1, 0, 0))
    assert robot.lookup("b/odom", "a/laser", S).transform.position == pytest.approx((2.1, 0, 0))
    between = robot.lookup("a/laser", "b/base", S)
    assert (between.time, between.transform.position) == (S, pytest.approx((-3.1, 0, 0)))
    assert between.transform.rpy[2] == pytest.approx(1.0)
    assert robot.lookup("a/base", "a/base").transform == IDENTITY


@given(poses(), poses(), poses(), poses())
def test_a_chain_is_the_product_of_its_links(a: Pose3, b: Pose3, c: Pose3, d: Pose3) -> None:
    buffer = TransformBuffer()
    buffer.add_static([tf("root", "left", a), tf("left", "far left", b)], SIM)
    buffer.add([tf("root", "right", c, 1), tf("right", "far right", d, 1)], SIM)
    wanted = a.compose(b).inverse().compose(c.compose(d))
    found = buffer.lookup("far left", "far right")
    assert (found.time, same(found.transform, wanted, 1e-8)) == (S, True)
    assert same(buffer.lookup("far right", "far left", S).transform, wanted.inverse(), 1e-7)


def test_between_two_samples_it_is_interpolated(robot: TransformBuffer) -> None:
    found = robot.lookup("world", "b/base", round(0.99 * S)).transform
    assert found.position == pytest.approx((-0.99, 0, 0))
    assert found.rpy[2] == pytest.approx(0.99)


def test_without_a_time_it_is_the_latest_that_all_have(robot: TransformBuffer) -> None:
    robot.add([tf("a/odom", "a/base", at(3.0), 3.0)], SIM)
    assert robot.lookup("world", "a/base").time == 3 * S
    assert robot.lookup("a/base", "b/base").time == 2 * S


def test_fixed_frames_are_known_at_any_time(robot: TransformBuffer) -> None:
    for time in (None, 0, 10**15):
        found = robot.lookup("b/odom", "a/odom", time)
        assert (found.time, found.transform.position) == (time, (1.0, 0.0, 0.0))


@pytest.mark.parametrize(("time", "told"), [(2.5, "future by 0.500 s"), (-1.0, "past by 1.000 s")])
def test_it_does_not_extrapolate(robot: TransformBuffer, time: float, told: str) -> None:
    with pytest.raises(Extrapolation, match=told) as raised:
        robot.lookup("world", "a/laser", round(time * S))
    assert "0.000 to 2.000 s is known" in str(raised.value)
    assert "'a/base'" in str(raised.value)


def test_one_sample_is_known_at_its_own_time_alone() -> None:
    buffer = TransformBuffer()
    buffer.add([tf("world", "base", at(1.0), 5)], SIM)
    assert buffer.lookup("world", "base", 5 * S).transform == at(1.0)
    with pytest.raises(Extrapolation, match=r"only 5\.000 s is known"):
        buffer.lookup("world", "base", 5 * S + 1)


def test_an_unknown_frame_is_told_with_the_nearest_and_all(robot: TransformBuffer) -> None:
    with pytest.raises(UnknownFrame, match="'a/lasr' is unknown; did you mean 'a/laser'") as raised:
        robot.lookup("world", "a/lasr")
    assert "known: a/base, a/laser, a/odom, b/base, b/odom, world" in str(raised.value)
    with pytest.raises(UnknownFrame, match="no transform was received"):
        TransformBuffer().lookup("world", "base")


def test_two_trees_are_told(robot: TransformBuffer) -> None:
    robot.add_static([tf("map", "table"), tf("table", "cup")], STATE)
    with pytest.raises(NotConnected) as raised:
        robot.lookup("a/laser", "cup")
    assert "'world' with a/base, a/laser, a/odom, b/base, b/odom; and 'map' with cup, table" in str(raised.value)


def test_a_loop_is_told() -> None:
    buffer = TransformBuffer()
    buffer.add_static([tf("a", "b"), tf("b", "c"), tf("c", "a")], SIM)
    with pytest.raises(FrameLoop, match="a in c in b in a"):
        buffer.lookup("a", "b")


def test_a_frame_with_two_parents_is_told(robot: TransformBuffer) -> None:
    assert robot.conflicts() == {}
    robot.add([tf("b/odom", "a/base", at(9.0), 2.0)], STATE)
    assert robot.lookup("a/odom", "a/base").transform.position[0] == 2.0, "who told it first for a stamp is believed"
    assert robot.conflicts() == {"a/base": "frame 'a/base' has 2 parents, 'a/odom' and 'b/odom'"}
    robot.add_static([tf("world", "a/odom")], STATE)
    assert robot.conflicts()["a/odom"] == "frame 'a/odom' has 2 publishers"
    assert robot.publishers("a/odom") == [SIM, STATE]
    robot.add([tf("a/odom", "a/base", at(3.0), 13.0)], SIM)
    assert "a/base" not in robot.conflicts(), "the other one fell silent"


def test_a_frame_may_change_its_parent_with_time() -> None:
    buffer = TransformBuffer()
    buffer.add_static([tf("world", "table", at(5.0)), tf("world", "hand", at(1.0))], SIM)
    buffer.add([tf("table", "cup", IDENTITY, 1), tf("hand", "cup", IDENTITY, 2)], SIM)
    assert buffer.lookup("world", "cup", S).transform.position[0] == 5.0
    assert buffer.lookup("world", "cup", S + S // 2).transform.position[0] == 5.0
    assert buffer.lookup("world", "cup", 2 * S).transform.position[0] == 1.0
    assert buffer.conflicts() == {}


def test_old_and_repeated_data_are_dropped(robot: TransformBuffer) -> None:
    robot.add([tf("a/odom", "a/base", at(99.0), 1.0)], SIM)
    assert (robot.repeated, robot.old) == (1, 0)
    robot.add([tf("a/odom", "a/base", at(50.0), 50.0)], SIM)
    robot.add([tf("a/odom", "a/base", at(99.0), 39.0)], SIM)
    assert (robot.repeated, robot.old) == (1, 1)
    robot.add([tf("a/odom", "a/base", at(45.0), 45.0)], SIM)
    assert robot.lookup("a/odom", "a/base", round(47.5 * S)).transform.position[0] == pytest.approx(47.5)


def test_the_past_is_kept_for_the_cache(robot: TransformBuffer) -> None:
    for tick in range(50, 400):
        robot.add([tf("a/odom", "a/base", at(tick / 25), tick / 25)], SIM)
    assert robot.span("a/base") == (round(5.96 * S), round(15.96 * S))
    with pytest.raises(Extrapolation, match="the past is kept for 10 s"):
        robot.lookup("world", "a/base", S)


def test_a_publisher_tells_all_its_fixed_frames_anew(robot: TransformBuffer) -> None:
    robot.add_static([tf("world", "table")], STATE)
    robot.add_static([tf("world", "chair")], STATE)
    assert "table" not in robot.frames()
    assert {"chair", "a/odom", "a/laser"} <= set(robot.frames())
    robot.add_static([tf("world", "one")], b"")
    robot.add_static([tf("world", "two")], b"")
    assert {"one", "two", "chair"} <= set(robot.frames()), "unknown senders cannot be told apart"


def test_a_new_time_forgets_what_moves_and_keeps_what_is_fixed(robot: TransformBuffer) -> None:
    robot.clear()
    assert robot.lookup("b/odom", "a/odom").transform.position == (1.0, 0.0, 0.0)
    with pytest.raises(NoTransform):
        robot.lookup("world", "b/base")
    robot.add([tf("a/odom", "a/base", at(0.5), 0.0)], SIM)
    assert robot.lookup("world", "a/laser").transform.position == pytest.approx((1.6, 0, 0))


@pytest.mark.parametrize(
    ("transform", "reason"),
    [
        (tf("", "base"), "without a name"),
        (tf("world", ""), "without a name"),
        (tf("world", "/"), "without a name"),
        (tf("base", "/base"), "its own parent"),
        (
            TransformStamped(
                header=Header(frame_id="world"), child_frame_id="base", transform=Transform(rotation=Quaternion(w=0))
            ),
            "not a unit quaternion",
        ),
        (
            TransformStamped(
                header=Header(frame_id="world"),
                child_frame_id="base",
                transform=Transform(rotation=Quaternion(x=math.nan)),
            ),
            "not a unit quaternion",
        ),
        (tf("world", "base", at(math.nan)), "not finite"),
        (tf("world", "base", at(math.inf)), "not finite"),
    ],
)
def test_nonsense_is_refused_and_counted(transform: TransformStamped, reason: str) -> None:
    buffer = TransformBuffer()
    buffer.add([transform], SIM)
    buffer.add_static([transform], SIM)
    assert buffer.refused == 2
    assert reason in buffer.reason
    assert buffer.frames() == []


def test_a_leading_slash_is_no_part_of_a_name(robot: TransformBuffer) -> None:
    robot.add([tf("/a/base", "/a/hand", at(0.2), 2.0)], SIM)
    assert robot.lookup("/world", "/a/hand").transform.position == pytest.approx((3.2, 0, 0))


def test_a_frame_is_what_it_was_told_as_last() -> None:
    """As in tf2: static after moving, moving after static, and the later of two publishers of a static frame."""
    buffer = TransformBuffer()
    buffer.add([tf("world", "cup", at(1.0), 1), tf("world", "cup", at(2.0), 2)], SIM)
    buffer.add_static([tf("table", "cup", at(9.0)), tf("world", "table")], STATE)
    assert (buffer.parent("cup"), buffer.span("cup")) == ("table", None)
    assert buffer.lookup("world", "cup", 77 * S).transform == at(9.0)
    buffer.add([tf("world", "cup", at(3.0), 3)], SIM)
    assert buffer.lookup("world", "cup") == (3 * S, at(3.0))
    for sender, x in ((STATE, 4.0), (SIM, 5.0), (STATE, 6.0)):
        buffer.add_static([tf("world", "lamp", at(x)), tf("world", "table")], sender)
        assert buffer.lookup("world", "lamp").transform == at(x)


def test_a_frame_lies_in_itself_at_the_time_that_is_asked_for(robot: TransformBuffer) -> None:
    """As in tf2: without a time, the frame's latest; the frame doesn't have to exist."""
    assert robot.lookup("a/base", "/a/base") == (2 * S, IDENTITY)
    assert robot.lookup("a/base", "a/base", 77 * S) == (77 * S, IDENTITY)
    assert robot.lookup("world", "world") == (None, IDENTITY)
    assert robot.lookup("nobody", "nobody", S) == (S, IDENTITY)
    with pytest.raises(UnknownFrame):
        robot.lookup("", "")


def test_a_frame_is_placed_in_the_world_at_the_stamp_or_else_at_the_latest_known_time(robot: TransformBuffer) -> None:
    def x(frame: str, seconds: float) -> float:
        return pose_in_world(robot, Header(stamp=Time.of(round(seconds * S)), frame_id=frame)).position[0]

    assert (x("/a/base", 1.0), x("a/base", 0.0), x("a/base", 77.0)) == pytest.approx((2.0, 3.0, 3.0))
    for frame in ("", "world", "/world", "unknown"):
        assert pose_in_world(robot, Header(frame_id=frame)) == IDENTITY


def test_a_frame_of_the_past_is_found_through_one_that_stands_still(robot: TransformBuffer) -> None:
    """a/base has x = t in a/odom: a second earlier it was 1 m behind; at 0 s, 2 m from where b/base was at 1 s."""
    assert robot.lookup_full("a/base", 2 * S, "a/base", S, "a/odom") == (2 * S, at(-1.0))
    assert robot.lookup_full("a/base", None, "a/laser", S, "world").transform.position == pytest.approx((-0.9, 0, 0))
    moved = robot.lookup_full("b/base", S, "a/base", 0, "world")
    assert moved.transform.position[:2] == pytest.approx((2 * math.cos(1.0), -2 * math.sin(1.0)))
    with pytest.raises(Extrapolation, match="future"):
        robot.lookup_full("a/base", 3 * S, "a/base", S, "a/odom")
    with pytest.raises(UnknownFrame, match="'a/odon' is unknown; did you mean 'a/odom'"):
        robot.lookup_full("a/base", S, "a/base", S, "a/odon")


def test_a_flood_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_buffer, "MAX_FRAMES", 10)
    buffer = TransformBuffer()
    for number in range(20):
        buffer.add([tf("world", f"f{number}", IDENTITY, 1.0)], SIM)
    assert (len(buffer.frames()), buffer.refused) == (11, 10)
    buffer.add([tf("world", "f0", IDENTITY, 100.0), tf("world", "new", IDENTITY, 100.0)], SIM)
    assert buffer.lookup("f0", "new").time == 100 * S, "the frames that fell silent made room"


def test_a_sender_that_names_ever_new_parents_or_poses_as_ever_new_nodes_fills_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(frame_buffer, "MAX_FRAMES", 10)
    buffer = TransformBuffer(cache_s=0.5)
    for number in range(500):
        buffer.add([tf(f"p{number}", "a", seconds=number)], number.to_bytes(6, "big"))
    assert len(buffer.frames()) < 30
    assert len(buffer.publishers("a")) == 1
    assert len(buffer._claims._of["a"]) <= MAX_AUTHORITIES
    assert buffer.parent("a") == "p499"
    assert buffer.lookup("p499", "a").transform == IDENTITY


def test_a_bad_transform_does_not_cost_the_good_ones_beside_it() -> None:
    buffer = TransformBuffer()
    bad = TransformStamped(header=Header(frame_id="world"), transform=Transform(translation=Vector3(x=1)))
    buffer.add([bad, tf("world", "good", at(1.0), 1)], SIM)
    assert buffer.frames() == ["good", "world"]
    assert buffer.refused == 1
