"""``topic list``, ``type``, ``find`` and ``info`` on a running fleet."""

from __future__ import annotations

from typing import Any

import pytest

from messages.topics import ODOM
from tests.harness.background_fleet import WEATHER, BackgroundFleet, external_publisher
from tests.harness.message_recorder import WITHIN_S
from tests.harness.waiting import wait_until


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
    """A busy machine may let a publisher be silent for as long as a command listens: it is listened to again."""

    def heard() -> str:
        shown = running.run("topic", "list", "-v", "--listen", "0.5").out
        return shown if "/lab/weather" in shown else ""

    with external_publisher(running.endpoint, "lab/weather", WEATHER):
        assert "/lab/weather" not in running.run("topic", "list").out
        shown = wait_until(heard, WITHIN_S, "a publisher that is heard")
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

    def heard() -> Any:
        """Return both ends, unless one sent nothing, or no heartbeat, while the command listened."""
        long = running.run_json("topic", "info", "-v", "tb3_0/odom")
        [publisher], [subscriber] = long["publishers"], long["subscribers"]
        silent = None in (publisher["hz"], publisher["sent"], subscriber["received"])
        return None if silent else (publisher, subscriber)

    publisher, subscriber = wait_until(heard, WITHIN_S, "heartbeats of both ends")
    assert (publisher["node"], publisher["quality"]) == ("/sim", "sensor")
    assert publisher["hz"] == pytest.approx(25)
    assert publisher["sent"] > 0
    assert (subscriber["node"], subscriber["refused"]) == ("/grader", 0)
    assert 0 <= subscriber["lost"] < subscriber["received"]


def test_info_shows_foreigners(running: BackgroundFleet) -> None:
    twist = {"linear": {"x": 0.0}}
    with external_publisher(
        running.endpoint, "tb3_1/cmd_vel", twist, encoding="application/msgpack;geometry_msgs/Twist"
    ):

        def heard() -> str:
            told = running.run("topic", "info", "-v", "/tb3_1/cmd_vel").out
            return told if "(foreign)" in told and "no heartbeat for a second" not in told else ""

        told = wait_until(heard, WITHIN_S, "the publisher, and a heartbeat of the simulation")
    assert "  (foreign)  [geometry_msgs/Twist, -]  " in told
    assert "  /sim  [geometry_msgs/Twist, command]  received " in told
