"""A node on the network: its tokens, its requests, its name, its heartbeat and its log."""

from __future__ import annotations

import io
import threading

import pytest

from messages.base import decoder
from messages.elea import Health
from messages.nav import Odometry
from messages.records import unknown_record
from messages.requests import GET_STATE, STEP, Name
from messages.simulation import SimTime, Steps
from messages.topics import CMD_VEL, HEALTH, ODOM, ROSOUT, Quality, Topic
from services.runtime.errors import BadInput, CallFailed
from services.runtime.graph import ASKS_HEALTH, Entity, ping_key, snapshot
from services.runtime.log import Log
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import memory_node, spinning
from tests.harness.waiting import wait_until


def test_a_publication_that_begins_again_is_heard_by_those_who_heard_it_before(bus: MemoryBus) -> None:
    with memory_node(bus, "sim") as speaker, memory_node(bus, "grader") as reader:
        source = reader.subscribe(ODOM, "/a/odom")
        for count in (3, 1):
            output = speaker.advertise(ODOM, "/a/odom")
            for _ in range(count):
                output.publish(Odometry())
            source.update()
            assert len(source.messages) == count
            speaker.unregister(output)
        assert source.lost == 0


def test_the_graph_shows_what_a_node_declares(bus: MemoryBus) -> None:
    with memory_node(bus, "waypoint", "/tb3_0") as made:
        made.subscribe(ODOM)
        made.advertise(CMD_VEL)
        made.serve(STEP, lambda steps: SimTime(tick=steps.count))
        seen = {(e.kind, e.name, e.record, e.detail) for e in snapshot(made.transport) if e.node == "/tb3_0/waypoint"}
    assert seen == {
        ("node", "waypoint", "-", "-"),
        ("pub", "/health", "elea_msgs/Health", "VITAL"),
        ("pub", "/rosout", "rosgraph_msgs/Log", "EVENT"),
        ("pub", "/tb3_0/cmd_vel", "geometry_msgs/Twist", "COMMAND"),
        ("sub", "/tb3_0/odom", "nav_msgs/Odometry", "SENSOR"),
        ("srv", "/sim/step", "elea_msgs/Steps", "-"),
    }


