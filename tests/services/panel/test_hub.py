"""The panel's hub between bus and pages: goals, poses, samples, requests, and the graph."""

from __future__ import annotations

import struct
from math import pi

import pytest

from messages.elea import EmergencyStop, EmergencyStops
from messages.geometry import Pose, PoseStamped
from messages.nav import Path
from messages.requests import PAUSE
from messages.simulation import SimTime
from messages.std import Bool, Header, Time
from messages.topics import E_STOP, PLAN, STOPS, Quality, Topic
from services.panel.pages import Page
from services.panel.protocol import MAGIC, Drive, Estop, Goal, Pause, PlotSeries, Subscribe
from services.runtime.publisher import Publisher
from services.runtime.transport.memory import MemoryTransport
from services.runtime.transport.wire import node_id
from tests.services.panel.hub_harness import FakeRobot, HubHarness, memory_node


def test_a_goal_of_the_world_goes_out_in_the_frame_that_the_robot_drives_by(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Goal(id=1, robot="/a", x=1.0, y=5.0, yaw=pi / 2))
    at.spin(tell=True)
    assert "no odometry from /a yet" in at.messages_to(page, "reply")[0]["result"]
    at.send(page, Subscribe(channels=("poses", "robots")))
    at.spin(0.2, tell=True)
    at.send(page, Goal(id=2, robot="/a", x=1.0, y=5.0, yaw=pi / 2))
    at.spin(tell=True)
    (goal,) = at.robot.received("goals")
    assert goal.header.frame_id == "a/odom"
    assert (goal.pose.position.x, goal.pose.position.y) == pytest.approx((3.0, 0.0))
    assert goal.pose.orientation.yaw == pytest.approx(0.0)


def test_the_panel_reads_of_a_robot_what_is_told_and_shows_who_can_be_stopped(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(channels=("poses", "robots")))
    at.spin(0.2, tell=True)
    told = {each.name for each in at.hub._subscriptions._node.subscribers if each.name.startswith("/a/")}
    assert told == {"/a/ground_truth", "/a/odom", "/a/base_status"}, "no subscription to what nobody publishes"
    [robot] = at.messages_to(page, "robots")[-1]["robots"]
    assert (robot["ns"], robot["drives"], robot["stops"]) == ("/a", True, True)
    at.robot.node.advertise(PLAN, "/a/plan").publish(Path(poses=(PoseStamped(pose=Pose.planar(1.0, 0.0)),)))
    at.spin(0.3, tell=True)
    assert at.messages_to(page, "robots")[-1]["robots"][0]["plan"] == [pytest.approx([1.0, 3.0])], (
        "taken up as it comes"
    )


def test_poses_lie_in_the_world(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(channels=("poses",)))
    at.spin(0.2, tell=True)
    at.robot.publish(10**9, x=3.0)
    at.spin(0.1)
    pose = at.messages_to(page, "poses")[-1]["at"]["/a"]
    assert pose[3:6] == pytest.approx([1.0, 5.0, 1.5708], abs=1e-3)


def test_a_robot_that_is_gone_has_no_pose(at: HubHarness) -> None:
    page, robot = at.page(), at.robot
    at.send(page, Subscribe(channels=("poses",)))
    at.spin(0.2)
    robot.publish(10**9)
    at.spin(0.2)
    assert list(at.messages_to(page, "poses")[-1]["at"]) == ["/a"]
    robot.node.unregister(robot.truth, robot.odom, robot.status)
    at.spin(0.2)
    assert at.messages_to(page, "poses")[-1]["at"] == {}


def test_a_stamp_of_another_clock_is_replaced_by_the_time_of_sending(at: HubHarness) -> None:
    """A stamp of wall time would move the plots' common window to where no other line is."""
    poses = at.robot.node.advertise(Topic("/seen", PoseStamped, 0, Quality.EVENT, ""))
    page = at.page()
    at.send(page, Subscribe(series=(PlotSeries(id=7, topic="/seen", path="pose.position.x"),)))
    at.spin(0.1)
    at.robot.publish(10**9)
    at.spin(0.1)
    for stamp in (1_700_000_000 * 10**9, 9 * 10**8, 0):
        poses.publish(PoseStamped(header=Header(stamp=Time.of(stamp)), pose=Pose.planar(1.0, 0.0)))
    at.spin(0.1)
    (frame,) = [each for each in page.drain() if isinstance(each, bytes)]
    assert struct.unpack_from("<3d", frame, 24) == (1.0, 0.9, 1.0)


