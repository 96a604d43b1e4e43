"""Manual driving through the panel's hub: dead-man switch, one driver per robot, stops."""

from __future__ import annotations

import pytest

from messages.geometry import Twist
from messages.nav import Odometry
from messages.std import Bool
from messages.topics import BASE_STATUS, CMD_VEL_STAMPED, GROUND_TRUTH
from services.panel.protocol import Drive, Estop, Release, Subscribe
from tests.services.panel.hub_harness import HubHarness


def speeds(at: HubHarness) -> list[float]:
    return [each.linear.x for each in at.robot.received("commands") if isinstance(each, Twist)]


def test_a_hand_that_stays_drives_twenty_times_a_second_and_one_that_falls_silent_stops(at: HubHarness) -> None:
    page = at.page()
    for _ in range(10):
        at.send(page, Drive(robot="/a", v=0.2, w=0.5))
        at.spin(0.1, tell=True)
    driven = speeds(at)
    assert set(driven) == {0.2}
    assert 16 <= len(driven) <= 26
    at.spin(at.params.silence + 0.06, tell=True)
    assert speeds(at)[-1] == 0.0
    at.spin(at.params.give_way + 0.2, tell=True)
    assert set(speeds(at)) == {0.0}
    at.spin(1.0, tell=True)
    assert speeds(at) == []
    assert all(each.name != "/a/cmd_vel" for each in at.hub._subscriptions._node.publishers), "others may drive now"


def test_a_hand_that_comes_back_is_obeyed_at_once(at: HubHarness) -> None:
    """The publisher is removed when others may drive; its numbering must continue, or bases drop its commands."""
    page = at.page()
    at.send(page, Subscribe(channels=("clock",)))
    for _ in range(20):
        at.send(page, Drive(robot="/a", v=0.2))
        at.spin(0.1, tell=True)
    at.send(page, Release())
    at.spin(at.params.give_way + 0.5, tell=True)
    assert all(each.name != "/a/cmd_vel" for each in at.hub._subscriptions._node.publishers), "it has ended"
    speeds(at)
    at.send(page, Drive(robot="/a", v=-0.1))
    at.spin(tell=True)
    assert speeds(at) == [-0.1]


@pytest.mark.parametrize("how", ["release", "close"])
def test_a_hand_that_goes_stops_at_once(at: HubHarness, how: str) -> None:
    page = at.page()
    at.send(page, Drive(robot="/a", v=0.2))
    at.spin(tell=True)
    assert speeds(at) == [0.2]
    if how == "release":
        at.send(page, Release())
    else:
        at.registry.close_page(page)
    at.spin(tell=True)
    assert speeds(at) == [0.0]


def test_a_robot_has_one_driver(at: HubHarness) -> None:
    one, other = at.page(), at.page()
    at.send(one, Drive(robot="/a", v=0.2))
    at.spin(tell=True)
    at.send(other, Drive(robot="/a", v=-0.2))
    at.spin(tell=True)
    assert -0.2 not in speeds(at)
    assert "another page is driving /a" in at.messages_to(other, "error")[0]["reason"]
    at.send(one, Release())
    at.spin(tell=True)
    at.send(other, Drive(robot="/a", v=-0.2))
    at.spin(tell=True)
    assert speeds(at)[-1] == -0.2


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (Drive(robot="/b", v=0.1), "unknown robot '/b'"),
        (Drive(robot="/a", v=5.0), "no page drives faster than 1 m/s and 3 rad/s"),
        (Drive(robot="/a", w=-9.0), "no page drives faster"),
    ],
)
def test_a_wrong_word_moves_nothing(at: HubHarness, said: Drive, reason: str) -> None:
    page = at.page()
    at.send(page, said)
    at.spin(tell=True)
    assert speeds(at) == []
    assert reason in at.messages_to(page, "error")[0]["reason"]


def test_time_that_begins_anew_ends_a_stop_that_was_held(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(channels=("clock",)))
    at.send(page, Drive(robot="/a", v=0.2))
    at.spin(0.1, tell=True)
    at.send(page, Release())
    at.spin(0.1, tell=True)
    at.robot.publish(0, epoch=1)
    at.spin()
    speeds(at)
    at.spin(1.0)
    assert speeds(at) == []


def test_a_panel_that_ends_stops_what_it_drives_in_the_time_of_the_simulation(at: HubHarness) -> None:
    stamped = at.robot.node.subscribe(CMD_VEL_STAMPED, "/s/cmd_vel")
    truth, _ = (
        at.robot.node.advertise(GROUND_TRUTH, "/s/ground_truth"),
        at.robot.node.advertise(BASE_STATUS, "/s/base_status"),
    )
    truth.publish(Odometry())
    page = at.page()
    at.send(page, Subscribe(channels=("clock",)))
    at.spin(0.2, tell=True)
    at.send(page, Drive(robot="/s", v=0.2))
    at.spin(0.1, tell=True)
    at.hub.drive_controller.close()
    stamped.update()
    commands = [message for message, _ in stamped.messages]
    assert commands[-1].twist.linear.x == 0.0
    assert commands[-1].header.stamp.ns >= commands[-2].header.stamp.ns > 0, "a base drops what has no time"


def test_a_stop_is_latched_for_one_and_for_all(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Estop(id=1, robot="/a", on=True))
    at.spin()
    assert at.robot.received("stops") == [Bool(data=True)]
    at.send(page, Estop(id=2, on=True))
    at.spin()
    assert at.robot.received("all_stops") == [Bool(data=True)]
    at.send(page, Estop(id=3, robot="/a", on=False))
    at.spin()
    replies = {each["id"]: each for each in at.messages_to(page, "reply")}
    assert [replies[1]["ok"], replies[2]["ok"], replies[3]["ok"]] == [True, True, False]
    assert "all robots are stopped" in replies[3]["result"]
    at.send(page, Estop(id=4, on=False))
    at.spin()
    assert at.robot.received("all_stops") == [Bool(data=False)]
    assert at.robot.received("stops")[-1] == Bool(data=False)
