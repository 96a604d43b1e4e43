"""message_filters, point_cloud2, laser_geometry, cv_bridge and image_geometry."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports


@pytest.fixture(scope="module", autouse=True)
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports() as made:
        import rospy

        rospy.init_node("sensors", disable_signals=True)
        yield made


def at(seconds: float) -> Any:
    import rospy
    from geometry_msgs.msg import PointStamped
    from std_msgs.msg import Header

    return PointStamped(header=Header(0, rospy.Time(seconds), "f"))


def seconds(*messages: Any) -> list[float]:
    return [round(each.header.stamp.to_sec(), 6) for each in messages]


def test_messages_with_one_stamp_come_together() -> None:
    import message_filters

    first, second = message_filters.SimpleFilter(), message_filters.SimpleFilter()
    out: list[Any] = []
    joined = message_filters.TimeSynchronizer([first, second], 3)
    joined.registerCallback(lambda a, b, extra: out.append((*seconds(a, b), extra)), "extra")
    for source, time in (
        *((first, 1), (second, 2), (second, 1), (first, 3), (first, 4), (first, 5)),
        *((first, 6), (second, 3), (second, 5), (second, 6)),
    ):
        source.signalMessage(at(time))
    assert out == [(1, 1, "extra"), (5, 5, "extra"), (6, 6, "extra")]  # 3 had been dropped from the queue of three


def test_messages_with_near_stamps_come_together(capfd: pytest.CaptureFixture[str]) -> None:
    import message_filters
    from std_msgs.msg import String

    sources = [message_filters.SimpleFilter() for _ in range(3)]
    out: list[list[float]] = []
    joined = message_filters.ApproximateTimeSynchronizer(sources, 10, 0.1)
    joined.registerCallback(lambda *messages: out.append(seconds(*messages)))
    for index, time in (
        *((0, 1), (1, 1.05), (2, 1.2), (2, 1.02), (0, 2), (0, 2.03), (1, 2.06), (2, 2.04)),
        *((2, 3), (0, 3.11), (1, 3.05), (1, 5), (0, 5), (2, 5)),
    ):
        sources[index].signalMessage(at(time))
    assert out == [[1, 1.05, 1.02], [2.03, 2.06, 2.04], [5, 5, 5]]
    short = message_filters.ApproximateTimeSynchronizer(sources[:2], 1, 0.2)
    short.registerCallback(lambda *messages: out.append(seconds(*messages)))
    for index, time in ((1, 9), (0, 10), (0, 9.1), (1, 10)):  # 9.1 is older than the only one that is kept
        sources[index].signalMessage(at(time))
    assert out[3:] == [[10, 10]]
    sources[0].signalMessage(String("x"))
    assert "allow_headerless=True" in capfd.readouterr().err


def test_a_cache_answers_by_time_and_a_subscriber_feeds_it(kernel: ScriptKernel) -> None:
    import message_filters
    import rospy
    from geometry_msgs.msg import PointStamped

    subscriber = message_filters.Subscriber("points", PointStamped, queue_size=5)
    cache = message_filters.Cache(subscriber, 3)
    cache.registerCallback(lambda message: kernel.wake())
    assert (cache.getLast(), cache.getLatestTime(), subscriber.getTopic()) == (None, None, "points")
    sender = rospy.Publisher("points", PointStamped, queue_size=5)
    for time in (1, 2, 3, 4):
        sender.publish(at(time))
    assert kernel.wait_until(lambda: cache.getLatestTime() == rospy.Time(4), 60)
    assert seconds(*cache.getInterval(rospy.Time(1), rospy.Time(3))) == [2, 3]
    assert seconds(cache.getElemAfterTime(rospy.Time(2.5)), cache.getElemBeforeTime(rospy.Time(2.5))) == [3, 2]
    assert (cache.getElemAfterTime(rospy.Time(9)), cache.getElemBeforeTime(rospy.Time(1))) == (None, None)
    assert (subscriber.resolved_name, seconds(cache.getLast())) == ("/points", [4])
    subscriber.unregister()


def test_points_go_into_a_cloud_and_out() -> None:
    import rospy
    from sensor_msgs import point_cloud2
    from sensor_msgs.msg import PointField
    from std_msgs.msg import Header
    from tf2_ros import TransformRegistration

    header = Header(0, rospy.Time(1), "laser")
    fields = [PointField(name, 4 * place, PointField.FLOAT32, 1) for place, name in enumerate("xyz")]
    fields += [PointField("rgb", 16, PointField.UINT32, 1), PointField("d", 24, PointField.FLOAT64, 2)]
    cloud = point_cloud2.create_cloud(header, fields, [(1, 2, 3, 7, 0.5, 0.25), (4, math.nan, 6, 8, 1, 2)])
    assert (cloud.point_step, cloud.row_step, cloud.width, len(cloud.data)) == (40, 80, 2, 80)
    assert next(point_cloud2.read_points(cloud)) == (1, 2, 3, 7, 0.5, 0.25)
    assert [point[0] for point in point_cloud2.read_points(cloud, skip_nans=True)] == [1]
    assert list(point_cloud2.read_points(cloud, ("x", "z"))) == [(1, 3), (4, 6)]
    assert list(point_cloud2.read_points(cloud, ("rgb",), uvs=[(1, 0)])) == [(8,)]
    plain = point_cloud2.create_cloud_xyz32(header, [(1, 2, 3)])
    assert point_cloud2.read_points_list(plain)[0].y == 2
    with pytest.raises(AssertionError, match="not a sensor_msgs"):
        list(point_cloud2.read_points("cloud"))

    import tf2_sensor_msgs  # noqa: F401 - lets tf2_ros transform clouds
    from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3

    turn = TransformStamped(Header(frame_id="map"), "laser", Transform(Vector3(1, 0, 0), Quaternion(0, 0, 1, 1)))
    moved = TransformRegistration().get(type(plain))(plain, turn)
    assert moved.header.frame_id == "map"
    assert next(point_cloud2.read_points(moved)) == pytest.approx((-1, 1, 3))


def test_a_scan_becomes_a_cloud() -> None:
    from laser_geometry import LaserProjection
    from sensor_msgs import point_cloud2
    from sensor_msgs.msg import LaserScan

    scan = LaserScan(angle_min=-1, angle_increment=0.5, time_increment=0.01, range_min=0.2, range_max=5)
    scan.ranges, scan.intensities = [1, 2, 0.1, 6, 3], [10, 20, 30, 40, 50]
    option = LaserProjection.ChannelOption
    cloud = LaserProjection().projectLaser(scan)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity", "index"]
    assert [point[3:] for point in point_cloud2.read_points(cloud)] == [(10, 0), (20, 1), (50, 4)]
    assert next(point_cloud2.read_points(cloud))[:3] == pytest.approx((math.cos(-1), math.sin(-1), 0))
    near = LaserProjection().projectLaser(scan, 2.5, option.DISTANCE | option.TIMESTAMP)
    assert [point[3:] for point in point_cloud2.read_points(near)] == [
        pytest.approx((1, 0)),
        pytest.approx((2, 0.01)),
    ]


def test_images_go_to_arrays_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    from cv_bridge import CvBridge, CvBridgeError
    from sensor_msgs.msg import Image

    bridge = CvBridge()
    picture = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    message = bridge.cv2_to_imgmsg(picture, "bgr8")
    assert (message.height, message.width, message.step, message.encoding) == (4, 5, 15, "bgr8")
    assert np.array_equal(bridge.imgmsg_to_cv2(message), picture)
    assert np.array_equal(bridge.imgmsg_to_cv2(message, "rgb8"), picture[..., ::-1])
    assert np.array_equal(bridge.imgmsg_to_cv2(message, "rgba8")[1, 2], [*picture[1, 2, ::-1], 255])
    grey = bridge.imgmsg_to_cv2(message, "mono8")
    blue, green, red = picture[3, 4].astype(int)
    assert (grey.shape, grey[3, 4]) == ((4, 5), round(0.299 * red + 0.587 * green + 0.114 * blue))
    grey[0, 0] = 9  # it is a copy
    assert bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(grey, "mono8"), "mono16")[0, 0] == 9 * 257
    depth = np.array([[1.5, np.nan]], dtype=np.float32)
    assert bridge.cv2_to_imgmsg(depth).encoding == "32FC1"
    assert bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(depth, "32FC1"), "passthrough")[0, 0] == 1.5
    for given, source, target, wanted in (
        ([1000, 65535], np.uint16, "8UC1", [4, 255]),
        ([2, 255], np.uint8, "16UC1", [514, 65535]),
        ([-257, 2570], np.int16, "8UC1", [0, 10]),
        ([2.7, -1, 300, np.nan], np.float32, "8UC1", [3, 0, 255, 0]),
        ([2.7, -1, 300, np.inf], np.float32, "16UC1", [3, 0, 300, 65535]),
        ([1, 65535], np.uint16, "32FC1", [1, 65535]),
    ):
        image = bridge.cv2_to_imgmsg(np.array([given], source))
        assert bridge.imgmsg_to_cv2(image, target).tolist() == [wanted]
    padded = Image(height=2, width=1, encoding="mono16", is_bigendian=1, step=4, data=b"\x01\x02xx\x03\x04")
    assert bridge.imgmsg_to_cv2(padded).tolist() == [[0x0102], [0x0304]]
    uyvy = Image(height=1, width=2, encoding="yuv422", step=4, data=bytes([128, 16, 128, 235]))
    assert bridge.imgmsg_to_cv2(uyvy, "bgr8").tolist() == [[[0, 0, 0], [255, 255, 255]]]
    for said, call in (
        ("Unrecognized image encoding", lambda: bridge.imgmsg_to_cv2(message, "bgr9")),
        ("incompatible type 8UC3", lambda: bridge.cv2_to_imgmsg(picture, "mono8")),
        ("numbers of channels differ", lambda: bridge.imgmsg_to_cv2(message, "32FC1")),
        (
            "needs 60 bytes, it has 3",
            lambda: bridge.imgmsg_to_cv2(Image(height=4, width=5, encoding="bgr8", data=b"abc")),
        ),
        ("not a numpy array", lambda: bridge.cv2_to_imgmsg([[1]])),
    ):
        with pytest.raises(TypeError, match=said):
            call()
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(CvBridgeError, match="needs OpenCV"):
        bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(grey, "bayer_rggb8"), "bgr8")
    flat = np.full((8, 8, 3), (200, 100, 50), np.uint8)
    for kind in ("png", "jpg"):
        packed = bridge.cv2_to_compressed_imgmsg(flat, kind)
        assert np.abs(bridge.compressed_imgmsg_to_cv2(packed, "bgr8").astype(int) - flat).max() <= 3
    with pytest.raises(CvBridgeError, match="are no image"):
        bridge.compressed_imgmsg_to_cv2(type(packed)(format="png", data=b"abc"))


def test_pixels_and_rays_by_camera_info() -> None:
    import image_geometry
    from sensor_msgs.msg import CameraInfo, RegionOfInterest

    turn = [math.cos(0.02), -math.sin(0.02), 0, math.sin(0.02), math.cos(0.02), 0, 0, 0, 1]
    info = CameraInfo(width=64, height=48, K=[50, 0, 31.5, 0, 52, 23.5, 0, 0, 1], D=[-0.2, 0.05, 0.001, -0.002, 0.01])
    info.R, info.P, info.header.frame_id = turn, [49, 0, 30.5, 0, 0, 49, 23, 0, 0, 0, 1, 0], "camera"
    camera = image_geometry.PinholeCameraModel()
    camera.fromCameraInfo(info)
    assert camera.rectifyPoint((10, 40)) == pytest.approx((7.88868, 39.00482), abs=1e-4)
    assert camera.project3dToPixel((1, 2, 10)) == pytest.approx((35.4, 32.8))
    assert camera.projectPixelTo3dRay((12, 13)) == pytest.approx((-0.34695, -0.18754, 0.91894), abs=1e-5)
    assert (camera.getDeltaU(1, 2), camera.getDeltaV(1, 0), camera.tfFrame()) == (24.5, math.inf, "camera")
    assert (camera.fovX(), camera.fovY()) == pytest.approx((1.15705, 0.91090), abs=1e-5)
    # Rectifies a raw image whose colours are its pixel coordinates, so each pixel of the result shows its origin.
    raw = np.stack(np.meshgrid(np.arange(64.0), np.arange(48.0)), axis=-1)
    rectified = np.zeros_like(raw)
    camera.rectifyImage(raw, rectified)
    for column, row in ((30, 20), (12, 36), (55, 10)):
        assert camera.rectifyPoint(rectified[row, column]) == pytest.approx((column, row), abs=1e-6)
    info.binning_x = info.binning_y = 2
    info.roi = RegionOfInterest(4, 2, 40, 60, True)
    camera.fromCameraInfo(info)
    assert (camera.cx(), camera.cy(), camera.fx()) == (13.25, 10.5, 24.5)
    assert camera.fullIntrinsicMatrix()[0, 0] == 50
    right = CameraInfo(width=64, height=48, K=info.K, R=info.R, P=[49, 0, 30.5, -4.9, 0, 49, 23, 0, 0, 0, 1, 0])
    info.binning_x = info.binning_y = 0
    info.roi = RegionOfInterest()
    pair = image_geometry.StereoCameraModel()
    pair.fromCameraInfo(info, right)
    left_pixel, right_pixel = pair.project3dToPixel((0.2, 0.1, 2))
    assert left_pixel[0] - right_pixel[0] == pytest.approx(pair.getDisparity(2))
    assert pair.projectPixelTo3d(left_pixel, pair.getDisparity(2)) == pytest.approx((0.2, 0.1, 2))
    assert pair.getZ(2.45) == pytest.approx(2)
