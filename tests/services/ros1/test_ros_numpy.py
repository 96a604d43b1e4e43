"""Messages as numpy arrays by ros_numpy, and back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module", autouse=True)
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports() as made:
        yield made


def test_images_and_grids() -> None:
    from nav_msgs.msg import OccupancyGrid
    from ros_numpy import msgify, numpify
    from sensor_msgs.msg import Image

    picture = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    message = msgify(Image, picture, encoding="bgr8")
    assert (message.height, message.width, message.step, message.encoding) == (4, 5, 15, "bgr8")
    assert np.array_equal(numpify(message), picture)
    assert np.array_equal(numpify(msgify(Image, picture[:, ::2], encoding="rgb8")), picture[:, ::2])
    padded = Image(height=2, width=1, encoding="mono16", is_bigendian=1, step=4, data=b"\x01\x02xx\x03\x04xx")
    assert numpify(padded).tolist() == [[0x0102], [0x0304]]
    for said, array, encoding in (
        ("Unrecognized encoding bgr9", picture, "bgr9"),
        ("has 3 channels, mono8 requires 1", picture, "mono8"),
        ("is float64, 32FC1 requires float32", np.zeros((2, 2)), "32FC1"),
    ):
        with pytest.raises(TypeError, match=said):
            msgify(Image, array, encoding=encoding)
    grid = np.ma.masked_array(np.array([[0, 100, 7], [5, 5, 5]], np.int8), mask=[[0, 0, 1], [0, 0, 0]])
    sent = msgify(OccupancyGrid, grid)
    assert (sent.info.height, sent.info.width, list(sent.data)) == (2, 3, [0, 100, -1, 5, 5, 5])
    read = numpify(sent)
    assert read.mask.tolist() == grid.mask.tolist()
    assert read[0, 1] == 100


def test_places_and_frames() -> None:
    from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
    from ros_numpy import msgify, numpify

    turned = Quaternion(0, 0, 1, 0)
    matrix = numpify(Pose(Point(1, 2, 3), turned))
    assert np.allclose(matrix @ [1, 0, 0, 1], [0, 2, 3, 1])
    assert np.array_equal(matrix, numpify(Transform(Vector3(1, 2, 3), turned)))
    back = msgify(Pose, matrix)
    assert numpify(back.position).tolist() == [1, 2, 3]
    assert abs(numpify(back.orientation)) == pytest.approx([0, 0, 1, 0])
    assert msgify(Transform, np.stack([matrix, matrix]))[1].translation.y == 2
    assert numpify(Point(1, 2, 3), hom=True).tolist() == [1, 2, 3, 1]
    assert numpify(Vector3(1, 2, 3), hom=True).tolist() == [1, 2, 3, 0]
    assert msgify(Point, np.array([1.0, 2, 3, 1])) == Point(1, 2, 3)
    assert msgify(Vector3, np.eye(3))[2] == Vector3(0, 0, 1)
    with pytest.raises(ValueError, match="homogeneous"):
        msgify(Point, np.zeros(4))


def cloud() -> Any:
    import ros_numpy

    points = np.zeros(3, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("r", "u1"), ("g", "u1"), ("b", "u1")])
    points["x"], points["y"], points["z"] = [1, 2, np.nan], 5, 6
    points["r"], points["b"] = 255, 9
    return points, ros_numpy


def test_clouds() -> None:
    from sensor_msgs.msg import PointCloud2, PointField

    points, ros_numpy = cloud()
    packed = ros_numpy.point_cloud2.merge_rgb_fields(points)
    assert packed.dtype.names == ("x", "y", "z", "rgb")
    split = ros_numpy.point_cloud2.split_rgb_field(packed)
    assert split[1].tolist() == points[1].tolist()
    message = ros_numpy.msgify(PointCloud2, points, frame_id="map")
    assert [(each.name, each.offset, each.datatype) for each in message.fields][2:4] == [
        ("z", 8, PointField.FLOAT32),
        ("r", 12, PointField.UINT8),
    ]
    assert (message.width, message.point_step, message.is_dense, message.header.frame_id) == (3, 15, False, "map")
    assert ros_numpy.numpify(message)["y"].tolist() == [5, 5, 5]
    assert ros_numpy.point_cloud2.pointcloud2_to_xyz_array(message).tolist() == [[1, 5, 6], [2, 5, 6]]
    assert ros_numpy.point_cloud2.pointcloud2_to_array(message, squeeze=False).shape == (1, 3)
    square = ros_numpy.msgify(PointCloud2, points[:2].reshape(2, 1))
    assert ros_numpy.numpify(square).shape == (2, 1)


def test_a_type_that_is_not_converted_is_named() -> None:
    from ros_numpy import converts_to_numpy, numpify
    from std_msgs.msg import String

    with pytest.raises(ValueError, match=r"std_msgs/String - only supports .*sensor_msgs/Image"):
        numpify(String("x"))
    converts_to_numpy(String)(lambda message: np.array(list(message.data)))
    assert numpify(String("ab")).tolist() == ["a", "b"]