def test_what_is_forgotten_leaves_the_graph(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made:
        made.unregister(made.subscribe(ODOM), made.advertise(CMD_VEL))
        assert {e.name for e in snapshot(made.transport) if e.kind in ("pub", "sub")} == {"/health", "/rosout"}
        assert made.subscribers == []


def test_two_types_under_one_name_are_two_subscriptions(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made:
        topics = [Topic("/x", unknown_record(name), 0, Quality.SENSOR, "") for name in ("my_msgs/A", "my_msgs/B")]
        first, second = [made.subscribe(each, decode=bytes) for each in topics]
        made.unregister(first)
        assert {e.record for e in snapshot(made.transport) if e.kind == "sub"} == {"my_msgs/B"}
        made.unregister(second)
        assert not [e for e in snapshot(made.transport) if e.kind == "sub"]


def test_hostile_tokens_are_not_entities(bus: MemoryBus) -> None:
    stranger = MemoryTransport(bus)
    tokens = [
        stranger.declare_token(f"@elea/{session}/pub/{name}/{name}/t/d")
        for session in ("x", "ab12")
        for name in ("no slash", "%a%%b", "%a*b", "%\n", "%")
    ]
    odd = ("@elea/x/pub/%a/%b/t/d", "@elea/ab12/odd/%a/%b/t/d", "@elea/ab12/step/%a/-/-/0", "@elea/short")
    tokens += [stranger.declare_token(each) for each in odd]
    good = Entity("ab12", "pub", "/a", "/b", "t", "d")
    tokens.append(stranger.declare_token(good.key))
    assert snapshot(stranger) == [good]


def test_a_request_is_typed_and_a_refusal_has_its_reason(bus: MemoryBus) -> None:
    def step(steps: Steps) -> SimTime:
        if steps.count > 5:
            raise BadInput("at most 5")
        return SimTime(tick=steps.count)

    with memory_node(bus, "sim") as server, memory_node(bus, "client") as client:
        server.serve(STEP, step)
        with spinning(server):
            assert client.call(STEP, Steps(count=3), timeout=60.0) == SimTime(tick=3)
            with pytest.raises(CallFailed, match="/sim/step: at most 5"):
                client.call(STEP, Steps(count=6), timeout=60.0)
            with pytest.raises(CallFailed, match="Expected `int` >= 1"):
                client.call(STEP, Steps(count=0), timeout=60.0)


def test_a_call_to_nobody_fails_and_says_so(bus: MemoryBus) -> None:
    with memory_node(bus, "client") as client, pytest.raises(CallFailed, match="no server for /sim/get_state"):
        client.call(GET_STATE, Name(name="tb3_0"))


def test_a_call_that_is_not_answered_fails_at_its_deadline(bus: MemoryBus) -> None:
    with memory_node(bus, "sim") as server, memory_node(bus, "client") as client:
        server.serve(STEP, lambda steps: SimTime())
        with pytest.raises(CallFailed, match=r"did not answer within 0.1 s"):
            client.call(STEP, Steps(), timeout=0.1)


def test_the_second_node_of_a_name_is_refused(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.name_claim.TAKEOVER_S", 0.2)
    with memory_node(bus, "a"), pytest.raises(BadInput, match="a node /a is already there"), memory_node(bus, "a"):
        pass


def test_the_successor_of_a_dead_node_takes_its_name(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.name_claim.TAKEOVER_S", 60.0)
    first = memory_node(bus, "a")
    with first:
        threading.Timer(0.3, first.transport.close).start()
        with memory_node(bus, "a") as second:
            assert [e.session for e in snapshot(second.transport) if e.kind == "node"] == [second.transport.session]


def test_the_loop_beats_and_tells_its_counts(bus: MemoryBus) -> None:
    with memory_node(bus, "a") as made, memory_node(bus, "observer") as observer:
        made.subscribe(ODOM)
        health = observer.subscribe(HEALTH)
        with spinning(made):

            def heard() -> bool:
                health.update()
                return bool(health.messages)

            wait_until(heard)
    beat = health.messages[-1][0]
    assert (beat.node, beat.inputs[0].topic, beat.outputs[0].topic) == ("/a", "/odom", "/rosout")


def test_a_ping_may_ask_for_the_health(bus: MemoryBus) -> None:
    with memory_node(bus, "a", "/tb3_0") as asked, spinning(asked), MemoryTransport(bus) as other:
        key = ping_key(asked.transport.session, "/tb3_0/a")
        [plain] = other.query(key, b"", 60.0)
        [told] = other.query(key, ASKS_HEALTH, 60.0)
    assert (plain.ok, plain.payload) == (True, b"")
    assert decoder(Health)(told.payload).node == "/tb3_0/a"


def test_the_log_goes_to_its_stream_and_to_rosout(bus: MemoryBus) -> None:
    out = io.StringIO()
    log = Log("/a", "info", out)
    log.now = lambda: 1_500_000_000
    with memory_node(bus, "observer") as observer, memory_node(bus, "a") as made:
        rosout = observer.subscribe(ROSOUT)
        log.publish = made.advertise(ROSOUT).publish
        log.debug("not shown")
        log.warn("odd")
        rosout.update()
    assert out.getvalue() == "[1.500] WARN /a: odd\n"
    line = rosout.messages[-1][0]
    assert (line.msg, line.level, line.header.stamp.ns, line.function) == (
        "odd",
        4,
        1_500_000_000,
        "test_the_log_goes_to_its_stream_and_to_rosout",
    )


def test_a_call_site_is_limited_and_tells_what_it_kept_back(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = [100.0]
    monkeypatch.setattr("services.runtime.log.time.monotonic", lambda: wall[0])
    out = io.StringIO()
    log = Log("/a", out=out)
    for number in range(5):
        log.warn(f"late {number}", every=2.0)
        wall[0] += 1.0
    assert out.getvalue().splitlines() == [
        "[0.000] WARN /a: late 0",
        "[0.000] WARN /a: late 2 (1 more like this)",
        "[0.000] WARN /a: late 4 (1 more like this)",
    ]
