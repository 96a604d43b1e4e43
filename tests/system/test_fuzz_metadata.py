"""20,000 fuzz cases of message metadata: numbers, stamps, ids, encodings, tokens, lockstep grants, reports, requests.

An intruder sends them to a supervised fleet. No process ends, no robot moves, and after every burst genuine commands
and stops are received; rejections are counted where ``doctor`` shows them.
"""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import msgpack
import psutil
import pytest
import zenoh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from messages.base import encode
from messages.elea import BaseStatus, FleetState, Health
from messages.geometry import Twist
from messages.names import Identity, mangle
from messages.std import Bool
from messages.topics import (
    BASE_STATUS,
    CLOCK,
    CMD_VEL,
    E_STOP,
    FLEET_STATE,
    HEALTH,
    ODOM,
    ROSOUT,
    TF,
    UPDATES,
    Topic,
)
from services.runtime.graph import EVERYTHING, Entity
from services.runtime.lockstep.protocol import grant_key, report_key
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import encoding, publisher_id
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.background_fleet import BackgroundFleet, background_fleet
from tests.harness.external_client import external_client
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, distance
from tests.harness.waiting import wait_until

BURSTS, DRAWN, VICTIMS, TIMES = 100, 20, 5, 2
"""Together 20,000 cases: each case drawn is aimed at five topics, publishers or services in turn, twice at each."""
EVERY = 10
"""Bursts between two checks that genuine commands arrive; a check takes a second of simulation time."""
MUTED = 7
"""Commands at 25 Hz within the time-out of 0.25 s: a forgery may suppress no more than these."""
STOOD_M = 0.01
"""Distance [m] within which a robot without commands must stay."""
GROWN_MIB = 150
"""Memory growth [MiB] that an intruder may cause in a process: its bounded queues and rings."""

FLEET = """
name = "fuzzed"

[run]
mode = "real"
factor = 3.0
ends = "never"

[[robot]]
name = "tb3_0"
model = "burger"

[[robot]]
name = "tb3_1"
model = "burger"
pose = { x = 0.0, y = 1.0 }
services = [{ kind = "waypoint" }]
"""

# Not goal_pose: a goal from any sender is obeyed, and one without fields is the origin.
TOPICS: tuple[tuple[str, Topic[Any]], ...] = (
    ("/tb3_0/cmd_vel", CMD_VEL),
    ("/tb3_1/cmd_vel", CMD_VEL),
    ("/tb3_0/e_stop", E_STOP),
    ("/tb3_1/odom", ODOM),
    ("/clock", CLOCK),
    ("/health", HEALTH),
    ("/rosout", ROSOUT),
    ("/tf", TF),
    ("/supervisor/state", FLEET_STATE),
    ("/tb3_1/waypoint/parameter_updates", UPDATES),
)
SENDERS = 64
REQUESTS = ("sim/get_state", "sim/spawn", "sim/list", "params/set", "params/list", "supervisor/start", "sim/nothing")

int64 = st.one_of(st.integers(-(2**63), 2**63 - 1), st.integers(0, 300), st.integers(2**20 - 2, 2**20 + 400))
ahead = st.one_of(st.integers(-(2**62), 2**62), st.sampled_from([0, 0, 3600 * 10**9, -3600 * 10**9, 10**6]))
words = st.text(st.characters(exclude_characters="/*$#?\0", exclude_categories=("Cs",)), min_size=1, max_size=12)
"""Valid chunks of a Zenoh key."""
garbage = st.sampled_from([b"", b"\xc1", b"\x80", b"\x81\xa4data", b"\xff" * 60, b"\xdc\xff\xff"])
nested = st.recursive(
    st.one_of(st.none(), st.booleans(), int64, st.binary(max_size=20), words),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=3)),
    max_leaves=6,
)


class Sample(NamedTuple):
    """A sample on a topic. ``sender`` selects a victim, or none; without a payload it gets one that moves no robot."""

    topic: int
    sender: int
    number: int
    ahead: int
    size: int
    encoding: str | None
    payload: bytes | None
    attachment: bytes | None

    def aim(self, shift: int) -> Sample:
        return self._replace(topic=(self.topic + shift) % len(TOPICS), sender=(self.sender + shift) % SENDERS)


class Token(NamedTuple):
    """A liveliness token with another node's name or session, or with a nonexistent one."""

    kind: str
    sender: int
    foreign: bool
    words: tuple[str, str, str]

    def aim(self, shift: int) -> Token:
        return self._replace(sender=(self.sender + shift) % SENDERS)


class Step(NamedTuple):
    """A lockstep grant to a node, or a report to the simulation."""

    go: bool
    sender: int
    content: Any

    def aim(self, shift: int) -> Step:
        return self._replace(go=self.go ^ bool(shift % 2), sender=(self.sender + shift) % SENDERS)