def test_samples_come_once_each_and_only_while_they_are_wanted(at: HubHarness) -> None:
    page = at.page()
    wish = PlotSeries(id=7, topic="/a/odom", path="pose.pose.position.x")
    at.send(page, Subscribe(series=(wish,)))
    at.spin(0.1)
    for number in range(5):
        at.robot.publish(10**9 + number * 10**7, x=float(number))
        at.spin()
    times, values = [], []
    for frame in [each for each in page.drain() if isinstance(each, bytes)]:
        assert struct.unpack_from("<I", frame)[0] == MAGIC
        id_, count = struct.unpack_from("<2I", frame, 16)
        assert id_ == 7
        times += struct.unpack_from(f"<{count}d", frame, 24)
        values += struct.unpack_from(f"<{count}d", frame, 24 + 8 * count)
    assert values == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert times == pytest.approx([1.0, 1.01, 1.02, 1.03, 1.04])
    assert at.robot.odom.has_subscribers
    at.send(page, Subscribe())
    at.spin()
    assert not at.robot.odom.has_subscribers, "nobody looks: nobody reads"


def test_a_topic_that_is_not_there_yet_is_taken_up_when_it_comes(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(series=(PlotSeries(id=1, topic="/later", path="data"),), fields=("/later",)))
    at.spin(1.0)
    assert at.messages_to(page, "fields")[-1]["fields"] is None
    from messages.topics import E_STOP

    late = at.robot.node.advertise(E_STOP, "/later")
    at.spin()
    late.publish(Bool(data=True))
    at.spin(0.5)
    told = at.messages_to(page, "fields")
    assert told[-1]["fields"] == [["data", True]]


def test_a_request_is_answered_while_the_loop_goes_on_or_refused_when_nobody_serves_it(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Pause(id=1))
    at.spin(0.1)
    reply = at.messages_to(page, "reply")[0]
    assert not reply["ok"]
    assert "no server for /sim/pause" in reply["result"]
    at.robot.node.serve(PAUSE, lambda _: SimTime(tick=5))
    at.send(page, Pause(id=2))
    at.spin()
    assert at.messages_to(page, "reply") == []
    at.robot.node.spin_once()
    at.spin(0.1)
    assert at.messages_to(page, "reply")[0]["result"]["tick"] == 5


def test_a_page_has_few_requests_under_way(at: HubHarness) -> None:
    page = at.page()
    at.robot.node.serve(PAUSE, lambda _: SimTime())
    for number in range(20):
        at.send(page, Pause(id=number))
    at.spin()
    replies = at.messages_to(page, "reply")
    assert len(replies) == 12
    assert all("waiting for an answer" in each["result"] for each in replies)


def test_the_graph_follows_who_comes_and_goes(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(channels=("graph",)))
    at.spin(0.5)
    graph = at.messages_to(page, "graph")[-1]
    assert {each["name"] for each in graph["nodes"]} == {"/panel", "/sim"}
    odom = next(each for each in graph["topics"] if each["name"] == "/a/odom")
    assert (odom["types"], odom["pubs"], odom["promised"]) == (["nav_msgs/Odometry"], ["/sim"], 25)
    at.robot.node.transport.close()
    at.spin(0.5)
    assert {each["name"] for each in at.messages_to(page, "graph")[-1]["nodes"]} == {"/panel"}


def test_a_rate_is_told_once_it_is_known_and_the_age_is_that_of_the_newest_publisher(at: HubHarness) -> None:
    page = at.page()
    at.send(page, Subscribe(channels=("rates",)))
    at.spin(0.5, tell=True)
    with memory_node(at.bus, "other") as other:
        outputs = [at.robot.node.advertise(E_STOP, "/both"), other.advertise(E_STOP, "/both")]

        def beat(seconds: float, speakers: int) -> dict[str, float]:
            for each in outputs[:speakers]:
                each.publish(Bool(data=True))
            for each in (at.robot.node, other):
                each.heartbeat.request_now()
                each.spin_once()
            at.spin(seconds, tell=True)
            topics = at.messages_to(page, "rates")[-1]["topics"]
            assert isinstance(topics, dict)
            return topics.get("/both", {})

        assert beat(1.0, 2) == {}, "one heartbeat tells no rate"
        assert beat(1.0, 2)["age"] <= 1.0
        for _ in range(4):
            told = beat(1.0, 1)
        assert told["age"] <= 1.0, "one of the two goes on"


def test_what_a_node_refused_to_answer_is_told(at: HubHarness) -> None:
    page, other = at.page(), at.robot.node
    at.send(page, Subscribe(channels=("rates",)))
    at.spin(0.5, tell=True)
    other.request_server.refusals.add("no model of this name")
    other.heartbeat.request_now()
    other.spin_once()
    at.spin(1.0, tell=True)
    told = at.messages_to(page, "rates")[-1]["nodes"][other.identity.node]  # type: ignore[index]
    assert (told["refused_requests"], told["request_reason"]) == (1, "no model of this name")


