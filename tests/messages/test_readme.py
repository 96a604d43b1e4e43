"""The programs in messages/README.md work unchanged with our records over real Zenoh."""

import re
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import pytest
import zenoh

import messages
from messages.base import Float32Array, Message, decoder, encode
from messages.elea import ModelState
from messages.geometry import Pose, PoseWithCovariance, Twist
from messages.nav import Odometry
from messages.requests import GET_STATE
from messages.sensor import LaserScan

README = Path(messages.__path__[0]) / "README.md"
SECTION = re.compile(r"^## (.+)$(?:\n(?!##|```).*)*\n```python\n((?:.*\n)*?)```", re.MULTILINE)
PROGRAMS = dict(SECTION.findall(README.read_text()))
ENDPOINT = "tcp/127.0.0.1:7447"
LIMIT_S = 30


@pytest.fixture(scope="module")
def router() -> Iterator[tuple[zenoh.Session, str]]:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    config = zenoh.Config.from_json5(
        f'{{mode: "router", listen: {{endpoints: ["{endpoint}"]}}, scouting: {{multicast: {{enabled: false}}}}}}'
    )
    with zenoh.open(config) as session:
        yield session, endpoint


@contextmanager
def running(title: str, endpoint: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program of the README without access to our packages."""
    assert ENDPOINT in PROGRAMS[title]
    source = PROGRAMS[title].replace(ENDPOINT, endpoint)
    with subprocess.Popen([sys.executable, "-I", "-c", source], stdout=subprocess.PIPE, text=True) as program:
        try:
            yield program
        finally:
            program.kill()


def published(session: zenoh.Session, key: str, message: Message, title: str, endpoint: str) -> str:
    """Run a program while a record is published on a key; return its output."""
    with running(title, endpoint) as program:
        deadline = time.monotonic() + LIMIT_S
        while program.poll() is None and time.monotonic() < deadline:
            session.put(key, encode(message))
            time.sleep(0.02)
        assert program.poll() == 0
        return program.communicate()[0]


def test_odometry_is_read(router: tuple[zenoh.Session, str]) -> None:
    odometry = Odometry(pose=PoseWithCovariance(pose=Pose.planar(1.5, -2.0)))
    seen = published(router[0], "tb3_0/odom", odometry, "Read odometry", router[1])
    assert seen.splitlines() == ["{'sec': 0, 'nanosec': 0} {'x': 1.5, 'y': -2.0, 'z': 0.0}"] * 10


def test_a_laser_is_read(router: tuple[zenoh.Session, str]) -> None:
    scan = LaserScan(ranges=Float32Array([2.0, 0.25, float("inf")]))
    assert published(router[0], "tb3_0/scan", scan, "Read a laser", router[1]) == "nearest 0.25 m\n"


def test_commands_arrive_with_type_and_number(router: tuple[zenoh.Session, str]) -> None:
    session, endpoint = router
    with session.declare_subscriber("tb3_0/cmd_vel") as commands, running("Drive", endpoint) as program:
        assert program.wait(LIMIT_S) == 0
        samples = []
        while (sample := commands.try_recv()) is not None:
            samples.append(sample)
    assert {str(sample.encoding) for sample in samples} == {"application/msgpack;geometry_msgs/Twist"}
    read = decoder(Twist)
    assert {read(sample.payload.to_bytes()) for sample in samples} == {Twist.planar(0.1, 0.2)}
    origins = [struct.unpack("<qqB16s", sample.attachment.to_bytes()) for sample in samples if sample.attachment]
    numbers = [origin[0] for origin in origins]
    assert numbers == list(range(numbers[0], 21))
    assert {origin[2:] for origin in origins} == {(16, origins[0][3])}


def test_a_request_is_answered_or_refused(router: tuple[zenoh.Session, str]) -> None:
    session, endpoint = router
    read = decoder(GET_STATE.request_type)

    def answer(query: zenoh.Query) -> None:
        assert query.payload is not None
        assert read(query.payload.to_bytes()).name == "tb3_0"
        query.reply(query.key_expr, encode(ModelState(pose=Pose.planar(3.0, 4.0))))

    def refuse(query: zenoh.Query) -> None:
        query.reply_err(msgpack.packb({"reason": "no such model"}))

    for handler, printed in (
        (answer, "{'x': 3.0, 'y': 4.0, 'z': 0.0}\n"),
        (refuse, "refused: no such model\n"),
    ):
        with session.declare_queryable("sim/get_state", handler), running("Ask", endpoint) as program:
            assert program.communicate(timeout=LIMIT_S)[0] == printed
