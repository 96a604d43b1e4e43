"""Publishing from the command line: a robot drives while the command runs and stops when it ends."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from math import inf
from typing import Any

import pytest

from deploy.live import publish
from deploy.live.message_builder import MessageBuilder
from deploy.live.publish import PublishRequest
from deploy.live.subscribers import ClockSubscriber
from messages.names import Identity
from messages.nav import Odometry
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, E_STOP, GOAL_POSE
from services.runtime.light_node import LightNode
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.background_fleet import BackgroundFleet, background_fleet, interrupt
from tests.harness.memory_node import ManualClock
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, speed, time_of
from tests.harness.waiting import wait_until

TWIST = "{linear: {x: 0.1}}"


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BackgroundFleet]:
    with background_fleet(tmp_path_factory.mktemp("idle")) as made:
        yield made


@pytest.fixture(scope="module")
def node(running: BackgroundFleet) -> Iterator[Node]:
    identity = Identity.of("tester")
    with (
        ZenohTransport(configuration("direct", (running.endpoint,))) as transport,
        Node(transport, identity, "tester", Log(identity.node)) as made,
    ):
        yield made


def test_while_time_is_paused_one_message_is_sent_and_the_note_tells_of_those_held_back(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = MemoryBus()
    live, simulation = LightNode(MemoryTransport(bus), "pub"), ManualClock(bus)
    clock = ClockSubscriber(live.transport)
    simulation.publish(10**9, paused=True)
    clock.update()
    output = Publisher(E_STOP, "/e_stop", "e_stop", live.node, live.transport)
    draft = MessageBuilder(E_STOP.record, ["{data: true}"], True)
    monkeypatch.setattr(publish, "spin", lambda *_: iter([None] * 3))
    for count, held in ((1, False), (2, True), (0, True)):
        asked = PublishRequest("/e_stop", count=count)
        assert publish._send(live, output, draft, clock, asked, 1.0, "") == 1
        assert ("no more is published" in capsys.readouterr().err) is held


def longest_drive(samples: list[Odometry]) -> float:
    """Return the longest simulation time [s] in which a robot drove without a pause."""
    longest, began = 0.0, inf
    for each in samples:
        began = min(began, time_of(each)) if speed(each) > 0.09 else inf
        longest = max(longest, time_of(each) - began)
    return longest


def test_a_robot_drives_until_it_ends(running: BackgroundFleet, node: Node) -> None:
    """The base stops while a busy machine lets the command pause: one second without a pause is waited for.

    After a pause the command catches up on five messages, so a measurement that begins there is some periods short.
    """
    truth, status = (
        GroundTruthRecorder(node, "tb3_0"),
        MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status")),
    )
    with running.start("topic", "pub", "/tb3_0/cmd_vel", TWIST) as process:
        wait_until(lambda: speed(truth.wait_next()) > 0.099, WITHIN_S, "a robot that drives")
        wait_until(lambda: longest_drive(truth.received()) >= 1.0, WITHIN_S, "a robot that goes on")
        wait_until(lambda: status.wait_next().source.startswith("/_pub_"), WITHIN_S, "a status with the source")

        def heard() -> Any:
            """Return the publisher, unless it was silent while the command listened."""
            [found] = running.run_json("topic", "info", "-v", "/tb3_0/cmd_vel")["publishers"]
            return None if found["hz"] is None else found

        publisher = wait_until(heard, WITHIN_S, "a publisher that is heard")
        assert publisher["node"].startswith("/_pub_")
        assert publisher["hz"] > 0
        measured = running.run_json_lines("topic", "hz", "-n", "251", "/tb3_0/cmd_vel")[-1]["simulated"]
        assert measured["span"] >= (measured["count"] - 10) / CMD_VEL.rate, "the promised rate; it may miss some"
        ended = interrupt(process)
    assert ended.status == 0
    assert ended.out.startswith("publishing #1: {linear: {x: 0.1, y: 0.0, z: 0.0}, angular: ")
    truth.wait_until_still()
    wait_until(lambda: status.wait_next().source == "", WITHIN_S, "a status without a source")


def test_times_and_rate_by_simulation_time(running: BackgroundFleet, node: Node) -> None:
    """Ten commands at 20 Hz take at least 0.45 s of simulation time."""
    commands, clock = MessageRecorder(node.subscribe(CMD_VEL, "/tb3_0/cmd_vel")), MessageRecorder(node.subscribe(CLOCK))
    began = clock.wait_next().clock.ns
    shown = running.run_json_lines(
        "topic", "pub", "-r", "20", "-t", "10", "tb3_0/cmd_vel", "[0.05, 0, 0]", "[0, 0, 0.1]"
    )
    assert shown == [{"linear": {"x": 0.05, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0.1}}] * 10
    wait_until(lambda: len(commands.received()) == 10, WITHIN_S, "ten commands")
    assert {each.angular.z for each in commands.received()} == {0.1}
    assert clock.wait_next().clock.ns - began >= 0.43e9


def test_rate_by_the_wall_clock(running: BackgroundFleet) -> None:
    """The span may be six periods short: held up before it stamps the first message, the command catches up on them."""
    began = time.monotonic()
    with running.start("topic", "hz", "-n", "41", "tb3_1/cmd_vel", "--json") as measuring:
        wait_until(lambda: "/_hz_" in running.run("node", "list", "-a").out, WITHIN_S, "the meter in the graph")
        running.run("topic", "pub", "-q", "--wall-time", "-r", "40", "-t", "41", "-w", "2", "tb3_1/cmd_vel", "{}")
        out = running.command_line.finish(measuring).out
    assert time.monotonic() - began > 1.0
    last = json.loads(out.splitlines()[-1])
    assert (last["received"], last["lost"]) == (41, 0)
    assert last["wall"]["span"] >= 0.8


def test_once_reaches_who_is_there(running: BackgroundFleet, node: Node) -> None:
    """Each time, here on a latched topic."""
    stops = MessageRecorder(node.subscribe(E_STOP, "/tb3_0/e_stop"))
    status = MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status"))
    for wanted in (True, False, True, False):
        running.run("topic", "pub", "--once", "-q", "tb3_0/e_stop", str(wanted).lower())
        wait_until(lambda w=wanted: status.wait_next().e_stopped == w, WITHIN_S, "an emergency stop")  # type: ignore[misc]
    wait_until(lambda: len(stops.received()) >= 4, WITHIN_S, "four messages")
    assert [each.data for each in stops.received()] == [True, False, True, False]


def test_latched_is_held_for_late_joiners(running: BackgroundFleet) -> None:
    with running.start("topic", "pub", "/tb3_1/e_stop", "std_msgs/msg/Bool", "{data: true}") as holding:
        assert holding.stdout is not None
        assert holding.stdout.readline() == "publishing #1: {data: true}\n"
        assert running.run_json_lines("topic", "echo", "--once", "/tb3_1/e_stop") == [{"data": True}]
        assert interrupt(holding).status == 0
    running.run("topic", "pub", "-1", "-q", "/tb3_1/e_stop", "false")


def test_headers_bear_simulation_time(running: BackgroundFleet, node: Node) -> None:
    goals, clock = (
        MessageRecorder(node.subscribe(GOAL_POSE, "/tb3_0/goal_pose")),
        MessageRecorder(node.subscribe(CLOCK)),
    )
    before = clock.wait_next().clock.ns
    running.run("topic", "pub", "-r", "5", "-t", "3", "-q", "tb3_0/goal_pose", "{pose: {position: {x: 1}}}")
    running.run("topic", "pub", "--once", "-q", "--stamp", "zero", "tb3_0/goal_pose", "{header: {frame_id: world}}")
    wait_until(lambda: len(goals.received()) == 4, WITHIN_S, "four goals")
    *stamped, zero = goals.received()
    times = [each.header.stamp.ns for each in stamped]
    assert before < times[0]
    wait_until(lambda: times[-1] < clock.wait_next().clock.ns, WITHIN_S, "a clock after the last stamp")
    assert times == sorted(times)
    assert times[-1] - times[0] >= 0.38e9
    assert (zero.header.stamp.ns, zero.header.frame_id) == (0, "world")


def test_a_new_topic_with_a_type(running: BackgroundFleet) -> None:
    with running.start("topic", "echo", "--wait", "-n", "2", "/lab/word", "--json") as hearing:
        wait_until(lambda: "/lab/word" in running.run("topic", "list").out, WITHIN_S, "the echo in the graph")
        running.run("topic", "pub", "-t", "2", "-r", "20", "/lab/word", "std_msgs/String", "hello")
        out = running.command_line.finish(hearing).out
    assert [json.loads(each) for each in out.splitlines()] == [{"data": "hello"}] * 2
    assert running.run_json_lines("topic", "pub", "-1", "-w", "0", "/lab/level", "std_msgs/Float32", "-0.5") == [
        {"data": -0.5}
    ]


def test_waiting_for_subscribers(running: BackgroundFleet) -> None:
    mistyped = ("topic", "pub", "-1", "tb3_0/cmd_vle", "geometry_msgs/Twist")
    with running.start(*mistyped) as waiting:
        assert waiting.stderr is not None
        near, hint = waiting.stderr.readline(), waiting.stderr.readline()
        assert interrupt(waiting).status == 130
    assert "no subscribers to /tb3_0/cmd_vle; did you mean '/tb3_0/cmd_vel'?" in near
    assert "waiting for 1 subscriber(s) of /tb3_0/cmd_vle, 0 there (-w 0 does not wait)" in hint
    ended = running.run(*mistyped, "--timeout", "0.2", status=1)
    assert "0 of 1 subscribers of /tb3_0/cmd_vle appeared within 0.2 s" in ended.err
    assert running.run("topic", "pub", "-1", "-w", "0", "/lab/none", "std_msgs/Empty").out == "publishing #1: {}\n"
    running.run("topic", "pub", "-1", "--wait-matching", "9", "tb3_0/cmd_vel", "--timeout", "0.2", status=1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["/tb3_0/cmd_vel", "{linear: {x: fast}}"], "geometry_msgs/Twist at linear.x: Expected `float`, got `str`"),
        (["/tb3_0/cmd_vel", "{linear: {x: .inf}}"], "at linear.x: Expected `float` <="),
        (["/tb3_0/cmd_vel", "{linaer: {}}"], "unknown field 'linaer'; did you mean 'linear'"),
        (["/tb3_0/cmd_vel", "{linear: ["], "is not YAML"),
        (
            ["/tb3_0/cmd_vel", "std_msgs/String", "hi"],
            "/tb3_0/cmd_vel carries geometry_msgs/Twist, not std_msgs/String",
        ),
        (["/tb3_0/cmd_vel", "geometry_msgs/Twits"], "did you mean 'geometry_msgs/Twist'"),
        (["/tb3_*/cmd_vel", "{}"], "wildcards are not allowed"),
        (["/lab/nothing", "{}"], "the type of /lab/nothing is unknown"),
        (["/tb3_0/cmd_vel", "{}", "-r", "0"], "0.0 is not in the range 0<x<=1000"),
        (["/tb3_0/cmd_vel", "{}", "--onec"], "there is no option --onec"),
        (["/tb3_0/cmd_vel", "{}", "--once", "-t", "3"], "exclude each other"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input(running: BackgroundFleet, arguments: list[str], said: str) -> None:
    ended = running.run("topic", "pub", *arguments, status=2)
    assert said in ended.err
    assert ended.out == ""