class Asked(NamedTuple):
    """A request of some size; with 0 repeats it has no payload."""

    key: int
    size: int
    content: Any

    def aim(self, shift: int) -> Asked:
        return self._replace(key=(self.key + shift) % len(REQUESTS))


cases = st.one_of(
    st.builds(
        Sample,
        st.integers(0, len(TOPICS) - 1),
        st.integers(0, SENDERS - 1),
        int64,
        ahead,
        st.one_of(st.just(16), st.integers(0, 255)),
        st.one_of(st.none(), st.just("application/msgpack;std_msgs/String"), words, st.just("x" * 250)),
        st.one_of(st.none(), garbage),
        st.one_of(st.none(), st.none(), st.binary(max_size=40), st.just(b"a" * 2000)),
    ),
    st.builds(
        Token,
        st.sampled_from(["node", "pub", "sub", "srv", "step", "what"]),
        st.integers(0, SENDERS - 1),
        st.booleans(),
        st.tuples(words, words, words),
    ),
    st.builds(Step, st.booleans(), st.integers(0, SENDERS - 1), nested),
    st.builds(
        Asked,
        st.integers(0, len(REQUESTS) - 1),
        st.sampled_from([0, 0, 1, 100, 1 << 16, (1 << 16) + 1, 1 << 20]),
        nested,
    ),
)


