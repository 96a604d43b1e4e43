"""A program with only Zenoh and MessagePack drives a robot of the bare fleet; its silence stops the robot in time."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from messages.elea import BaseStatus
from messages.names import Identity
from messages.nav import Odometry
from messages.requests import RESET_WORLD
from messages.std import Empty
from messages.topics import BASE_STATUS
from models.model import read_model
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.command_line import CommandLine
from tests.harness.message_recorder import WITHIN_S, GroundTruthRecorder, MessageRecorder, distance, speed, time_of
from tests.harness.other_user import run_as_other_user
from tests.harness.waiting import wait_until

PROGRAM = Path(__file__).with_name("external_driver.py")
TIMEOUT_S, STEP_S = 0.25, 0.005
"""The base's command time-out and the physics step [s, simulation time]."""
TRIES = 4
"""Number of drives within which one must be without a pause and completely observed."""


@pytest.fixture(scope="module")
def bare_fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CommandLine]:
    """The fleet ``bare`` in the background."""
    terminal = CommandLine(tmp_path_factory.mktemp("bare"))
    started = terminal.run_fleet("bare", terminal.folder / "results", "--detach", "--json")
    try:
        assert started.status == 0, started.err
        yield terminal
    finally:
        terminal.run("down")


@pytest.fixture(scope="module", autouse=True)
def second_fleet(bare_fleet: CommandLine) -> Iterator[subprocess.Popen[str]]:
    """Another fleet on the same port, which waits a second for the first to end while the first test runs."""
    second = bare_fleet.start_fleet("lab", bare_fleet.folder / "second", "--duration", "1")
    yield second
    if second.returncode is None:
        bare_fleet.finish(second)


@pytest.fixture
def node(bare_fleet: CommandLine) -> Iterator[Node]:
    identity = Identity.of("tester")
    with (
        ZenohTransport(configuration("direct", (router_endpoint(bare_fleet.port),))) as transport,
        Node(transport, identity, "tester", Log(identity.node)) as made,
    ):
        yield made


def test_the_program_needs_zenoh_and_msgpack_alone() -> None:
    tree = ast.parse(PROGRAM.read_text())
    imports = [each for each in ast.walk(tree) if isinstance(each, ast.Import | ast.ImportFrom)]
    assert [alias.name for each in imports for alias in each.names] == ["msgpack", "zenoh"]
    assert not any(isinstance(each, ast.ImportFrom) for each in imports)


def test_it_drives_and_its_silence_stops_the_robot(bare_fleet: CommandLine, node: Node) -> None:
    truth, others = (
        GroundTruthRecorder(node, "tb3_0"),
        [GroundTruthRecorder(node, f"tb3_{number}") for number in (1, 2, 3)],
    )
    bases = MessageRecorder(node.subscribe(BASE_STATUS, "/tb3_0/base_status"))
    starts = [each.wait_next() for each in others]
    sent, samples = drive(bare_fleet, node, truth, bases)

    assert 0.15 < distance(samples[0], samples[-1]) < 0.3
    faster = first(samples, 0, lambda v: v > 0.105)
    full = first(samples, faster, lambda v: v > 0.195)
    slower = first(samples, full, lambda v: v < 0.195)
    still = first(samples, slower, lambda v: v < 1e-3)
    wheels = read_model("burger").wheels
    assert wheels is not None
    # Both ramps are linear, so one sample on each gives its start.
    obeyed = time_of(samples[faster]) - (speed(samples[faster]) - 0.1) / wheels.acceleration
    brakes = time_of(samples[slower]) - (0.2 - speed(samples[slower])) / wheels.brake
    assert brakes - obeyed == pytest.approx(TIMEOUT_S + STEP_S, abs=STEP_S)
    period = time_of(samples[still]) - time_of(samples[still - 1])
    assert time_of(samples[still]) - obeyed <= TIMEOUT_S + STEP_S + 0.2 / wheels.brake + period + STEP_S
    assert all(abs(speed(each)) < 1e-3 for each in samples[still:])
    for other, start in zip(others, starts, strict=True):
        assert distance(start, other.wait_next()) < 1e-3

    driving = [each for each in bases.received() if each.source]
    assert {each.source for each in driving} == {"(foreign)"}
    last = bases.wait_next()
    assert (last.commands, last.refused, last.timed_out, last.source) == (sent, 0, True, "")
    assert last.commands_timed_out >= 1


def test_any_user_of_the_machine_may_drive_this_fleet_and_is_told_so(bare_fleet: CommandLine, node: Node) -> None:
    truth = GroundTruthRecorder(node, "tb3_0")
    with run_as_other_user(f"tcp/127.0.0.1:{bare_fleet.port}", within=WITHIN_S) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "heard tb3_0/base_footprint\n"
        wait_until(
            lambda: truth.received() and speed(truth.received()[-1]) > 0.05, WITHIN_S, "another user driving the robot"
        )
    said = (bare_fleet.folder / "results" / "supervisor.log").read_text()
    assert (
        f"listening on tcp/127.0.0.1:{bare_fleet.port}: every user of this machine can read everything and drive"
        in said
    )
    wait_until(lambda: abs(speed(truth.received()[-1])) < 1e-3, WITHIN_S, "its silence stops the robot")


def test_a_second_fleet_is_told_who_holds_the_port(
    bare_fleet: CommandLine, second_fleet: subprocess.Popen[str]
) -> None:
    refused = bare_fleet.finish(second_fleet)
    assert refused.status == 2
    assert f"port {bare_fleet.port} is held by the fleet bare (supervisor " in refused.err
    assert "--port" in refused.err
    assert refused.out == ""
    assert wait_until(lambda: json.loads(bare_fleet.run("ps", "--json").out), WITHIN_S)[0]["fleet"] == "bare"


def drive(
    bare_fleet: CommandLine, node: Node, truth: GroundTruthRecorder, bases: MessageRecorder[BaseStatus]
) -> tuple[int, list[Odometry]]:
    """Return the number of commands sent, and the samples of a drive from start to standstill.

    A drive in which a busy machine delayed commands or lost samples is repeated.
    """
    sent = 0
    for _ in range(TRIES):
        node.call(RESET_WORLD, Empty(), WITHIN_S)
        before, lost = bases.wait_next(), truth.source.lost
        truth.wait_next()
        begin = len(truth.received()) - 1
        sent += int(run(bare_fleet).split()[0])
        truth.wait_after(1.0)
        if bases.wait_next().commands_timed_out == before.commands_timed_out + 1 and truth.source.lost == lost:
            return sent, truth.received()[begin:]
    raise AssertionError(f"in each of {TRIES} drives commands were late or samples lost")


def run(bare_fleet: CommandLine) -> str:
    """Run the foreign program, without access to the project, and return its output."""
    config = bare_fleet.folder / "zenoh.json5"
    endpoint = f"tcp/127.0.0.1:{bare_fleet.port}"
    config.write_text(json.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}}))
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [sys.executable, "-P", str(PROGRAM)],
        env={**environment, "ZENOH_CONFIG": str(config)},
        cwd=bare_fleet.folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def first(samples: list[Odometry], begin: int, meets: Callable[[float], bool]) -> int:
    """Return the index of the first sample from ``begin`` on whose speed ``meets`` a condition."""
    return next(index for index in range(begin, len(samples)) if meets(speed(samples[index])))
