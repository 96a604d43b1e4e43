"""Invalid commands to a robot: counted and shown, never obeyed, and the next valid command works."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgpack
import pytest
import zenoh

from messages.elea import InputHealth
from messages.geometry import Twist
from messages.topics import BASE_STATUS, CMD_VEL
from services.runtime.transport.wire import pack_attachment
from tests.harness.external_client import external_client
from tests.harness.message_recorder import WITHIN_S, MessageRecorder, distance
from tests.harness.waiting import wait_until
from tests.system.two_robot_simulation import TwoRobotSimulation, two_robot_simulation

pytestmark = pytest.mark.waits

GOOD = msgpack.packb({"linear": {"x": 0.2}})
KIND = "application/msgpack;geometry_msgs/Twist"
GROWTH_MIB = 20.0
"""Limit of the simulation's memory growth [MiB] from rejected payloads; 100 MiB are sent."""


def twist(value: Any) -> bytes:
    return bytes(msgpack.packb({"linear": {"x": value}}))


MALFORMED = {
    "nothing": b"",
    "no MessagePack": b"\xc1\xff\x00",
    "truncated": GOOD[:-3],
    "more than one": GOOD + GOOD,
    "a list": msgpack.packb([[0.2, 0, 0], [0, 0, 0]]),
    "a number": msgpack.packb(0.2),
    "text": b'{"linear": {"x": 0.2}}',
    "a speed in text": twist("0.2"),
    "a speed that is none": twist(None),
    "a speed that is true": twist(True),
    "speeds in a list": msgpack.packb({"linear": [0.2, 0, 0]}),
    "NaN": twist(math.nan),
    "infinity": twist(math.inf),
    "minus infinity": twist(-math.inf),
    "1e308": twist(1e308),
    "beyond any robot": twist(1e6),
    "NaN sideways": msgpack.packb({"linear": {"x": 0.2, "y": math.nan}}),
    "1e308 about z": msgpack.packb({"linear": {"x": 0.2}, "angular": {"z": 1e308}}),
    "an extension": twist(msgpack.ExtType(1, b"\x00")),
    "nested without end": b"\x81\xa6linear" + b"\x91" * 10_000,
    "a map of no keys' kind": msgpack.packb({1: 2, "linear": {"x": 0.2}}),
    "1 MB": msgpack.packb({"linear": {"x": 0.2}, "more": bytes(1_000_000)}),
    "1 MB of noise": b"\xdb" * 1_000_000,
}
ENCODINGS = ("application/msgpack;nav_msgs/Odometry", "application/json", "text/plain", "x" * 200)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    with two_robot_simulation(tmp_path_factory.mktemp("payloads")) as made:
        yield made


@pytest.fixture(scope="module")
def session(running: TwoRobotSimulation) -> Iterator[zenoh.Session]:
    with external_client(running.network.endpoint) as made:
        yield made


@pytest.fixture(scope="module")
def bases(running: TwoRobotSimulation) -> dict[str, MessageRecorder[Any]]:
    return {
        name: MessageRecorder(running.node.subscribe(BASE_STATUS, f"/{name}/base_status"))
        for name in ("tb3_0", "tb3_1")
    }


@pytest.fixture
def unmoved(running: TwoRobotSimulation, bases: dict[str, MessageRecorder[Any]]) -> Iterator[None]:
    """Assert that no robot obeyed or moved, that the simulation continues, and that the next valid command works."""
    before = {name: (bases[name].wait_next().commands, truth.wait_next()) for name, truth in running.truth.items()}
    yield
    for name, (commands, place) in before.items():
        later = running.truth[name].wait_after(0.5)
        assert distance(place, later) < 1e-4
        assert bases[name].wait_next().commands == commands
    works(running)


@pytest.mark.usefixtures("unmoved")
def test_what_is_no_command_is_counted(
    running: TwoRobotSimulation, session: zenoh.Session, bases: dict[str, MessageRecorder[Any]]
) -> None:
    for what, payload in MALFORMED.items():

        def send(payload: bytes = payload) -> None:
            for encoding in (None, KIND):
                put(session, payload, encoding)

        counted(bases, what, send, 2)

    for encoding in ENCODINGS:
        counted(bases, encoding[:40], lambda e=encoding: put(session, GOOD, e))
    attachment = pack_attachment(1, bytes(16))
    counted(bases, "attached", lambda: session.put("tb3_0/cmd_vel", GOOD, encoding="a/b", attachment=attachment))
    assert "expected application/msgpack;geometry_msgs/Twist, got a/b" in health(running).reason

    for key in ("tb3_0/cmd_vel", "**"):
        counted(bases, f"a delete of {key}", lambda key=key: session.delete(key))
    for key in ("**", "*/cmd_vel", "tb3_$*/cmd_vel", "tb3_0/*", "tb3_0/cmd_vel/**"):
        counted(bases, key, lambda key=key: session.put(key, GOOD))
    assert "not to this topic alone" in health(running).reason

    odd = (b"", b"\xff" * 33, b"\x00" * 33, bytes(1000), pack_attachment(2**62, b"\xff" * 16))

    def attach() -> None:
        for attachment in odd:
            session.put("tb3_0/cmd_vel", twist(math.nan), encoding=KIND, attachment=attachment)

    counted(bases, "five odd attachments", attach, len(odd))


@pytest.mark.usefixtures("unmoved")
def test_a_flood_takes_no_memory(
    running: TwoRobotSimulation, session: zenoh.Session, bases: dict[str, MessageRecorder[Any]]
) -> None:
    base = bases["tb3_0"]
    before, refused = running.memory, base.wait_next().refused
    large, huge = bytes(1_000_000), bytes(20_000_000)

    def flood(most: int) -> bool:
        """Send ten messages, of which a busy router may drop some; return whether ``most`` have been refused."""
        for _ in range(10):
            session.put("tb3_0/cmd_vel", large)
        return base.wait_next().refused >= most

    for count in (10, 20, 30, 40):
        wait_until(lambda most=refused + count: flood(most), WITHIN_S, "refusals")  # type: ignore[misc]
        assert running.memory - before < GROWTH_MIB
    with external_client(running.network.endpoint) as other:
        for _ in range(3):
            other.put("tb3_0/cmd_vel", huge)
    running.truth["tb3_0"].wait_after(2.0)
    assert running.memory - before < GROWTH_MIB


def put(session: zenoh.Session, payload: bytes, encoding: str | None) -> None:
    session.put("tb3_0/cmd_vel", payload, encoding=encoding)


def counted(bases: dict[str, MessageRecorder[Any]], what: str, send: Any, count: int = 1) -> None:
    """Assert that ``send`` adds ``count`` rejections to the base's status."""
    base = bases["tb3_0"]
    refused = base.received()[-1].refused
    send()
    wait_until(lambda: base.wait_next().refused == refused + count, WITHIN_S, f"a refusal of {what}")


def health(running: TwoRobotSimulation) -> InputHealth:
    """Return the simulation's input health for the commands of tb3_0."""
    return next(each for each in running.health("/sim").inputs if each.topic == "/tb3_0/cmd_vel")


def works(running: TwoRobotSimulation) -> None:
    """Assert that a valid command turns the robot on the spot."""
    truth, commands = running.truth["tb3_0"], running.node.advertise(CMD_VEL, "/tb3_0/cmd_vel")

    def turns() -> bool:
        commands.publish(Twist.planar(0.0, 1.0))
        return truth.wait_next().twist.twist.angular.z > 0.5

    wait_until(turns, WITHIN_S, "a robot that obeys a good command")
    truth.wait_until_still()
