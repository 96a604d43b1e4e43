"""What the panel sends to pages about markers, other displays drawn as markers, and turtles."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from messages.geometry import (
    Point,
    PointStamped,
    Pose,
    PoseArray,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from messages.nav import MapMetaData, OccupancyGrid, Path
from messages.std import ColorRGBA, Duration, Header, Time
from messages.tf import TFMessage
from messages.topics import CMD_VEL, MAP, PLAN, TF, TF_STATIC, TURTLE_POSE, Quality, Topic
from messages.turtlesim import Pose as TurtlePose
from messages.visualization import Marker, MarkerArray
from services.panel.protocol import Drive, Subscribe
from tests.services.panel.hub_harness import HubHarness

RED = ColorRGBA(r=1.0, a=1.0)
MARKERS = Topic("/drawn", MarkerArray, 0, Quality.EVENT, "")
LINE = Marker(ns="way", type=Marker.LINE_STRIP, scale=Vector3(x=0.1), color=RED, points=(Point(), Point(x=2.0)))
UNSET = Pose(orientation=Quaternion(w=0.0))
"""The default pose of a ROS 1 message."""
BOX = Marker(ns="box", id=7, type=Marker.CUBE, scale=Vector3(x=1.0, y=1.0, z=1.0), color=RED, pose=UNSET)


def test_markers_of_any_node_come_as_they_change(at: HubHarness) -> None:
    drawn = at.robot.node.advertise(MARKERS)
    page = at.page()
    at.send(page, Subscribe(channels=("markers",)))
    at.spin(0.2)
    drawn.publish(MarkerArray(markers=(LINE, BOX, Marker(ns="odd", type=77))))
    at.spin(0.2)
    (told,) = [each for each in at.messages_to(page, "markers") if each["shapes"]]
    line, box = told["shapes"]
    assert (line["id"], line["topic"], line["kind"], line["colour"], line["width"]) == (
        "/drawn way 0",
        "/drawn",
        "line",
        "#ff0000ff",
        0.1,
    )
    assert line["outlines"] == [[0.0, 0.0, 2.0, 0.0]]
    assert (box["kind"], sorted(set(box["outlines"][0]))) == ("area", [-0.5, 0.5])
    drawn.publish(MarkerArray(markers=(Marker(ns="way", action=2),)))
    at.spin(0.2)
    (told,) = at.messages_to(page, "markers")
    assert (told["first"], told["shapes"], told["gone"]) == (False, [], ["/drawn way 0"])
    late = at.page()
    at.send(late, Subscribe(channels=("markers",)))
    at.spin(0.2)
    (told,) = at.messages_to(late, "markers")
    assert (told["first"], [each["id"] for each in told["shapes"]]) == (True, ["/drawn box 7"])
    drawn.publish(MarkerArray(markers=(Marker(action=3), LINE)))
    at.spin(0.2)
    (told,) = at.messages_to(late, "markers")
    assert ([each["id"] for each in told["shapes"]], told["gone"]) == (["/drawn way 0"], ["/drawn box 7"])
    at.robot.node.unregister(drawn)
    at.spin(0.2)
    assert at.messages_to(late, "markers")[-1]["gone"] == ["/drawn way 0"], "its sender is gone"


def test_a_marker_is_gone_after_its_lifetime_of_simulated_time(at: HubHarness) -> None:
    drawn, page, second = at.robot.node.advertise(MARKERS), at.page(), 10**9
    at.send(page, Subscribe(channels=("clock", "markers")))
    at.spin(0.2)
    at.robot.publish(second)
    at.spin(0.2)
    short = replace(BOX, lifetime=Duration(nanosec=5 * 10**8))
    drawn.publish(MarkerArray(markers=(short, replace(short, id=8, lifetime=Duration(sec=3)), LINE)))
    at.spin(2.0)
    assert not any(each["gone"] for each in at.messages_to(page, "markers")), "time stands still"
    at.robot.publish(2 * second)
    at.spin(0.3)
    assert [each["gone"] for each in at.messages_to(page, "markers")] == [["/drawn box 7"]]
    at.robot.publish(0, epoch=1)
    at.spin(0.3)
    at.robot.publish(35 * 10**8, epoch=1)
    at.spin(0.3)
    assert [each["gone"] for each in at.messages_to(page, "markers")] == [["/drawn box 8"]]
    late = at.page()
    at.send(late, Subscribe(channels=("markers",)))
    at.spin(0.2)
    assert [each["id"] for each in at.messages_to(late, "markers")[-1]["shapes"]] == ["/drawn way 0"]


def test_a_lifetime_counts_while_no_page_is_open(at: HubHarness) -> None:
    drawn, page, second = at.robot.node.advertise(MARKERS), at.page(), 10**9
    at.send(page, Subscribe(channels=("markers",)))
    at.spin(0.2)
    at.robot.publish(10 * second)
    at.spin(0.2)
    at.registry.close_page(page)
    at.spin(0.2)
    at.robot.publish(100 * second)
    at.spin(0.2)
    drawn.publish(MarkerArray(markers=(replace(BOX, lifetime=Duration(sec=20)),)))
    at.spin(0.2)
    late = at.page()
    at.send(late, Subscribe(channels=("markers",)))
    at.spin(0.2)
    at.robot.publish(101 * second)
    at.spin(0.3)
    (told,) = at.messages_to(late, "markers")
    assert [each["id"] for each in told["shapes"]] == ["/drawn box 7"]
    at.robot.publish(121 * second)
    at.spin(0.3)
    assert at.messages_to(late, "markers")[-1]["gone"] == ["/drawn box 7"]


def placed(frame: str, x: float, seconds: float = 0.0) -> TFMessage:
    """Return the pose of a frame in the world at a time."""
    header = Header(stamp=Time.of(round(seconds * 1e9)), frame_id="world")
    transform = Transform(translation=Vector3(x=x))
    return TFMessage(transforms=(TransformStamped(header=header, child_frame_id=frame, transform=transform),))


def test_after_a_reset_the_frames_of_the_run_before_are_gone(at: HubHarness) -> None:
    drawn, frames, page = at.robot.node.advertise(MARKERS), at.robot.node.advertise(TF), at.page()
    on_base = MarkerArray(markers=(replace(LINE, header=Header(frame_id="base")),))
    at.send(page, Subscribe(channels=("clock", "markers")))
    at.spin(0.2)
    for seconds, epoch, x in ((100.0, 0, 50.0), (1.0, 1, 3.0)):
        at.robot.publish(round(seconds * 1e9), epoch=epoch)
        at.spin(0.2)
        frames.publish(placed("base", x, seconds))
        at.spin(0.2)
        drawn.publish(on_base)
        at.spin(0.2)
        (line,) = at.messages_to(page, "markers")[-1]["shapes"]
        assert line["outlines"] == [[x, 0.0, x + 2.0, 0.0]]


def test_what_is_shown_moves_when_its_frame_becomes_known(at: HubHarness) -> None:
    """Latched maps and paths are sent once, and nodes of a launch file start in any order."""
    drawn, frames, page = at.robot.node.advertise(MARKERS), at.robot.node.advertise(TF_STATIC, "/tf_static"), at.page()
    at.send(page, Subscribe(channels=("markers",)))
    at.spin(0.2)
    drawn.publish(MarkerArray(markers=(replace(LINE, header=Header(frame_id="map")), BOX)))
    at.spin(0.2)
    assert at.messages_to(page, "markers")[-1]["shapes"][0]["outlines"] == [[0.0, 0.0, 2.0, 0.0]]
    frames.publish(placed("map", 10.0))
    at.spin(0.2)
    (told,) = at.messages_to(page, "markers")
    assert [(each["id"], each["outlines"]) for each in told["shapes"]] == [("/drawn way 0", [[10.0, 0.0, 12.0, 0.0]])]
    frames.publish(placed("other", 10.0))
    at.spin(0.2)
    assert at.messages_to(page, "markers") == [], "nothing is drawn in that frame"


def test_paths_poses_and_maps_are_drawn_in_the_world_but_not_what_is_drawn_anyway(at: HubHarness) -> None:
    turned = Transform(translation=Vector3(x=10.0), rotation=Pose.planar(0, 0, 1.5707963267948966).orientation)
    mount = TransformStamped(header=Header(frame_id="world"), child_frame_id="map", transform=turned)
    node, header = at.robot.node, Header(frame_id="map")
    node.advertise(TF_STATIC, "/tf_static").publish(TFMessage(transforms=(mount,)))
    page = at.page()
    at.send(page, Subscribe(channels=("markers", "robots")))
    points = (PoseStamped(), PoseStamped(pose=Pose.planar(1.0, 0.0)))
    cells = MapMetaData(resolution=0.5, width=2, height=2)
    for topic, message in (
        (Topic("/way", Path, 0, Quality.EVENT, ""), Path(header=header, poses=points)),
        (Topic("/goals", PoseArray, 0, Quality.EVENT, ""), PoseArray(header=header, poses=(Pose(), Pose()))),
        (Topic("/seen", PointStamped, 0, Quality.EVENT, ""), PointStamped(header=Header(frame_id="unknown"))),
        (MAP.named("/map"), OccupancyGrid(header=header, info=cells, data=(100, 0, -1, 0))),
        (PLAN.named("/a/plan"), Path(header=header, poses=points)),
    ):
        output = node.advertise(topic)
        at.spin(0.2)
        output.publish(message)
    at.spin(0.2)
    shapes = {each["id"]: each for told in at.messages_to(page, "markers") for each in told["shapes"]}
    assert list(shapes) == ["/way  0", "/goals  0", "/goals  1", "/seen  0", "/map  0", "/map  1"]
    assert shapes["/way  0"]["outlines"] == [[10.0, 0.0, 10.0, 1.0]], "in the world, a quarter turn to the left"
    floor, wall = shapes["/map  0"], shapes["/map  1"]
    assert (len(floor["outlines"]), len(wall["outlines"])) == (2, 2), "two triangles each"
    assert min(wall["outlines"][0][0::2]) == pytest.approx(9.5)


def test_a_turtle_is_a_robot_with_a_pose_alone(at: HubHarness) -> None:
    node = at.robot.node
    poses, commands = node.advertise(TURTLE_POSE, "/turtle1/pose"), node.subscribe(CMD_VEL, "/turtle1/cmd_vel")
    node.advertise(Topic("pose", PoseStamped, 0, Quality.EVENT, ""), "/other/pose")
    page = at.page()
    at.send(page, Subscribe(channels=("poses", "robots")))
    at.spin(0.2)
    poses.publish(TurtlePose(x=1.0, y=2.0, theta=0.5, linear_velocity=0.3))
    at.spin(0.2)
    robots = {each["ns"]: each for each in at.messages_to(page, "robots")[-1]["robots"]}
    assert list(robots) == ["/a", "/turtle1"]
    turtle = robots["/turtle1"]
    assert (turtle["model"], turtle["drives"], turtle["stops"], turtle["goals"]) == ("turtle", True, False, False)
    at.spin(0.1)
    at.send(page, Drive(robot="/turtle1", v=0.5, w=0.25))
    at.spin(0.1)
    commands.update()
    assert [(each.linear.x, each.angular.z) for each, _ in commands.messages[-1:]] == [(0.5, 0.25)]
