"""The service process with a simulated robot, a foreign URDF, bad input, a reset, and lockstep."""

from __future__ import annotations

import json
import time
from itertools import pairwise
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.requests import RESET
from messages.se3 import Pose3
from messages.sensor import JointState
from messages.std import Empty, Header, String, Time
from messages.tf import TFMessage
from messages.topics import CMD_VEL, HEALTH, JOINT_STATES, ROBOT_DESCRIPTION, TF, TF_STATIC, Quality
from models.urdf import read_joints
from services.runtime.transport.wire import encoding
from tests.harness.cases import case
from tests.harness.message_recorder import MessageRecorder
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.messages.test_se3 import same
from tests.services.state.conftest import TfHarness
from tests.services.state.sample_urdfs import joint_urdf, robot_urdf


def test_links_are_where_the_simulation_would_tell_them(scene: TfHarness) -> None:
    frames = scene.poll()
    for link in ("base_scan", "imu_link", "caster_back_link", "base_link"):
        own = frames.buffer.lookup("a/base_footprint", f"a/{link}").transform
        told = frames.buffer.lookup("b/base_footprint", f"b/{link}").transform
        assert same(own, told)
    assert frames.buffer.conflicts() == {}


def test_wheels_turn_with_the_joint_states_and_bear_their_stamps(scene: TfHarness) -> None:
    drive = scene.node.advertise(CMD_VEL, "/a/cmd_vel")
    states = MessageRecorder(scene.node.subscribe(JOINT_STATES, "/a/joint_states"))
    told = MessageRecorder(scene.node.subscribe(TF))
    angles: dict[int, float] = {}
    seen: dict[int, Pose3] = {}

    def turned() -> bool:
        drive.publish(Twist.planar(0.15, 0.0))
        angles.update(
            {each.header.stamp.ns: each.position[each.name.index("wheel_left_joint")] for each in states.received()}
        )
        for each in (transform for message in told.received() for transform in message.transforms):
            if each.child_frame_id == "a/wheel_left_link":
                seen[each.header.stamp.ns] = Pose3.from_msg(each.transform)
        return max(angles.values(), default=0) > 2 and max(seen, default=0) >= max(angles)

    wait_until(turned, 30.0, "a wheel that has turned by two radians")
    wheel = next(each for each in read_joints("burger") if each.name == "wheel_left_joint")
    common = sorted(angles.keys() & seen.keys())
    assert len(common) > 10
    for stamp in common:
        assert same(seen[stamp], wheel.transform(angles[stamp]), 1e-9)