class FuzzedFleet:
    """A fleet, the genuine controller of its first robot, and an intruder that knows all names, sessions and ids."""

    def __init__(self, running: BackgroundFleet, node: Node, session: zenoh.Session) -> None:
        self.running, self.node, self.session = running, node, session
        self.truths = [GroundTruthRecorder(node, name) for name in ("tb3_0", "tb3_1")]
        self.base: MessageRecorder[BaseStatus] = MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status"))
        self.fleet: Subscriber[FleetState] = node.subscribe(FLEET_STATE)
        self.health: Subscriber[Health] = node.subscribe(HEALTH)
        self.command, self.stop = node.advertise(CMD_VEL, "/tb3_0/cmd_vel"), node.advertise(E_STOP, "/tb3_0/e_stop")
        self.beats: dict[str, Health] = {}
        self._kept: deque[Any] = deque()
        self._own = str(session.zid())
        found = {each for each in map(Entity.parse, node.transport.tokens(EVERYTHING)) if each is not None}
        self.victims = sorted(found, key=lambda each: each.key)
        self.places = [each.wait_next() for each in self.truths]
        self.pids = {name: beat.pid for name, beat in wait_until(self._all_beat, WITHIN_S, "all heartbeats").items()}
        self.memory = {name: self._mib(pid) for name, pid in self.pids.items()}

    def act(self, case: Sample | Token | Step | Asked) -> None:
        """Send a case; one that Zenoh itself refuses to send is skipped."""
        try:
            match case:
                case Sample():
                    self._sample(case)
                case Token():
                    self._token(case)
                case Step():
                    victim = self._victim(case.sender)
                    content = [victim.session, 7, 35_000_000, case.content, case.content]
                    packed = msgpack.packb(content if isinstance(case.content, dict | list) else case.content)
                    key = grant_key(victim.session) if case.go else report_key(self._session_of("/sim"))
                    self.session.put(key, packed)
                case Asked():
                    payload = None if case.size == 0 else msgpack.packb(case.content).ljust(case.size, b"\x91")
                    self.session.get(REQUESTS[case.key], lambda _: None, payload=payload, timeout=2.0)
        except (zenoh.ZError, ValueError, OverflowError):
            pass

    def stands(self) -> None:
        """Assert that no process has ended or restarted and no robot has moved."""
        self.node.spin_once()
        self.node.update_subscribers()
        for state, _ in self.fleet.messages:
            # A forged fleet state names no process of the fleet.
            for each in state.processes:
                assert each.state == "ready", f"{each.name}: {each.state}, {each.reason}"
                assert each.restarts == 0, f"{each.name}: {each.reason}"
        self.beats |= {beat.node: beat for beat, _ in self.health.messages if beat.node in self.pids}
        for truth, place in zip(self.truths, self.places, strict=True):
            assert distance(truth.received()[-1], place) < STOOD_M

    def is_heard(self) -> None:
        """Assert that genuine commands arrive within one time-out, and a genuine stop and its reset at once."""
        before = self._offered()
        for _ in range(MUTED):
            self.command.publish(Twist())
            self.truths[0].wait_next("time to go on")
        wait_until(lambda: self._offered() > before, WITHIN_S, f"one of {MUTED} commands of the true commander")
        for wanted in (True, False):
            self.stop.publish(Bool(data=wanted))
            wait_until(lambda w=wanted: self.base.wait_next().e_stopped is w, WITHIN_S, f"e_stop {wanted}")  # type: ignore[misc]

    def ends_well(self) -> None:
        """Assert that every process is still the first one, of bounded size, and that the health counts rejections."""
        self._repeat()
        self.beats = {}
        wait_until(self._all_beat, WITHIN_S, "the heartbeats of all processes")
        wait_until(lambda: (self._all_beat(), self.beats["/sim"].repeated)[1], WITHIN_S, "the repeated command counted")
        assert {name: beat.pid for name, beat in self.beats.items()} == self.pids
        for name, pid in self.pids.items():
            assert self._mib(pid) - self.memory[name] < GROWN_MIB, name
        sim = self.beats["/sim"]
        assert sim.refused > 0
        assert sim.refused_requests > 0
        assert sum(beat.refused for beat in self.beats.values()) > 1000
        told = " ".join(
            each["why"] for each in self.running.run_json("doctor")["checks"] if each["name"] == "node /sim"
        )
        assert "messages refused" in told
        assert "requests were refused" in told

    def _repeat(self) -> None:
        """Repeat the genuine controller's last command, in its name, with an earlier time."""
        stamp = time.time_ns() - 60 * 10**9
        beside = struct.pack("<qqB16s", self.command.sent, stamp, 16, self.command.publisher)
        kind = encoding(CMD_VEL.record.ROS_TYPE)
        self.session.put("tb3_0/cmd_vel", encode(Twist()), encoding=kind, attachment=beside)

    def _sample(self, case: Sample) -> None:
        name, topic = TOPICS[case.topic]
        victim, key = self._victim(case.sender), name[1:]
        sender = publisher_id(victim.node, victim.session, key) if case.sender < 48 else b"nobody%10d" % case.sender
        number = case.number + (self.command.sent if case.number < 1000 else 0)
        stamp = max(-(2**63), min(2**63 - 1, time.time_ns() + case.ahead))
        beside = struct.pack("<qqB16s", min(number, 2**63 - 1), stamp, case.size, sender)
        payload = encode(topic.record()) if case.payload is None else case.payload
        self.session.put(
            key,
            payload,
            encoding=encoding(topic.record.ROS_TYPE) if case.encoding is None else case.encoding,
            attachment=beside if case.attachment is None else case.attachment,
        )

    def _token(self, case: Token) -> None:
        victim = self._victim(case.sender)
        node, name, detail = case.words
        session = self._own if case.foreign else victim.session
        chunks = (mangle(victim.node), mangle(f"/{name}"), mangle(node), detail)
        self._kept.append(self.session.liveliness().declare_token("/".join(("@elea", session, case.kind, *chunks))))
        if len(self._kept) > 50:
            self._kept.popleft().undeclare()

    def _victim(self, number: int) -> Entity:
        return self.victims[number % len(self.victims)]

    def _session_of(self, node: str) -> str:
        return next(each.session for each in self.victims if each.node == node)

    def _offered(self) -> int:
        status = self.base.wait_next()
        return status.commands + status.stale_dropped

    def _all_beat(self) -> dict[str, Health] | None:
        self.node.spin_once()
        self.node.update_subscribers()
        self.beats |= {beat.node: beat for beat, _ in self.health.messages if beat.pid}
        names = {"/grader", "/params", "/router", "/sim", "/tb3_1/waypoint"}
        self.beats = {name: beat for name, beat in self.beats.items() if name in names}
        return self.beats if self.beats.keys() == names else None

    @staticmethod
    def _mib(pid: int) -> float:
        return float(psutil.Process(pid).memory_info().rss) / 2**20


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FuzzedFleet]:
    with (
        background_fleet(tmp_path_factory.mktemp("fuzzed"), FLEET) as running,
        external_client(running.endpoint) as session,
    ):
        identity = Identity.of("tester")
        with (
            ZenohTransport(configuration("direct", (running.endpoint,))) as transport,
            Node(transport, identity, "tester", Log(identity.node)) as node,
        ):
            made = FuzzedFleet(running, node, session)
            made.is_heard()
            yield made


@pytest.mark.timeout(600)
def test_nothing_beside_a_payload_ends_moves_or_mutes_anybody(scene: FuzzedFleet) -> None:
    bursts = 0

    @settings(
        max_examples=BURSTS,
        derandomize=True,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.lists(cases, min_size=DRAWN, max_size=DRAWN))
    def burst(several: list[Sample | Token | Step | Asked]) -> None:
        nonlocal bursts
        bursts += 1
        for case in several:
            for shift in range(VICTIMS):
                for _ in range(TIMES):
                    scene.act(case.aim(shift))
        scene.stands()
        if bursts % EVERY == 0:
            scene.is_heard()

    burst()
    assert bursts >= BURSTS
    scene.is_heard()
    scene.ends_well()
