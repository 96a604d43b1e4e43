"""What the panel does on the bus for its pages: driving with a dead-man, stops, goals, and who gets what."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from math import pi

import pytest

from messages.geometry import Pose, PoseStamped, Twist
from messages.nav import Odometry, Path
from messages.requests import PAUSE
from messages.simulation import SimTime
from messages.std import Bool
from messages.topics import BASE_STATUS, E_STOP, GROUND_TRUTH, PLAN
from services.panel.drive import STAMPED
from services.panel.frame import MARK
from services.panel.words import Drive, Estop, Goal, Pause, Release, Want, Wish
from tests.panel.bench import Bench, bench, node


@pytest.fixture
def at() -> Iterator[Bench]:
    with bench() as made:
        made.turn(0.1, tell=True)
        yield made


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


def test_a_goal_of_the_world_goes_out_in_the_frame_that_the_robot_drives_by(at: Bench) -> None:
    page = at.page()
    at.say(page, Goal(id=1, robot="/a", x=1.0, y=5.0, yaw=pi / 2))
    at.turn(tell=True)
    assert "no odometry from /a yet" in at.told(page, "reply")[0]["is"]
    at.say(page, Want(channels=("poses", "robots")))
    at.turn(0.2, tell=True)
    at.say(page, Goal(id=2, robot="/a", x=1.0, y=5.0, yaw=pi / 2))
    at.turn(tell=True)
    (goal,) = at.robot.heard("goals")
    assert goal.header.frame_id == "a/odom"
    assert (goal.pose.position.x, goal.pose.position.y) == pytest.approx((3.0, 0.0))
    assert goal.pose.orientation.yaw == pytest.approx(0.0)


def test_the_panel_reads_of_a_robot_what_is_told_and_shows_who_can_be_stopped(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(channels=("poses", "robots")))
    at.turn(0.2, tell=True)
    told = {each.name for each in at.hub._feeds._node.inputs if each.name.startswith("/a/")}
    assert told == {"/a/ground_truth", "/a/odom", "/a/base_status"}, "no subscription to what nobody publishes"
    [robot] = at.told(page, "robots")[-1]["robots"]
    assert (robot["ns"], robot["drives"], robot["stops"]) == ("/a", True, True)
    at.robot.node.write(PLAN, "/a/plan").publish(Path(poses=(PoseStamped(pose=Pose.planar(1.0, 0.0)),)))
    at.turn(0.3, tell=True)
    assert at.told(page, "robots")[-1]["robots"][0]["plan"] == [pytest.approx([1.0, 3.0])], "taken up as it comes"


def test_poses_lie_in_the_world(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(channels=("poses",)))
    at.turn(0.2, tell=True)
    at.robot.tell(10**9, x=3.0)
    at.turn(0.1)
    pose = at.told(page, "poses")[-1]["at"]["/a"]
    assert pose[3:6] == pytest.approx([1.0, 5.0, 1.5708], abs=1e-3)


def test_samples_come_once_each_and_only_while_they_are_wanted(at: Bench) -> None:
    page = at.page()
    wish = Wish(id=7, topic="/a/odom", path="pose.pose.position.x")
    at.say(page, Want(series=(wish,)))
    at.turn(0.1)
    for number in range(5):
        at.robot.tell(10**9 + number * 10**7, x=float(number))
        at.turn()
    times, values = [], []
    for frame in [each for each in page.take() if isinstance(each, bytes)]:
        assert struct.unpack_from("<I", frame)[0] == MARK
        id_, count = struct.unpack_from("<2I", frame, 16)
        assert id_ == 7
        times += struct.unpack_from(f"<{count}d", frame, 24)
        values += struct.unpack_from(f"<{count}d", frame, 24 + 8 * count)
    assert values == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert times == pytest.approx([1.0, 1.01, 1.02, 1.03, 1.04])
    assert at.robot.odom.wanted
    at.say(page, Want())
    at.turn()
    assert not at.robot.odom.wanted, "nobody looks: nobody reads"


def test_a_topic_that_is_not_there_yet_is_taken_up_when_it_comes(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(series=(Wish(id=1, topic="/later", path="data"),), fields=("/later",)))
    at.turn(1.0)
    assert at.told(page, "fields")[-1]["fields"] is None
    from messages.topics import E_STOP

    late = at.robot.node.write(E_STOP, "/later")
    at.turn()
    late.publish(Bool(data=True))
    at.turn(0.5)
    told = at.told(page, "fields")
    assert told[-1]["fields"] == [["data", True]]


def test_a_request_is_answered_while_the_loop_goes_on_or_refused_when_nobody_serves_it(at: Bench) -> None:
    page = at.page()
    at.say(page, Pause(id=1))
    at.turn(0.1)
    reply = at.told(page, "reply")[0]
    assert not reply["ok"]
    assert "nobody serves /sim/pause" in reply["is"]
    at.robot.node.serve(PAUSE, lambda _: SimTime(tick=5))
    at.say(page, Pause(id=2))
    at.turn()
    assert at.told(page, "reply") == []
    at.robot.node.turn()
    at.turn(0.1)
    assert at.told(page, "reply")[0]["is"]["tick"] == 5


def test_a_page_has_few_requests_under_way(at: Bench) -> None:
    page = at.page()
    at.robot.node.serve(PAUSE, lambda _: SimTime())
    for number in range(20):
        at.say(page, Pause(id=number))
    at.turn()
    replies = at.told(page, "reply")
    assert len(replies) == 12
    assert all("wait for their answers" in each["is"] for each in replies)


def test_the_graph_follows_who_comes_and_goes(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(channels=("graph",)))
    at.turn(0.5)
    graph = at.told(page, "graph")[-1]
    assert {each["name"] for each in graph["nodes"]} == {"/panel", "/sim"}
    odom = next(each for each in graph["topics"] if each["name"] == "/a/odom")
    assert (odom["types"], odom["pubs"], odom["promised"]) == (["nav_msgs/Odometry"], ["/sim"], 25)
    at.robot.node.transport.close()
    at.turn(0.5)
    assert {each["name"] for each in at.told(page, "graph")[-1]["nodes"]} == {"/panel"}


def test_a_rate_is_told_once_it_is_known_and_the_age_is_that_of_the_newest_publisher(at: Bench) -> None:
    page = at.page()
    at.say(page, Want(channels=("rates",)))
    at.turn(0.5, tell=True)
    with node(at.bus, "other") as other:
        outputs = [at.robot.node.write(E_STOP, "/both"), other.write(E_STOP, "/both")]

        def beat(seconds: float, speakers: int) -> dict[str, float]:
            for each in outputs[:speakers]:
                each.publish(Bool(data=True))
            for each in (at.robot.node, other):
                each.heart.hurry()
                each.turn()
            at.turn(seconds, tell=True)
            topics = at.told(page, "rates")[-1]["topics"]
            assert isinstance(topics, dict)
            return topics.get("/both", {})

        assert beat(1.0, 2) == {}, "one heartbeat tells no rate"
        assert beat(1.0, 2)["age"] <= 1.0
        for _ in range(4):
            told = beat(1.0, 1)
        assert told["age"] <= 1.0, "one of the two goes on"