def test_a_robot_from_elsewhere_stands_as_its_defaults_say(scene: TfHarness) -> None:
    frames = scene.poll()
    assert frames.buffer.lookup("gripper/base", "gripper/arm").transform.position == pytest.approx((0, 0, 0.6))
    assert frames.buffer.lookup("gripper/hand", "gripper/right_finger").transform.position == pytest.approx(
        (0, 0.03, 0)
    )
    assert frames.buffer.lookup("gripper/hand", "gripper/left_finger").transform.position == pytest.approx(
        (0, -0.029, 0)
    )
    assert "eye" in frames.frames(), "a leading slash keeps the prefix away"
    state = MessageRecorder(scene.node.subscribe(JOINT_STATES, "/gripper/joint_states"))
    first, second = (state.wait_next() for _ in range(2))
    assert first.name == ("shoulder", "wrist", "right", "left", "tip")
    tenths = [each.header.stamp.ns // 100_000_000 for each in (first, second)]
    assert tenths[0] < tenths[1], "ten times a second, at the most: a tick that is late bears its own time"
    described = MessageRecorder(scene.node.subscribe(ROBOT_DESCRIPTION, "/gripper/robot_description"))
    assert wait_until(described.received)[0].data.startswith("<?xml")


def test_bad_messages_are_refused_and_counted_and_the_service_goes_on(scene: TfHarness) -> None:
    health = MessageRecorder(scene.node.subscribe(HEALTH))
    with scene.network.start("state", "--namespace", "/odd") as process:
        describe = scene.node.advertise(ROBOT_DESCRIPTION, "/odd/robot_description")
        move = scene.node.advertise(JOINT_STATES, "/odd/joint_states")
        describe.publish(String(data="<sdf/>"))
        wait_until(lambda: "root is <sdf>, not <robot>" in process.text, 20.0, "a refusal")
        describe.publish(String(data=robot_urdf(joint_urdf("j", "continuous", "base", "arm"))))
        wait_until(lambda: "test with 0 fixed and 1 moving joints" in process.text, 20.0, "the robot")

        # Our own record rejects this on creation; a foreign sender may send it.
        foreign = scene.node.transport.advertise("odd/joint_states", encoding(JointState.ROS_TYPE), Quality.SENSOR)
        wait_until(lambda: foreign.has_subscribers and move.has_subscribers, 20.0, "its subscription")
        foreign.put(encode({"name": ["j", "k"], "position": [1.0]}), attachment=b"")
        move.publish(JointState(name=("j",)))
        wait_until(lambda: "it has no positions" in process.text, 20.0, "a refusal")

        def noted() -> bool:
            own = [each for each in health.received() if each.node == "/odd/state"]
            unread = [each for beat in own[-1:] for each in beat.inputs if each.topic == "/odd/joint_states"]
            return any(each.refused == 1 and "position has 1 values for 2" in each.reason for each in unread) and (
                "2 messages refused" in own[-1].note
            )

        wait_until(noted, 20.0, "a heartbeat that tells of the refusals")
        move.publish(JointState(header=Header(stamp=Time(sec=1)), name=("j", "nobody"), position=(1.0, 2.0)))
        wait_until(lambda: scene.poll().can("odd/base", "odd/arm"), 20.0, "the frame of the arm")
        assert process.status is None


def test_a_second_publisher_of_a_frame_is_told_by_both_sides(scene: TfHarness) -> None:
    with scene.network.start("state", "--namespace", "/b") as rival:
        wait_until(lambda: "are published by another node, too" in rival.text, 20.0, "a complaint")
        assert "b/base_link" in rival.text
        assert "enable_link_tf = false" in rival.text
        wait_until(lambda: "b/base_link" in scene.poll().buffer.conflicts(), 20.0, "a conflict")

        def told() -> list[CompletedProcess[str]]:
            """Show the tree; return nothing if a publisher was not heard while it listened."""
            shown = scene.run_command("tf", "tree", "--listen", "1")
            return [shown] if "frame 'b/base_link' has 2 publishers: " in shown.stderr else []

        [shown] = wait_until(told, 40.0, "both publishers")
        assert shown.returncode == 1
        assert "/sim" in shown.stderr
        assert "/b/state" in shown.stderr


WRONG = {
    ("urdf=nowhere.urdf",): "nowhere.urdf cannot be read: No such file",
    ("model=burgr",): "did you mean 'burger'",
    ("model=burger", "urdf=x"): "both model",
    ("model=burger", "publish_default_positions=true", 'zeros=["elbow=1"]'): "no joint 'elbow'",
    ("model=burger", 'source_list=["joint_states"]'): "which is its own output",
    ('robots=["x", "/x"]',): "a name is given twice",
    ('robots=["x y"]',): "is not a name",
}
"""The error message for each invalid combination of parameters."""


def test_what_cannot_be_is_refused_at_the_start(scene: TfHarness) -> None:
    begun = {}
    for number, arguments in enumerate(WRONG):
        words = [word for each in arguments for word in ("--param", each)]
        begun[arguments] = scene.network.start("state", "--namespace", f"/wrong{number}", *words)
    for arguments, told in WRONG.items():
        with case(*arguments):
            assert begun[arguments].wait(60.0) == 2
            assert told in begun[arguments].text


def test_several_robots_and_sources_in_one_process(scene: TfHarness, tmp_path: Path) -> None:
    urdf = tmp_path / "two.urdf"
    urdf.write_text(
        robot_urdf(joint_urdf("one", "continuous", "base", "arm"), joint_urdf("two", "continuous", "arm", "hand"))
    )
    merging = ("--param", 'robots=["left", "right"]', "--param", f"urdf={urdf}", "--param", 'source_list=["p", "q"]')
    with scene.network.start("state", "--name", "state_two", *merging):
        merged = MessageRecorder(scene.node.subscribe(JOINT_STATES, "/left/joint_states"))
        first = scene.node.advertise(JOINT_STATES, "/left/p")
        second = scene.node.advertise(JOINT_STATES, "/left/q")

        def whole() -> bool:
            first.publish(JointState(name=("one",), position=(0.25,)))
            second.publish(JointState(name=("two", "nobody"), position=(0.5, 9.0)))
            return any(each.name == ("one", "two") and each.position == (0.25, 0.5) for each in merged.received())

        wait_until(whole, 20.0, "both parts in one joint state")
        wait_until(lambda: scene.poll().can("left/base", "left/hand"), 20.0, "the frames of the left one")
        assert not scene.poll().can("right/base", "right/hand"), "nobody tells of the right one"


def test_a_reset_tells_all_again(scene: TfHarness) -> None:
    fixed = MessageRecorder(scene.node.subscribe(TF_STATIC))
    before, begun = len(fixed.received()), time.monotonic()
    scene.node.call(RESET, Empty(), 60.0)
    scene.frames.clear()

    def again() -> list[TFMessage]:
        return [each for each in fixed.received()[before:] if each.transforms[0].child_frame_id == "a/base_link"]

    told = wait_until(again, 20.0, "the fixed frames after the reset")[0].transforms[0].header.stamp
    assert told.ns / 1e9 < time.monotonic() - begun + 1, "in the time that began with the reset"
    wait_until(lambda: scene.poll().can("world", "a/wheel_left_link"), 20.0, "moving frames after the reset")


def test_in_lockstep_every_joint_state_is_told_with_its_stamp(tmp_path: Path) -> None:
    robots = [{"name": "a", "model": "burger", "parameters": {"enable_link_tf": False}}]
    settings = (
        "--param",
        f"robots={json.dumps(robots)}",
        "--param",
        "mode=lockstep",
        "--param",
        'members=["/a/state"]',
    )
    with Network(tmp_path) as network, network.node() as node:
        told = MessageRecorder(node.subscribe(TF))
        states = MessageRecorder(node.subscribe(JOINT_STATES, "/a/joint_states"))
        network.start("sim", *settings, "--lockstep")
        network.start("state", "--namespace", "/a", "--lockstep")

        def stamps() -> list[int]:
            found = [each for message in told.received() for each in message.transforms]
            return [each.header.stamp.ns for each in found if each.child_frame_id == "a/wheel_left_link"]

        wait_until(lambda: len(stamps()) >= 200, 60.0, "two hundred transforms of a wheel")
        apart = [later - earlier for earlier, later in pairwise(stamps())]
        missed = sum(each // 40_000_000 - 1 for each in apart)
        assert all(each > 0 and each % 40_000_000 == 0 for each in apart)
        assert missed <= told.source.lost, "all were sent; on a busy machine this test may lose some"
        assert states.received()
