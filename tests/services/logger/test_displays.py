"""Displays of other nodes in a recording: markers, maps, scans, images and turtles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from msgspec.structs import replace

from messages.base import Float32Array
from messages.geometry import Point, PoseArray, PoseStamped, Quaternion, Transform, TransformStamped, Twist, Vector3
from messages.geometry import Pose as BodyPose
from messages.nav import MapMetaData, OccupancyGrid
from messages.nav import Path as Plan
from messages.rosgraph import Clock
from messages.se3 import IDENTITY
from messages.sensor import Image, LaserScan
from messages.std import ColorRGBA, Duration, Header, Time
from messages.tf import TFMessage
from messages.topics import MAP, TF, TURTLE_POSE, Quality, Topic
from messages.turtlesim import Pose
from messages.visualization import Marker, MarkerArray
from services.logger import SERVICE, LoggerParameters
from services.logger.display_scene import DisplayScene
from services.logger.rebuild import RecordingBuilder
from services.logger.recording import Recording
from services.runtime.testing import run_service
from tests.services.logger.conftest import EXTENT
from tests.services.logger.recording_reader import columns, entities

RED, SIZE = ColorRGBA(r=1.0, a=1.0), Vector3(x=0.2, y=0.2, z=0.2)
ENDS = (Point(), Point(x=2.0))


def base_at(x: float, seconds: float) -> TFMessage:
    """Return the pose of the frame ``base`` in the world at a time."""
    header = Header(stamp=Time.of(round(seconds * 1e9)), frame_id="world")
    transform = Transform(translation=Vector3(x=x))
    return TFMessage(transforms=(TransformStamped(header=header, child_frame_id="base", transform=transform),))


CUBE_ON_BASE = Marker(header=Header(frame_id="base"), type=Marker.CUBE, scale=SIZE, color=RED)


def marker(number: int, kind: int, *points: Point) -> Marker:
    unset = BodyPose(orientation=Quaternion(w=0.0))
    return Marker(ns="a", id=number, type=kind, scale=SIZE, color=RED, points=points, text="hello", pose=unset)


def test_markers_are_shown_for_their_lifetime(tmp_path: Path) -> None:
    file, second = tmp_path / "run.rrd", 10**9
    short, again, lasting = (
        Marker(ns="a", id=number, type=Marker.CUBE, scale=SIZE, color=RED, lifetime=Duration(sec=sec, nanosec=10**8))
        for number, sec in ((0, 1), (1, 2), (2, 0))
    )
    with Recording(file, [], EXTENT, pytest.fail) as recording:
        scene = DisplayScene(recording.log_at, lambda _: IDENTITY, pytest.fail)
        scene.add("/drawn", MarkerArray(markers=(short, again, replace(lasting, lifetime=Duration()))), second)
        for now in (2 * second, 25 * 10**8):
            scene.update(now)
        scene.add("/drawn", again, 3 * second)  # renewed before it expires
        scene.update(9 * second)
    ends = {number: columns(file, f"/displays/drawn/a/{number}", "Clear:is_recursive")[0].tolist() for number in (0, 1)}
    assert ends == {0: [21 * 10**8], 1: [51 * 10**8]}
    assert not columns(file, "/displays/drawn/a/2", "Clear:is_recursive")[1]


def test_markers_of_all_kinds_are_drawn_and_deleted(tmp_path: Path) -> None:
    file, warned = tmp_path / "run.rrd", list[str]()
    every = [marker(kind, kind, *ENDS) for kind in range(10)] + [
        marker(11, Marker.TRIANGLE_LIST, *ENDS, Point(y=1.0)),
        marker(12, Marker.POINTS),
    ]
    with Recording(file, [], EXTENT, pytest.fail) as recording:
        scene = DisplayScene(recording.log_at, lambda _: IDENTITY, warned.append)
        scene.add("/drawn", MarkerArray(markers=tuple(every)), 0)
        scene.add("/drawn", Marker(ns="a", id=4, action=2), 10**9)
        scene.add("/goals", PoseArray(poses=(BodyPose(), BodyPose())), 10**9)
        scene.add("/goals", PoseArray(poses=(BodyPose(),)), 2 * 10**9)
        grid = OccupancyGrid(info=MapMetaData(resolution=1.0, width=2, height=1), data=(0, 100))
        scene.add("/map", grid, 10**9)
        scene.add("/map", grid, 11 * 10**8)
        scene.update(2 * 10**9)
        scene.update(3 * 10**9)
        for step in range(10):
            scan = LaserScan(range_max=5.0, ranges=Float32Array([1.0, 2.0]))
            scene.add("/base_scan", scan, step * 50_000_000)
        pixels = bytes(range(24))
        scene.add("/picture", Image(width=4, height=2, step=12, data=pixels), 10**9)
        scene.add("/depth", Image(width=4, height=2, step=8, encoding="16UC1", data=bytes(16)), 10**9)
        recording.show_images(scene.images)
        recording.restart()
        scene.restart()
    found = {each for each in entities(file) if each.startswith("/displays")}
    assert {f"/displays/drawn/a/{number}" for number in (*range(10), 11)} <= found
    assert "/displays/drawn/a/12" not in found
    assert warned == [
        "/drawn is not displayed completely: the marker 'a' 12 of the type 8 has no points",
        "/depth is not displayed completely: images with encoding '16UC1' are not supported "
        "(known: rgb8, bgr8, mono8, rgba8, bgra8)",
    ]
    times, _ = columns(file, "/displays/drawn/a/4", "Clear:is_recursive")
    assert times.tolist() == [10**9]
    times, _ = columns(file, "/displays/goals/marker/1", "Clear:is_recursive")
    assert times.tolist() == [2 * 10**9]
    assert {"/displays/map/marker/0", "/displays/map/marker/1", "/images/picture"} <= set(entities(file))
    assert columns(file, "/displays/map/marker/1", "Mesh3D:vertex_positions")[0].tolist() == [10**9, 3 * 10**9]
    times, strips = columns(file, "/displays/drawn/a/5", "LineStrips3D:strips")
    assert np.array(strips[0]).tolist() == [[[0, 0, 0], [2, 0, 0]]]
    times, _ = columns(file, "/displays/base_scan/marker/0", "Points3D:positions")
    assert times.tolist() == [0, 200_000_000, 400_000_000], "five a second"
    again, _ = columns(file, "/displays/drawn/a/5", "LineStrips3D:strips", "sim_time_2")
    assert again.tolist() == [0], "after a reset it is still there"


def test_what_replaces_a_drawing_and_cannot_be_drawn_clears_it() -> None:
    """Planners publish an empty path to clear the last one."""
    logged: list[tuple[str, int | None, object]] = []
    scene = DisplayScene(lambda *entry: logged.append(entry), lambda _: IDENTITY, lambda _: None)
    scene.add("/plan", Plan(), 0)
    assert logged == [], "nothing is there to be cleared"
    scene.add("/plan", Plan(poses=(PoseStamped(), PoseStamped())), 10**9)
    scene.add("/plan", Plan(), 5 * 10**9)
    entity, time, shape = logged[-1]
    assert (entity, time, type(shape)) == ("/displays/plan/marker/0", 5 * 10**9, rr.Clear)


def test_images_may_have_padded_rows() -> None:
    logged: list[tuple[str, int | None, object]] = []
    warned: list[str] = []
    scene = DisplayScene(lambda *entry: logged.append(entry), lambda _: IDENTITY, warned.append)
    row = bytes(range(30))
    scene.add("/padded", Image(height=4, width=10, step=32, data=(row + b"xx") * 4), 0)
    ((entity, _, shape),) = logged
    assert entity == "/images/padded"
    assert isinstance(shape, rr.Image)
    assert shape.buffer is not None
    assert shape.buffer.as_arrow_array().to_pylist() == [list(row) * 4]
    scene.add("/short", Image(height=4, width=10, step=29, data=bytes(116)), 0)
    scene.add("/flat", Image(height=4), 0)
    assert len(logged) == 1
    assert warned == [
        "/short is not displayed completely: rows of 29 bytes are too short for 10 pixels in rgb8",
        "/flat is not displayed completely: rows of 0 bytes are too short for 0 pixels in rgb8",
    ]


def test_a_time_before_zero_is_a_time(tmp_path: Path) -> None:
    """A clock that another program sets may begin anywhere."""
    file, step = tmp_path / "run.rrd", 10_000_000
    with Recording(file, [], EXTENT, pytest.fail) as recording:
        scene = DisplayScene(recording.log_at, lambda _: IDENTITY, pytest.fail)
        for number in range(10):
            now = step * (number - 20)
            scene.add("/turtle1/pose", Pose(x=float(number)), now)
            scene.update(now)
        scene.update(now, final=True)
    times, places = columns(file, "/turtles/turtle1/pose", "Transform3D:translation")
    assert times.tolist() == [-20 * step, -16 * step, -12 * step, -11 * step], "25 a second, and the last"
    assert [place[0][0] for place in places] == [0.0, 4.0, 8.0, 9.0]


def test_the_logger_reads_what_others_publish(tmp_path: Path) -> None:
    file, topic = tmp_path / "run.rrd", Topic("/drawn", Marker, 0, Quality.EVENT, "")
    turtle = TURTLE_POSE.named("/turtle1/pose")
    params = LoggerParameters(file=str(file), serve=False, view="never", window=0.02)
    with run_service(SERVICE, "/", params) as service:
        tokens = [service.join(each, "pub") for each in (topic, turtle, MAP)]
        service.set_time(0.0)
        for step in range(1, 6):
            service.publish(turtle, Pose(x=float(step)))
            service.publish(topic, Marker(header=Header(frame_id="nowhere"), type=Marker.CUBE, scale=SIZE, color=RED))
            service.set_time(step * 0.2)
        assert service.reads(MAP.named("/map"))
        tokens[1].close()
        service.set_time(1.2)
        assert not service.reads(turtle)
    assert columns(file, "/turtles/turtle1", "Clear:is_recursive")[0].tolist() == [1_200_000_000], "it is gone"
    _, places = columns(file, "/turtles/turtle1/pose", "Transform3D:translation")
    assert [place[0][0] for place in places] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert len(columns(file, "/displays/drawn/marker/0", "Boxes3D:centers")[0]) == 5


def test_markers_in_moving_frames_are_drawn_where_these_are(tmp_path: Path) -> None:
    """The simulation publishes /tf once the logger subscribes to it, which it does for what may be in such a frame."""
    file, drawn = tmp_path / "run.rrd", Topic("/drawn", Marker, 0, Quality.EVENT, "")
    params = LoggerParameters(file=str(file), serve=False, view="never", window=0.02)
    with run_service(SERVICE, "/", params) as service:
        service.set_time(0.0)
        service.join(TURTLE_POSE.named("/turtle1/pose"), "pub")
        service.set_time(0.2)
        assert not service.reads(TF), "turtles have no moving frame"
        service.join(drawn, "pub")
        service.set_time(0.4)
        assert service.reads(TF)
        service.publish(TF, base_at(2.0, 0.5))
        service.publish(drawn, CUBE_ON_BASE)
        service.set_time(0.6)
    _, centres = columns(file, "/displays/drawn/marker/0", "Boxes3D:centers")
    assert [each[0] for each in centres] == [[2.0, 0.0, 0.0]]


def test_a_bag_has_the_moving_frames_of_its_markers(tmp_path: Path) -> None:
    file = tmp_path / "run.rrd"
    with RecordingBuilder(file, [], EXTENT, pytest.fail) as built:
        built.add("/clock", Clock(clock=Time.of(10**9)), 10**9)
        built.add("/tf", base_at(2.0, 1.0), 10**9)
        built.add("/drawn", CUBE_ON_BASE, 10**9)
        built.add("/clock", Clock(clock=Time.of(10**8), epoch=1), 10**8)
        built.add("/tf", base_at(0.5, 0.1), 10**8)
        built.add("/drawn", CUBE_ON_BASE, 10**8)
    for timeline, x in (("sim_time", 2.0), ("sim_time_2", 0.5)):
        _, centres = columns(file, "/displays/drawn/marker/0", "Boxes3D:centers", timeline)
        assert centres[-1][0] == [x, 0.0, 0.0]


def test_a_bag_shows_what_was_drawn(tmp_path: Path) -> None:
    file, warned = tmp_path / "run.rrd", list[str]()
    mount = TransformStamped(header=Header(frame_id="world"), child_frame_id="map", transform=Transform())
    with RecordingBuilder(file, [], EXTENT, warned.append) as built:
        built.add("/tf_static", TFMessage(transforms=(mount,)), 0)
        built.add("/drawn", MarkerArray(markers=(marker(1, Marker.CUBE),)), 10**9)
        built.add("/turtle1/pose", Pose(x=2.0), 10**9)
        built.add("/goal", PoseArray(header=Header(frame_id="map"), poses=(BodyPose(),)), 10**9)
        built.add("/turtle1/cmd_vel", Twist(), 10**9)
    assert not warned
    found = set(entities(file))
    assert {"/displays/drawn/a/1", "/turtles/turtle1/pose", "/displays/goal/marker/0"} <= found
