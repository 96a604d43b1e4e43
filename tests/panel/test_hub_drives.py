"""What the panel does on the bus for a hand that drives: a dead-man, one driver to a robot, stops."""

from __future__ import annotations

import pytest

from messages.geometry import Twist
from messages.nav import Odometry
from messages.std import Bool
from messages.topics import BASE_STATUS, GROUND_TRUTH
from services.panel.drive import STAMPED
from services.panel.words import Drive, Estop, Release, Want
from tests.panel.bench import Bench


def speeds(at: Bench) -> list[float]:
    return [each.linear.x for each in at.robot.heard("commands") if isinstance(each, Twist)]


def test_a_hand_that_stays_drives_twenty_times_a_second_and_one_that_falls_silent_stops(at: Bench) -> None:
    page = at.page()
    for _ in range(10):
        at.say(page, Drive(robot="/a", v=0.2, w=0.5))
        at.turn(0.1, tell=True)
    driven = speeds(at)
    assert set(driven) == {0.2}
    assert 16 <= len(driven) <= 26
    at.turn(at.params.silence + 0.06, tell=True)
    assert speeds(at)[-1] == 0.0
    at.turn(at.params.give_way + 0.2, tell=True)
    assert set(speeds(at)) == {0.0}
    at.turn(1.0, tell=True)
    assert speeds(at) == []
    assert all(each.name != "/a/cmd_vel" for each in at.hub._feeds._node.outputs), "others may drive now"


def test_a_hand_that_comes_back_is_obeyed_at_once(at: Bench) -> None:
    """The publication ends when others may drive; its numbers must not begin anew, or bases drop them as old."""
    page = at.page()
    at.say(page, Want(channels=("clock",)))
    for _ in range(20):
        at.say(page, Drive(robot="/a", v=0.2))
        at.turn(0.1, tell=True)
    at.say(page, Release())
    at.turn(at.params.give_way + 0.5, tell=True)
    assert all(each.name != "/a/cmd_vel" for each in at.hub._feeds._node.outputs), "it has ended"
    speeds(at)
    at.say(page, Drive(robot="/a", v=-0.1))
    at.turn(tell=True)
    assert speeds(at) == [-0.1]


@pytest.mark.parametrize("how", ["release", "close"])
def test_a_hand_that_goes_stops_at_once(at: Bench, how: str) -> None:
    page = at.page()
    at.say(page, Drive(robot="/a", v=0.2))
    at.turn(tell=True)
    assert speeds(at) == [0.2]
    if how == "release":
        at.say(page, Release())
    else:
        at.board.leave(page)
    at.turn(tell=True)
    assert speeds(at) == [0.0]


def test_a_robot_has_one_driver(at: Bench) -> None:
    one, other = at.page(), at.page()
    at.say(one, Drive(robot="/a", v=0.2))
    at.turn(tell=True)
    at.say(other, Drive(robot="/a", v=-0.2))
    at.turn(tell=True)
    assert -0.2 not in speeds(at)
    assert "another page drives /a" in at.told(other, "error")[0]["reason"]
    at.say(one, Release())
    at.turn(tell=True)
    at.say(other, Drive(robot="/a", v=-0.2))
    at.turn(tell=True)
    assert speeds(at)[-1] == -0.2


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (Drive(robot="/b", v=0.1), "unknown robot '/b'"),
        (Drive(robot="/a", v=5.0), "no page drives faster than 1 m/s and 3 rad/s"),
        (Drive(robot="/a", w=-9.0), "no page drives faster"),
    ],
)
def test_a_wrong_word_moves_nothing(at: Bench, said: Drive, reason: str) -> None:
    page = at.page()
    at.say(page, said)
    at.turn(tell=True)
    assert speeds(at) == []
    assert reason in at.told(page, "error")[0]["reason"]


def test_time_that_begins_anew_ends_a_stop_that_was_held(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(channels=("clock",)))
    at.say(page, Drive(robot="/a", v=0.2))
    at.turn(0.1, tell=True)
    at.say(page, Release())
    at.turn(0.1, tell=True)
    at.robot.tell(0, epoch=1)
    at.turn()
    speeds(at)
    at.turn(1.0)
    assert speeds(at) == []


def test_a_panel_that_ends_stops_what_it_drives_in_the_time_of_the_simulation(at: Bench) -> None:
    stamped = at.robot.node.read(STAMPED, "/s/cmd_vel")
    truth, _ = at.robot.node.write(GROUND_TRUTH, "/s/ground_truth"), at.robot.node.write(BASE_STATUS, "/s/base_status")
    truth.publish(Odometry())
    page = at.page()
    at.say(page, Want(channels=("clock",)))
    at.turn(0.2, tell=True)
    at.say(page, Drive(robot="/s", v=0.2))
    at.turn(0.1, tell=True)
    at.hub.driver.close()
    stamped.admit()
    commands = [message for message, _ in stamped.batch]
    assert commands[-1].twist.linear.x == 0.0
    assert commands[-1].header.stamp.ns >= commands[-2].header.stamp.ns > 0, "a base drops what has no time"


def test_a_stop_is_latched_for_one_and_for_all(at: Bench) -> None:
    page = at.page()
    at.say(page, Estop(id=1, robot="/a", on=True))
    at.turn()
    assert at.robot.heard("stops") == [Bool(data=True)]
    at.say(page, Estop(id=2, on=True))
    at.turn()
    assert at.robot.heard("all_stops") == [Bool(data=True)]
    at.say(page, Estop(id=3, robot="/a", on=False))
    at.turn()
    replies = {each["id"]: each for each in at.told(page, "reply")}
    assert [replies[1]["ok"], replies[2]["ok"], replies[3]["ok"]] == [True, True, False]
    assert "all robots are stopped" in replies[3]["is"]
    at.say(page, Estop(id=4, on=False))
    at.turn()
    assert at.robot.heard("all_stops") == [Bool(data=False)]
    assert at.robot.heard("stops")[-1] == Bool(data=False)