class Held:
    """Publishes emergency stops as one run of the simulation does."""

    def __init__(self, on: HubHarness) -> None:
        self.out = Publisher(STOPS, STOPS.name, "sim/stops", "/sim", MemoryTransport(on.bus))

    def tell(self, at: HubHarness, *held: tuple[str, str]) -> None:
        """Publish the stops in effect, each by topic and holding node."""
        stops = [EmergencyStop(topic=topic, holder=holder, id=node_id(holder)) for topic, holder in held]
        self.out.publish(EmergencyStops(stops=tuple(stops)))
        at.spin(0.1, tell=True)


def seen(at: HubHarness, page: Page) -> tuple[bool, bool, list[str]]:
    """Return a robot's last state sent to the page: stop requested, stopped, other nodes that hold a stop."""
    robot = at.messages_to(page, "robots")[-1]["robots"][0]
    return robot["asked"], robot["stopped"], robot["stopped_by"]


def test_a_stop_outlives_the_sight_of_its_robot_and_ends_with_it(at: HubHarness) -> None:
    """The simulation restarts, so its tokens go, without a reset of the stop. Later the robot is deleted."""
    page, sim = at.page(), Held(at)
    at.send(page, Subscribe(channels=("robots",)))
    at.send(page, Estop(id=3, robot="/a", on=True))
    at.spin(0.1, tell=True)
    assert [each.data for each in at.robot.received("stops")] == [True]
    sim.tell(at, ("/a/e_stop", "/panel"))
    at.robot.node.transport.close()
    at.spin(0.5)
    assert at.messages_to(page, "robots")[-1]["robots"] == []
    at.robot = FakeRobot(memory_node(at.bus, "sim"))
    at.spin(0.2, tell=True)
    assert [each.data for each in at.robot.received("stops")] == [True], "the new simulation is told"
    again = Held(at)
    again.tell(at)
    assert seen(at, page) == (True, False, []), "it has not heard of it yet"
    again.tell(at, ("/a/e_stop", "/panel"), ("/e_stop", "/tool"))
    assert seen(at, page) == (True, True, ["/tool"])
    again.tell(at, ("/e_stop", "/tool"))
    assert seen(at, page) == (False, True, ["/tool"]), "the robot was deleted, or the stop released"
    at.send(page, Estop(id=3, robot="/a", on=True))
    at.spin(0.1, tell=True)
    again.tell(at, ("/a/e_stop", "/panel"))
    assert seen(at, page) == (True, True, [])


def test_a_panel_that_returns_takes_its_stops_up_and_resets_them(at: HubHarness) -> None:
    page, sim = at.page(), Held(at)
    at.send(page, Subscribe(channels=("robots",)))
    sim.tell(at, ("/a/e_stop", "/panel"), ("/a/e_stop", "/tool"))
    assert seen(at, page) == (True, True, ["/tool"])
    assert [each.data for each in at.robot.received("stops")] == [True]
    at.send(page, Estop(id=3, robot="/a", on=False))
    at.spin(0.1, tell=True)
    assert "may move when /tool reset theirs" in at.messages_to(page, "reply")[-1]["result"]
    sim.tell(at, ("/a/e_stop", "/panel"))
    assert [each.data for each in at.robot.received("stops")] == [False], "what is told may be older than the reset"
    sim.tell(at)
    assert seen(at, page) == (False, False, [])


def test_a_robot_in_the_root_namespace_is_shown_driven_sent_and_stopped(at: HubHarness) -> None:
    """Its emergency stop topic is that of all robots."""
    at.robot.node.transport.close()
    at.robot = robot = FakeRobot(memory_node(at.bus, "tb3"), "/", "odom")
    page, sim = at.page(), Held(at)
    at.send(page, Subscribe(channels=("poses", "robots")))
    at.spin(0.2, tell=True)
    [shown] = at.messages_to(page, "robots")[-1]["robots"]
    assert (shown["ns"], shown["drives"], shown["stops"], shown["goals"]) == ("/", True, True, True)
    robot.publish(10**9, x=3.0)
    at.spin(0.1)
    assert at.messages_to(page, "poses")[-1]["at"]["/"][3:5] == pytest.approx([1.0, 5.0], abs=1e-3)

    at.send(page, Drive(robot="/", v=0.2, w=0.0))
    at.spin(0.1, tell=True)
    assert robot.received("commands")[-1].linear.x == 0.2
    at.send(page, Goal(id=1, robot="/", x=1.0, y=5.0, yaw=pi / 2))
    at.spin(tell=True)
    assert robot.received("goals")[-1].header.frame_id == "odom"

    at.send(page, Estop(id=2, robot="/", on=True))
    at.spin(0.1, tell=True)
    assert [each.data for each in robot.received("all_stops")] == [True]
    sim.tell(at, ("/e_stop", "/panel"))
    assert seen(at, page) == (True, True, [])
    at.send(page, Estop(id=3, robot="/", on=False))
    at.spin(0.1, tell=True)
    assert [each.data for each in robot.received("all_stops")] == [False]
