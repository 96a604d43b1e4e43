"""``topic list``, ``type``, ``find`` and ``info`` on a running fleet."""

from __future__ import annotations

import pytest

from messages.topics import ODOM
from tests.harness.background_fleet import WEATHER, BackgroundFleet, external_publisher


def test_list(running: BackgroundFleet) -> None:
    names = running.run("topic", "list").out.splitlines()
    assert {"/clock", "/tb3_0/odom", "/tb3_1/camera/image", "/rosout"} <= set(names)
    assert names == sorted(names)
    assert int(running.run("topic", "list", "-c").out) == len(names)
    assert "/tb3_0/odom [nav_msgs/Odometry]\n" in running.run("topic", "list", "-t").out
    shown = running.run("topic", "list", "-v").out
    assert "/tb3_0/odom [nav_msgs/Odometry, sensor, 25 Hz]\n  <- /sim\n  -> /grader\n" in shown
    told = {each["name"]: each for each in running.run_json("topic", "list")}
    assert list(told) == names
    odom = told["/tb3_0/odom"]
    assert (odom["types"], odom["quality"], odom["promised"]) == (["nav_msgs/Odometry"], "sensor", 25)
    assert (odom["publishers"], odom["about"]) == (["/sim"], ODOM.about)


def test_list_hears_who_declares_nothing(running: BackgroundFleet) -> None:
    with external_publisher(running.endpoint, "lab/weather", WEATHER):
        assert "/lab/weather" not in running.run("topic", "list").out
        shown = running.run("topic", "list", "-v", "--listen", "0.5").out
    assert "/lab/weather [?, foreign]\n" in shown
    assert "/tb3_0/odom [nav_msgs/Odometry, sensor, 25 Hz]\n" in shown


def test_type_and_find(running: BackgroundFleet) -> None:
    assert running.run("topic", "type", "/tb3_0/scan").out == "sensor_msgs/LaserScan\n"
    assert running.run_json("topic", "type", "tb3_0/scan")["types"] == ["sensor_msgs/LaserScan"]
    for spelling in ("geometry_msgs/Twist", "geometry_msgs/msg/Twist"):
        assert running.run("topic", "find", spelling).out == "/tb3_0/cmd_vel\n/tb3_1/cmd_vel\n"
    assert running.run("topic", "find", "-c", "geometry_msgs/Twist").out == "2\n"
    assert running.run_json("topic", "find", "rosgraph_msgs/Clock") == ["/clock"]
    found = running.run("topic", "find", "geometry_msgs/Pose", status=1)
    assert "no topic has the type geometry_msgs/Pose now" in found.err


def test_info(running: BackgroundFleet) -> None:
    short = running.run("topic", "info", "/tb3_0/odom").out
    assert short.startswith("Type: nav_msgs/Odometry\n")
    assert "Publisher count: 1\nSubscription count: 1\n" in short
    long = running.run_json("topic", "info", "-v", "tb3_0/odom")
    [publisher], [subscriber] = long["publishers"], long["subscribers"]
    assert (publisher["node"], publisher["quality"]) == ("/sim", "sensor")
    assert publisher["hz"] == pytest.approx(25)
    assert publisher["sent"] > 0
    assert (subscriber["node"], subscriber["lost"], subscriber["refused"]) == ("/grader", 0, 0)
    assert subscriber["received"] > 0


def test_info_shows_foreigners(running: BackgroundFleet) -> None:
    twist = {"linear": {"x": 0.0}}
    with external_publisher(
        running.endpoint, "tb3_1/cmd_vel", twist, encoding="application/msgpack;geometry_msgs/Twist"
    ):
        told = running.run("topic", "info", "-v", "/tb3_1/cmd_vel").out
    assert "  (foreign)  [geometry_msgs/Twist, -]  " in told
    assert "  /sim  [geometry_msgs/Twist, command]  received " in told
