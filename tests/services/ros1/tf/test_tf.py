"""tf and tf2_ros as scripts call them, over an in-memory network, with texts and values of ROS 1's own libraries."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from services.script.kernel import ScriptKernel
from services.script.robot_frames import RobotFrames
from tests.harness.cases import case
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module")
def ros() -> Iterator[SimpleNamespace]:
    with ros1_imports() as kernel:
        yield libraries(kernel)


def libraries(kernel: ScriptKernel) -> SimpleNamespace:
    import geometry_msgs.msg as geometry
    import rospy
    import tf
    import tf2_geometry_msgs
    import tf2_ros
    from std_msgs.msg import Header

    rospy.init_node("frames", disable_signals=True)

    def link(parent: str, child: str, seconds: float, x: float = 0.0, yaw: float = 0.0, **turn: float) -> Any:
        made = geometry.TransformStamped(header=Header(0, rospy.Time(seconds), parent), child_frame_id=child)
        made.transform.translation.x = x
        turn = turn or {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
        made.transform.rotation = geometry.Quaternion(**turn)
        return made

    return SimpleNamespace(
        kernel=kernel,
        rospy=rospy,
        tf=tf,
        tf2_ros=tf2_ros,
        tf2_geometry_msgs=tf2_geometry_msgs,
        geometry=geometry,
        Header=Header,
        link=link,
    )


def robot(ros: SimpleNamespace) -> Any:
    """Return a transformer with a laser on a base that moves from x = 1 m to 2 m in two seconds, turning by 0.4 rad."""
    transformer = ros.tf.TransformerROS(True, ros.rospy.Duration(10))
    transformer.setTransform(ros.link("/world", "base", 10, 1.0))
    transformer.setTransform(ros.link("world", "/base", 12, 2.0, 0.4))
    transformer._buffer.set_transform_static(ros.link("base", "laser", 0, 0.5), "urdf")
    return transformer


def refusal(call: Callable[[], Any]) -> tuple[str, str]:
    try:
        call()
    except Exception as error:  # noqa: BLE001 - which one is the question
        return f"{type(error).__module__}.{type(error).__name__}", str(error)
    raise AssertionError("it was not refused")


def test_a_lookup_gives_two_lists_and_cuts_slashes(ros: SimpleNamespace) -> None:
    tf, at = robot(ros), ros.rospy.Time
    place, turn = tf.lookupTransform("/world", "/laser", at(11))
    assert (type(place), type(turn)) == (list, list)
    assert place == pytest.approx([1.5 + 0.5 * math.cos(0.2), 0.5 * math.sin(0.2), 0])
    assert turn == pytest.approx([0, 0, math.sin(0.1), math.cos(0.1)])
    assert tf.lookupTransform("world", "laser", at(0))[0][0] == pytest.approx(2 + 0.5 * math.cos(0.4))
    motion = tf.lookupTransformFull("base", at(12), "base", at(10), "world")
    assert motion[0] == pytest.approx([-math.cos(0.4), math.sin(0.4), 0])
    assert (tf.canTransform("world", "laser", at(11)), tf.canTransform("world", "laser", at(13))) == (1, 0)
    assert tf.getLatestCommonTime("/world", "laser") == at(12)
    assert (tf.frameExists("base"), tf.frameExists("world"), tf.getFrameStrings()) == (True, False, ["base", "laser"])
    assert tf.allFramesAsString() == "Frame base exists with parent world.\nFrame laser exists with parent base.\n"
    assert tf.chain("world", at(0), "laser", at(0), "world") == ["laser", "base", "world"]
    linear, angular = tf.lookupTwist("base", "world", at(11), ros.rospy.Duration(1))
    assert linear == pytest.approx((0.5, 0, 0))
    assert angular == pytest.approx((0, 0, 0.2))


def test_a_script_for_one_robot_names_its_frames_without_their_prefix(
    ros: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros.kernel, "frames", RobotFrames("tb3_0"))
    tf, at = ros.tf.TransformerROS(True, ros.rospy.Duration(10)), ros.rospy.Time
    for name, x in (("tb3_0", 1.0), ("tb3_1", 7.0)):
        tf.setTransform(ros.link("world", f"{name}/odom", 10, x))
        tf.setTransform(ros.link(f"{name}/odom", f"{name}/base_link", 10, 0.5))
    tf.setTransform(ros.link("world", "table", 10, 3.0))
    for target, source, x in (
        ("/odom", "base_link", 0.5),
        ("world", "/base_link", 1.5),
        ("world", "tb3_0/base_link", 1.5),
        ("odom", "tb3_1/odom", 6.0),
        ("base_link", "table", 1.5),
    ):
        with case(f"{source} in {target}"):
            assert tf.canTransform(target, source, at(0))
            assert tf.lookupTransform(target, source, at(0))[0][0] == pytest.approx(x)
    assert (tf.frameExists("odom"), tf.frameExists("nix")) == (True, False)
    assert "canTransform: source_frame tb3_0/nix does not exist." in tf._buffer.can_transform_core("odom", "nix", at(0))
    answer = tf._buffer.lookup_transform("odom", "base_link", at(0))
    assert (answer.header.frame_id, answer.child_frame_id) == ("odom", "base_link")
    sent = []
    broadcaster = ros.tf.TransformBroadcaster()
    broadcaster.tf2_broadcaster.pub_tf = SimpleNamespace(publish=sent.append)
    for parent, child in (("odom", "/carrot"), ("map", "odom"), ("/table", "cup"), ("tb3_1/odom", "goal")):
        broadcaster.sendTransform((0, 0, 0), (0, 0, 0, 1), at(10), child, parent)
    assert [(each.transforms[0].header.frame_id, each.transforms[0].child_frame_id) for each in sent] == [
        ("tb3_0/odom", "tb3_0/carrot"), ("map", "tb3_0/odom"), ("table", "tb3_0/cup"), ("tb3_1/odom", "tb3_0/goal")
    ]  # fmt: skip


def test_exceptions_are_tf2s_with_its_words(ros: SimpleNamespace) -> None:
    tf, at = robot(ros), ros.rospy.Time
    buffer = tf._buffer
    assert ros.tf.LookupException is ros.tf2_ros.LookupException
    assert issubclass(ros.tf.ExtrapolationException, ros.tf.Exception)
    for wanted, call in (
        (
            ("tf2.LookupException", '"nix" passed to lookupTransform argument target_frame does not exist. '),
            lambda: tf.lookupTransform("nix", "base", at(0)),
        ),
        (
            (
                "tf2.ExtrapolationException",
                "Lookup would require extrapolation 3.000000000s into the future.  Requested time 15.000000000 but the "
                "latest data is at time 12.000000000, when looking up transform from frame [laser] to frame [world]",
            ),
            lambda: tf.lookupTransform("world", "laser", at(15)),
        ),
        (
            (
                "tf2.InvalidArgumentException",
                'Invalid argument "/world" passed to lookupTransform argument target_frame in tf2 frame_ids cannot '
                "start with a '/' like: ",
            ),
            lambda: buffer.lookup_transform("/world", "base", at(0)),
        ),
        (
            (
                "tf2.InvalidArgumentException",
                "Invalid argument passed to lookupTransform argument source_frame in tf2 frame_ids cannot be empty",
            ),
            lambda: buffer.lookup_transform("world", "", at(0)),
        ),
        (
            ("tf2.LookupException", '"zz" passed to lookupTransform argument fixed_frame does not exist. '),
            lambda: buffer.lookup_transform_full("base", at(11), "base", at(10), "zz"),
        ),
        (
            (
                "tf2.TransformException",
                "cannot wait for transform without a dedicated thread that listens to incoming TF messages",
            ),
            lambda: tf.waitForTransform("world", "base", at(0), ros.rospy.Duration(1)),
        ),
        (
            ("builtins.TypeError", "time must have a to_sec method, e.g. rospy.Time or rospy.Duration"),
            lambda: buffer.lookup_transform_core("world", "base", 0),
        ),
    ):
        assert refusal(call) == wanted
    assert buffer.can_transform_core("a", "b", at(0)) == (
        0,
        "canTransform: target_frame a does not exist. canTransform: source_frame b does not exist.",
    )
    buffer.clear()  # known frames remain known, without data
    assert refusal(lambda: tf.lookupTransform("world", "base", at(0)))[0] == "tf2.ConnectivityException"
    assert tf.lookupTransform("base", "laser", at(0))[0] == [0.5, 0, 0]


def test_what_makes_no_sense_is_refused_once_and_in_words(
    ros: SimpleNamespace, capfd: pytest.CaptureFixture[str]
) -> None:
    buffer = ros.tf2_ros.Buffer()
    for bad in (
        ros.link("a", "a", 1),
        ros.link("a", "", 1),
        ros.link("", "b", 1),
        ros.link("a", "b", 1, math.nan),
        ros.link("a", "b", 1, x=0.0, w=0.5),
    ):
        buffer.set_transform(bad, "me")
    for _ in range(3):
        buffer.set_transform(ros.link("a", "c", 1), "me")
    lines = capfd.readouterr().err.splitlines()
    kinds = [
        "SELF_TRANSFORM",
        "NO_CHILD_FRAME_ID",
        "NO_FRAME_ID",
        "NAN_INPUT",
        "DENORMALIZED_QUATERNION",
        "REPEATED_DATA",
    ]
    assert [line.split()[1].strip(":") for line in lines] == [f"TF_{kind}" for kind in kinds]
    assert buffer._getFrameStrings() == ["c", "a"]


def test_stamped_messages_go_to_other_frames(ros: SimpleNamespace) -> None:
    tf, geometry, at = robot(ros), ros.geometry, ros.rospy.Time
    header = ros.Header(0, at(12), "laser")
    cos, sin = math.cos(0.4), math.sin(0.4)

    point = tf.transformPoint("/world", geometry.PointStamped(header, geometry.Point(1, 2, 3)))
    assert (point.header.frame_id, point.header.stamp) == ("/world", at(12))
    assert (point.point.x, point.point.y, point.point.z) == pytest.approx(
        (2 + 1.5 * cos - 2 * sin, 1.5 * sin + 2 * cos, 3)
    )
    vector = tf.transformVector3("world", geometry.Vector3Stamped(header, geometry.Vector3(1, 0, 2)))
    assert (vector.vector.x, vector.vector.y, vector.vector.z) == pytest.approx((cos, sin, 2))
    unfilled = geometry.PoseStamped(header, geometry.Pose())
    pose = tf.transformPose("world", unfilled).pose
    assert (pose.position.x, pose.orientation.z) == pytest.approx((2 + 0.5 * cos, math.sin(0.2)))
    assert tf.asMatrix("world", header)[:3, 3] == pytest.approx([2 + 0.5 * cos, 0.5 * sin, 0])
    # A rotation has two quaternions; conversion through a matrix gives the one with w > 0.
    turned = tf.transformQuaternion("laser", geometry.QuaternionStamped(header, geometry.Quaternion(0.6, 0, 0, -0.8)))
    assert (turned.quaternion.x, turned.quaternion.w) == pytest.approx((-0.6, 0.8))

    again = tf._buffer.transform(geometry.PointStamped(header, geometry.Point(1, 2, 3)), "world")
    assert (again.point.x, again.header.frame_id) == (pytest.approx(point.point.x), "world")
    wrench = ros.tf2_geometry_msgs.do_transform_wrench(
        geometry.WrenchStamped(header, geometry.Wrench(geometry.Vector3(1, 0, 0), geometry.Vector3(0, 1, 0))),
        tf._buffer.lookup_transform("world", "laser", at(12)),
    )
    assert (wrench.wrench.force.y, wrench.wrench.torque.x) == pytest.approx((sin, -sin))
    covariance = ros.tf2_geometry_msgs.transform_covariance(
        [4.0, *[0.0] * 34, 1.0], ros.link("w", "l", 0, 0, math.pi / 2)
    )
    assert (covariance[0], covariance[7], covariance[35]) == pytest.approx((0, 4, 1))
    kind, text = refusal(lambda: tf._buffer.transform(geometry.PoseArray(header, []), "world"))
    assert (kind.rpartition(".")[2], text.endswith("if not loaded or supported")) == ("TypeException", True)


def test_a_listener_hears_what_broadcasters_send(ros: SimpleNamespace) -> None:
    rospy, tf, tf2_ros = ros.rospy, ros.tf, ros.tf2_ros
    fixed = tf2_ros.StaticTransformBroadcaster()
    fixed.sendTransform(ros.link("base", "camera", 0, 0.2))
    fixed.sendTransform([ros.link("base", "imu", 0, -0.1)])
    listener = tf.TransformListener()
    sender = tf.TransformBroadcaster()
    now = rospy.Time.now()
    sender.sendTransform((1, 2, 0), tf.transformations.quaternion_from_euler(0, 0, 0.5), now, "/base", "/odom")
    listener.waitForTransform("/odom", "/camera", now, rospy.Duration(60))
    place, turn = listener.lookupTransform("/odom", "/camera", now)
    assert place == pytest.approx([1 + 0.2 * math.cos(0.5), 2 + 0.2 * math.sin(0.5), 0])
    assert tf.transformations.euler_from_quaternion(turn)[2] == pytest.approx(0.5)
    listener.waitForTransform("odom", "imu", rospy.Time(0), rospy.Duration(60))  # both of the static ones are kept
    assert refusal(lambda: listener.waitForTransform("odom", "zz", rospy.Time(0), rospy.Duration(0.01))) == (
        "tf2.TransformException",
        "canTransform: source_frame zz does not exist.",
    )


def test_a_client_asks_the_buffer_of_another_node(ros: SimpleNamespace) -> None:
    import actionlib
    from tf2_msgs.msg import LookupTransformAction, LookupTransformResult

    rospy, tf2_ros = ros.rospy, ros.tf2_ros
    buffer = robot(ros)._buffer

    def answer(goal: Any) -> None:
        result = LookupTransformResult()
        try:
            if goal.advanced:
                result.transform = buffer.lookup_transform_full(
                    goal.target_frame, goal.target_time, goal.source_frame, goal.source_time, goal.fixed_frame
                )
            else:
                result.transform = buffer.lookup_transform(goal.target_frame, goal.source_frame, goal.source_time)
        except tf2_ros.LookupException as error:
            result.error.error, result.error.error_string = result.error.LOOKUP_ERROR, str(error)
        server.set_succeeded(result)

    server = actionlib.SimpleActionServer("tf2_buffer_server", LookupTransformAction, answer, False)
    server.start()
    client = tf2_ros.BufferClient("tf2_buffer_server", timeout_padding=rospy.Duration(60))
    assert client.wait_for_server(rospy.Duration(60))
    assert client.lookup_transform("world", "base", rospy.Time(11)).transform.translation.x == pytest.approx(1.5)
    moved = client.lookup_transform_full("base", rospy.Time(12), "base", rospy.Time(10), "world")
    assert moved.transform.translation.x == pytest.approx(-math.cos(0.4))
    kind, text = refusal(lambda: client.lookup_transform("nix", "base", rospy.Time(0)))
    assert (kind, text.split()[0]) == ("tf2.LookupException", '"nix"')
    assert (
        client.can_transform("world", "base", rospy.Time(0)),
        client.can_transform("nix", "base", rospy.Time(0)),
    ) == (
        True,
        False,
    )
    server.action_server.stop()
