"""What the panel sends about the world: outlines of bodies, moving bodies, and the selected robot's laser scan."""

from __future__ import annotations

import pytest

from messages.base import Float32Array
from messages.gazebo import WorldStates
from messages.geometry import Point, Pose, PoseWithCovariance, Quaternion, Transform, TransformStamped, Vector3
from messages.nav import Odometry
from messages.sensor import LaserScan
from messages.std import ColorRGBA, Header, Time
from messages.tf import TFMessage
from messages.topics import SCAN, TF_STATIC, WORLD_MARKERS, WORLD_STATES
from messages.visualization import Marker, MarkerArray
from services.panel.protocol import Subscribe
from tests.services.panel.hub_harness import HubHarness

SIZE = Vector3(x=1.0, y=2.0, z=0.5)
RED = ColorRGBA(r=1.0, g=0.0, b=0.0, a=1.0)
WALL = Marker(ns="fixed", text="wall", type=Marker.CUBE, scale=SIZE, color=RED, pose=Pose(position=Point(x=3.0)))
CART = Marker(ns="moving", text="cart", type=Marker.CUBE, scale=SIZE, color=RED)
GROUND = Marker(ns="ground", text="ground", type=Marker.CUBE, scale=SIZE)
STRANGE = Marker(ns="fixed", text="strange", type=77)


def test_a_page_gets_the_world_once_and_the_bodies_that_move_as_they_do(at: HubHarness) -> None:
    at.robot.node.advertise(WORLD_MARKERS).publish(MarkerArray(markers=(GROUND, WALL, STRANGE, CART)))
    states = at.robot.node.advertise(WORLD_STATES)
    at.spin(0.1)
    page = at.page()
    at.send(page, Subscribe(channels=("world", "bodies")))
    at.spin(0.2)
    (world,) = at.messages_to(page, "world")
    assert [(each["name"], each["kind"], each["colour"]) for each in world["bodies"]] == [
        ("wall", "fixed", "#ff0000ff"),
        ("cart", "moving", "#ff0000ff"),
    ]
    assert sorted(zip(*[iter(world["bodies"][0]["outlines"][0])] * 2, strict=True)) == [
        (2.5, -1.0),
        (2.5, 1.0),
        (3.5, -1.0),
        (3.5, 1.0),
    ]
    turned = Pose(position=Point(x=10.0), orientation=Quaternion.from_yaw(1.5707963267948966))
    states.publish(WorldStates(header=Header(stamp=Time.of(10**9)), name=("cart", "unknown"), pose=(turned, turned)))
    at.spin(0.2)
    assert at.messages_to(page, "world") == [], "it is told once"
    states.publish(WorldStates(name=("cart",), pose=(turned,)))
    at.spin(0.2)
    assert at.messages_to(page, "bodies") == [], "it has not moved again"
    late = at.page()
    at.send(late, Subscribe(channels=("bodies",)))
    at.spin(0.2)
    (outline,) = at.messages_to(late, "bodies")[-1]["outlines"]["cart"]
    at.send(late, Subscribe(channels=("world", "bodies")))
    at.spin(0.2)
    assert len(at.messages_to(late, "world")) == 1
    assert min(outline[::2]) == pytest.approx(9.0)
    assert max(outline[1::2]) == pytest.approx(0.5)
    for each in (page, late):
        at.send(each, Subscribe(channels=("world",)))
    at.spin(0.1)
    assert not states.has_subscribers, "nobody looks: nobody reads"


def test_the_laser_of_the_chosen_robot_comes_as_points_in_the_world(at: HubHarness) -> None:
    mount = Transform(translation=Vector3(x=0.5), rotation=Quaternion.from_yaw(3.141592653589793))
    fixed = TransformStamped(header=Header(frame_id="a/base"), child_frame_id="a/base_scan", transform=mount)
    at.robot.node.advertise(TF_STATIC, "/tf_static").publish(TFMessage(transforms=(fixed,)))
    scans = at.robot.node.advertise(SCAN, "/a/scan")
    page, other = at.page(), at.page()
    at.send(page, Subscribe(channels=("poses",), scan="/a"))
    at.send(other, Subscribe(channels=("poses",), scan="/nobody"))
    at.spin(0.2)
    assert scans.has_subscribers
    for ns, x in ((10**9, 1.0), (2 * 10**9, 3.0)):
        pose = PoseWithCovariance(pose=Pose.planar(x, 0))
        at.robot.truth.publish(
            Odometry(header=Header(stamp=Time.of(ns), frame_id="world"), child_frame_id="a/base", pose=pose)
        )
    header = Header(stamp=Time.of(15 * 10**8), frame_id="a/base_scan")
    ranges = Float32Array([1.0, float("inf"), 2.0])
    for _ in range(3):
        scans.publish(LaserScan(header=header, angle_increment=1.5707963267948966, range_max=3.5, ranges=ranges))
    at.spin(0.1)
    (scan,) = at.messages_to(page, "scan")
    # The robot was at x = 2; its laser is half a metre ahead and faces back.
    assert (scan["ns"], scan["points"]) == ("/a", pytest.approx([1.5, 0.0, 4.5, 0.0], abs=1e-3))
    assert at.messages_to(other, "scan") == []
    at.send(page, Subscribe(channels=("poses",)))
    at.spin(0.1)
    assert not scans.has_subscribers
