"""Sequence numbers forged in another node's name on a running fleet: no node is silenced or ended."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgpack
import pytest
import zenoh

from messages.base import encode
from messages.elea import BaseStatus, FleetState, Health, InputHealth
from messages.geometry import Twist
from messages.names import Identity
from messages.std import Bool
from messages.topics import BASE_STATUS, CMD_VEL, E_STOP, FLEET_STATE, HEALTH, Topic
from services.runtime.graph import snapshot
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.sequences import MAX_GAP
from services.runtime.transport.wire import encoding, publisher_id
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.background_fleet import IDLE, BackgroundFleet, background_fleet
from tests.harness.external_client import external_client
from tests.harness.health import ask_health
from tests.harness.message_recorder import WITHIN_S, MessageRecorder
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

FAR_NS = 3600 * 10**9
QUICK = IDLE.replace('mode = "real"', 'mode = "real"\nfactor = 4.0')
NODES = {"/grader", "/params", "/router", "/sim", "/supervisor"}


class ForgedFleet:
    """A fleet of two robots, a node that observes and commands, and a session that forges."""

    def __init__(self, running: BackgroundFleet, node: Node, session: zenoh.Session) -> None:
        self.running, self.node, self._session = running, node, session
        self.beats: MessageRecorder[Health] = MessageRecorder(node.subscribe(HEALTH))
        self.base: MessageRecorder[BaseStatus] = MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status"))
        self.fleet: MessageRecorder[FleetState] = MessageRecorder(node.subscribe(FLEET_STATE))

    def forge(self, topic: Topic[object], key: str, publisher: bytes, number: int, payload: bytes, ahead: int) -> None:
        """Put a sample in a publisher's name, with any number, stamped ``ahead`` [ns] of now."""
        beside = struct.pack("<qqB16s", number, time.time_ns() + ahead, 16, publisher)
        self._session.put(key, payload, encoding=encoding(topic.record.ROS_TYPE), attachment=beside)

    def heard(self, topic: str) -> int:
        """Return how many samples on a topic the simulation has counted: received, rejected or repeated."""
        inputs = ask_health(self.node.transport, "/sim").inputs
        count = next((each for each in inputs if each.topic == topic), InputHealth())
        return count.received + count.refused + count.repeated

    def survives(self, tried: dict[Publisher[Any], Callable[[int], None]]) -> None:
        """Assert that after each forgery the next genuine sample counts; ``tried[output](i)`` sends one and checks."""
        for works in tried.values():
            works(0)
        for turn in range(1, 7):
            for output in tried:
                good = encode(output.topic.record())
                number, payload, ahead = (
                    (2**63 - 1, b"\xc1", 0),
                    (2**63 - 1, good, 0),
                    (output.sent + MAX_GAP - 1, b"\xc1", 0),
                    (output.sent + MAX_GAP - 1, good, 0),
                    (output.sent + MAX_GAP // 2, good, FAR_NS),
                    (1, good, FAR_NS),
                )[turn - 1]
                self.forge(output.topic, output.key, output.publisher, number, payload, ahead)
            told = {each.name: each.sent + turn for each in tried}
            wait_until(lambda t=told: all(self.heard(name) == t[name] for name in t), WITHIN_S, "the forged samples")  # type: ignore[misc]
            for works in tried.values():
                works(turn)

    def all_beat(self, times: int, since: int = 0) -> None:
        """Wait for ``times`` heartbeats of each node, after the first ``since`` of all nodes together."""

        def enough() -> bool:
            heard = [each.node for each in self.beats.received()[since:]]
            return all(heard.count(node) >= times for node in NODES)

        wait_until(enough, WITHIN_S, f"{times} heartbeats of each")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForgedFleet]:
    with (
        background_fleet(tmp_path_factory.mktemp("forged"), QUICK) as running,
        external_client(running.endpoint) as session,
    ):
        identity = Identity.of("tester")
        with (
            ZenohTransport(configuration("direct", (running.endpoint,))) as transport,
            Node(transport, identity, "tester", Log(identity.node)) as node,
        ):
            made = ForgedFleet(running, node, session)
            made.all_beat(1)
            yield made


def test_stops_and_commands_are_heard_after_forged_numbers_and_forged_heartbeats_end_no_process(
    scene: ForgedFleet,
) -> None:
    state = wait_until(scene.fleet.received, WITHIN_S, "the fleet's state")[-1]
    pids = {each.name: each.pid for each in state.processes}
    forge_heartbeats(scene)
    begun = len(scene.beats.received())

    stop: Publisher[Bool] = scene.node.advertise(E_STOP, "/tb3_0/e_stop")
    command: Publisher[Twist] = scene.node.advertise(CMD_VEL, "/tb3_0/cmd_vel")

    def press(_: int) -> None:
        for wanted in (True, False):
            stop.publish(Bool(data=wanted))
            wait_until(lambda w=wanted: scene.base.wait_next().e_stopped is w, WITHIN_S, f"e_stop {wanted}")  # type: ignore[misc]

    def taken() -> int:
        """Return the number of commands that reached the base, whether accepted or dropped as stale."""
        status = scene.base.wait_next()
        return status.commands + status.stale_dropped

    def drive(turn: int) -> None:
        before = taken()
        command.publish(Twist.planar(0.01 * (turn + 1), 0.0))
        wait_until(lambda: taken() > before, WITHIN_S, f"a command after the forged sample {turn}")

    scene.survives({stop: press, command: drive})

    scene.all_beat(4, begun)
    listed = scene.running.run_json("ps")[0]["processes"]
    assert {each["name"]: each["pid"] for each in listed} == pids
    assert {each["state"] for each in listed} == {"ready"}
    assert {each["restarts"] for each in listed} == {0}
    told = scene.running.run("node", "info", "/supervisor").out
    assert "refused" in told


def forge_heartbeats(scene: ForgedFleet) -> None:
    """Send heartbeats and commands of a nonexistent node, and heartbeats in the names of all nodes of the fleet."""
    good = encode(Health(node="/nobody", pid=1))
    for topic, key, payload in ((HEALTH, "health", good), (CMD_VEL, "tb3_1/cmd_vel", encode(Twist()))):
        for forged in range(3):
            for number in (1, 2**63 - 1, 2, 2**62, 2 + MAX_GAP):
                scene.forge(topic, key, f"forger{forged}".encode().ljust(16), number, payload, 0)  # type: ignore[arg-type]
    own = [each for each in snapshot(scene.node.transport) if each.kind == "pub" and each.name == HEALTH.name]
    assert {each.node for each in own} >= NODES
    for each in own:
        if each.node in NODES:
            publisher = publisher_id(each.node, each.session, "health")
            for number, body in (
                (2**63 - 1, b"\xc1"),
                (2**63 - 1, good),
                (MAX_GAP - 1, b"\xc1"),
                (MAX_GAP, good),
            ):
                for ahead in (0, FAR_NS):
                    scene.forge(HEALTH, "health", publisher, number, body, ahead)  # type: ignore[arg-type]
    for payload in (b"", b"\xc1", msgpack.packb({"inputs": [{"lost": 2**64 - 1}]}), msgpack.packb({"node": "\x1b]0;"})):
        scene.forge(HEALTH, "health", b"forger".ljust(16), 1, payload, 0)  # type: ignore[arg-type]
