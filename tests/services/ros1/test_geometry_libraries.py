"""PyKDL, tf_conversions, tf2_kdl and angles, against values computed by the original libraries."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Iterator

import numpy as np
import pytest

from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module", autouse=True)
def _ros() -> Iterator[None]:
    with ros1_imports():
        yield


def numbers(each: object) -> list[float]:
    import PyKDL

    if isinstance(each, PyKDL.Frame):
        return [*numbers(each.M), *each.p]
    if isinstance(each, PyKDL.Rotation):
        return [each[row, column] for row in range(3) for column in range(3)]
    return [float(value) for value in np.ravel(each)]  # type: ignore[arg-type]


def test_pykdl_gives_its_figures() -> None:
    import PyKDL

    names = vars(PyKDL)
    frame, twist = "Frame(Rotation.RotZ(1), Vector(1, 2, 3))", "Twist(Vector(1, 2, 3), Vector(4, 5, 6))"
    for expression, wanted in {
        "Vector(1, 2, 3) * Vector(4, 5, 7)": [-1, 5, -3],
        "2 * Vector(1, 2, 3) - Vector(1, 0, 0) / 2": [1.5, 4, 6],
        "dot(Vector(1, 2, 3), Vector(4, 5, 7))": [35],
        "Rotation.RPY(0.1, 0.2, 0.3).GetRPY()": [0.1, 0.2, 0.3],
        "Rotation.RPY(0, math.pi / 2, 0.4).GetRPY()": [0, math.pi / 2, 0.4],
        "Rotation.EulerZYX(0.1, 0.2, 0.3).GetRPY()": [0.3, 0.2, 0.1],
        "Rotation.EulerZYZ(0.1, 0.2, 0.3).GetEulerZYZ()": [0.1, 0.2, 0.3],
        "Rotation.Quaternion(0, 0, math.sin(0.2), math.cos(0.2)).GetRPY()": [0, 0, 0.4],
        "Rotation.Quaternion(0, 0, 0, 0).GetRPY()": [0, 0, 0],
        "Rotation.RPY(2, -1, 3).GetQuaternion()": [0.310622451, 0.718287018, 0.501509096, -0.368871358],
        "Rotation.RPY(0.1, 0.2, 0.3).GetRot()": [0.068924614, 0.213225927, 0.288748939],
        "Rotation.RotZ(math.pi).GetRotAngle()[1]": [0, 0, 1],
        "Rotation.Rot(Vector(1, 2, 3), 0.7)": [
            *(0.781639174, -0.482929284, 0.394739798, 0.550117231, 0.832030134, -0.071392499),
            *(-0.293957878, 0.272956339, 0.916015067),
        ],
        "Rotation(Vector(1, 2, 3), Vector(4, 5, 6), Vector(7, 8, 9))": [1, 4, 7, 2, 5, 8, 3, 6, 9],
        "Rotation.RPY(0.1, 0.2, 0.3).Inverse(Vector(1, 2, 3))": [0.919544326, 1.931284509, 3.069947618],
        f"{frame} * Vector(4, 5, 6)": [-1.046145701, 8.067395469, 9],
        f"{frame}.Inverse().p": [-2.223244275, -0.239133627, -3],
        f"{frame} * {twist}": [-7.344826069, -10.216361505, 13.15968687, -2.046145701, 6.067395469, 6],
        f"{frame} * Wrench(Vector(1, 2, 3), Vector(4, 5, 6))": [
            *(-1.142639664, 1.922075597, 3, -1.81237249, -0.360523523, 10.207354924),
        ],
        "Frame.DH(1, 0.2, 0.3, 0.4).p": [0.921060994, 0.389418342, 0.3],
        "Frame.DH_Craig1989(1, 0.2, 0.3, 0.4).p": [1, -0.059600799, 0.294019973],
        f"{twist}.RefPoint(Vector(1, 0, 0))": [1, 8, -2, 4, 5, 6],
        f"diff({frame}, Frame())": [-1, -2, -3, 0, 0, -1],
        "diff(Rotation.RotZ(1), Rotation.RotX(0.4))": [0.365927941, 0.199907345, -0.986173895],
        "addDelta(Rotation.RotZ(1), Vector(0.1, 0.2, 0.3)).UnitX()": [0.26731538, 0.963561252, 0.00960213],
    }.items():
        found = numbers(eval(expression, {**names, "math": math}))  # expressions from this file only
        assert found == pytest.approx(wanted, abs=1e-8), expression
    assert str(PyKDL.Vector(1, 2.5, -3)) == "[           1,         2.5,          -3]"
    assert str(PyKDL.Rotation()).splitlines()[1] == "            0,           1,           0;"
    with pytest.raises(AttributeError, match="no chains and solvers"):
        _ = PyKDL.ChainFkSolverPos_recursive


def test_parts_of_a_frame_are_changed_in_place() -> None:
    import PyKDL

    frame = PyKDL.Frame()
    frame.p[0] = 4
    frame.p.y(8)
    frame.M.DoRotZ(0.5)
    assert (list(frame.p), frame.M.GetRPY()[2]) == ([4, 8, 0], pytest.approx(0.5))
    for twin in (copy.deepcopy(frame), pickle.loads(pickle.dumps(frame)), PyKDL.Frame(frame)):
        twin.p[2] = 1
        assert (twin == frame, twin.M == frame.M, list(frame.p)) == (False, True, [4, 8, 0])
    frame.Integrate(PyKDL.Twist(PyKDL.Vector(1, 0, 0), PyKDL.Vector(0, 0, 1)), 10)
    assert numbers(frame.p) == pytest.approx([4 + 0.1 * math.cos(0.5), 8 + 0.1 * math.sin(0.5), 0])
    with pytest.raises(IndexError):
        frame.M[3, 0]


def test_frames_go_to_tf_messages_and_matrices_and_back() -> None:
    import PyKDL
    import rospy
    import tf2_ros
    import tf_conversions.posemath as posemath
    from geometry_msgs.msg import PoseStamped, TransformStamped
    from std_msgs.msg import Header
    from tf2_kdl import do_transform_vector, from_msg_frame, to_msg_frame

    frame = PyKDL.Frame(PyKDL.Rotation.RPY(0.1, -0.2, 0.3), PyKDL.Vector(1, 2, 3))
    for there, back in (
        (posemath.toMsg, posemath.fromMsg),
        (posemath.toTf, posemath.fromTf),
        (posemath.toMatrix, posemath.fromMatrix),
    ):
        assert back(there(frame)) == frame
    stamped = tf2_ros.Stamped(frame, rospy.Time(1), "base")
    message = tf2_ros.convert(stamped, PoseStamped)
    assert (message.header.frame_id, message.pose.position.z) == ("base", 3)
    assert from_msg_frame(to_msg_frame(stamped)) == frame
    link = TransformStamped(header=Header(frame_id="map"))
    link.transform.rotation.w = 1.0
    link.transform.translation.x = 5.0
    moved = do_transform_vector(tf2_ros.Stamped(PyKDL.Vector(1, 1, 1), rospy.Time(1), "base"), link)
    assert (list(moved), moved.header.frame_id) == ([6, 1, 1], "map")


def test_angles_take_the_short_way_within_limits() -> None:
    import angles

    assert angles.normalize_angle(3 * math.pi) == pytest.approx(math.pi)
    assert angles.normalize_angle_positive(-0.5) == pytest.approx(2 * math.pi - 0.5)
    assert angles.shortest_angular_distance(3.0, -3.0) == pytest.approx(2 * math.pi - 6)
    assert angles.two_pi_complement(-math.pi / 4) == pytest.approx(7 * math.pi / 4)
    limited = angles.shortest_angular_distance_with_limits
    for arguments, wanted in (
        ((-0.5, 0.5, 0.25, -0.25), (True, 1 - 2 * math.pi)),
        ((0.2, -0.2, -0.25, 0.25), (True, -0.4)),
        ((0.5, 0.1, -0.25, 0.25), (False, -0.4)),
        ((-0.5, 0.5, -0.25, 0.25), (False, 1.0)),
    ):
        found = limited(*arguments)
        assert (found[0], found[1]) == (wanted[0], pytest.approx(wanted[1])), arguments
    far = angles.shortest_angular_distance_with_large_limits
    assert far(0, 10.5 * math.pi, -2 * math.pi, 2 * math.pi) == (True, pytest.approx(0.5 * math.pi))
    assert far(0, 10.5 * math.pi, -2 * math.pi, 0.1 * math.pi) == (True, pytest.approx(-1.5 * math.pi))
    assert far(10.5 * math.pi, 0, -2 * math.pi, 2 * math.pi)[0] is False
