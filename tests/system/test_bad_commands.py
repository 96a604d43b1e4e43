"""Invalid command lines, fleet files and conditions: exit status 2 at once, with the remedy.

A conflict that may go away, for example when the other fleet ends, has an exit status of its own.
"""

from __future__ import annotations

import re
import socket
from pathlib import Path

import pytest

from messages.topics import HEALTH
from services.runtime.errors import TRY_AGAIN
from tests.harness.command_line import CommandLine
from tests.harness.message_recorder import WITHIN_S, MessageRecorder
from tests.harness.processes import Network, start_service
from tests.harness.waiting import wait_until

FLEET = """\
name = "one"
[run]
mode = "real"
[[robot]]
name = "r"
model = "burger"
pose = { x = 1.0 }
[[robot.services]]
kind = "waypoint"
parameters = { laps = 2 }
"""


@pytest.fixture
def terminal(tmp_path: Path) -> CommandLine:
    return CommandLine(tmp_path)


@pytest.mark.parametrize(
    ("service", "arguments", "message"),
    [
        ("waypoint", ["--param", "lapps=2"], r"unknown parameter 'lapps'; did you mean 'laps'\?"),
        ("waypoint", ["--param", "max_linear=3"], r"max_linear = 3.* <= 2\.0"),
        ("waypoint", ["--param", "max_linear=nan"], r"max_linear = nan: a number that is not finite"),
        ("waypoint", ["--param", "max_linear=1e999"], r"max_linear = inf: a number that is not finite"),
        ("waypoint", ["--param", "max_linear=fast"], r"max_linear = 'fast'.*Expected `float`"),
        ("waypoint", ["--param", "laps"], r"'laps': write it as name=value"),
        ("sim", ["--param", "mode=reel"], r"mode = 'reel'"),
        ("sim", ["--param", 'robots=[{"name": "a", "modell": "burger"}]'], r"modell"),
        ("waypoint", ["--namespace", "tb3 0"], r"'tb3 0'.* ' ' at position 3"),
        ("waypoint", ["--remap", "odom=x"], r"'odom=x' is not a remapping rule"),
        ("waypoint", ["--nmae", "x"], r"No such option.*--n"),
        ("waypoint", ["--connect", "nowhere"], r"'nowhere' is not an endpoint; write it as tcp/"),
    ],
)
def test_command_line_of_a_service(tmp_path: Path, service: str, arguments: list[str], message: str) -> None:
    process = start_service(service, *arguments, logs=tmp_path)
    assert process.wait() == 2, process.text
    assert re.search(message, process.text), process.text
    assert "Traceback" not in process.text


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('mode = "real"', 'mod = "real"', 3, "unknown key 'mod'; did you mean 'mode'?"),
        ("[[robot]]", "[[robots]]", 4, "unknown key 'robots'; did you mean 'robot'?"),
        ('model = "burger"', 'model = "burgr"', 6, "unknown model 'burgr'; did you mean 'burger'?"),
        ('kind = "waypoint"', 'kind = "waypont"', 9, "unknown service 'waypont'; did you mean 'waypoint'?"),
        ("laps = 2", "lap = 2", 10, "unknown parameter 'lap'; did you mean 'laps'?"),
        ("x = 1.0", 'x = "1"', 7, "robot[0].pose.x: Expected `float`, got `str`"),
        ("laps = 2", "laps = -1", 10, "Expected `int` >= 0"),
        ('name = "r"', "name = ", 5, "this is not TOML"),
    ],
)
def test_fleet_file(terminal: CommandLine, old: str, new: str, line: int, message: str) -> None:
    fleet = terminal.folder / "one.toml"
    fleet.write_text(FLEET.replace(old, new))
    ended = terminal.run_fleet(fleet, terminal.folder / "results")
    assert (ended.status, ended.out) == (2, "")
    assert f"{fleet}:{line}: " in ended.err
    assert message in ended.err
    assert "Traceback" not in ended.err
    assert not (terminal.folder / "results").exists()


def test_port_of_another_program(terminal: CommandLine) -> None:
    with socket.create_server(("127.0.0.1", terminal.port)):
        ended = terminal.run_fleet("bare", terminal.folder / "results", "--duration", "1")
    assert (ended.status, ended.out) == (2, "")
    assert f"port {terminal.port} of 127.0.0.1 is held by another program: choose another one with --port" in ended.err
    assert list((terminal.folder / "results" / "logs").iterdir()) == []


@pytest.mark.parametrize("detach", [[], ["--detach"]])
def test_report_that_cannot_be_written(terminal: CommandLine, detach: list[str]) -> None:
    (terminal.folder / "file").write_text("in the way")
    for place in (terminal.folder / "file" / "results", Path("/proc/results")):
        ended = terminal.run_fleet("lab", place, "--duration", "1", *detach)
        assert (ended.status, ended.out) == (2, "")
        assert f"the folder {place} cannot be written" in ended.err
        assert "--report" in ended.err
    assert terminal.run("ps", "--json").out.strip() == "[]"


def test_router_on_a_taken_port(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
        process = start_service("router", "--param", f"listen={endpoint}", logs=tmp_path)
        assert process.wait() == TRY_AGAIN
    assert endpoint in process.text
    assert "Traceback" not in process.text


def test_second_service_of_a_name(tmp_path: Path) -> None:
    with Network(tmp_path) as network, network.node() as node:
        health = MessageRecorder(node.subscribe(HEALTH))
        first = network.start("waypoint", "--namespace", "tb3_0")
        wait_until(lambda: any(each.pid == first.pid for each in health.received()), WITHIN_S, "the first one's heart")
        second = network.start("waypoint", "--namespace", "tb3_0")
        assert second.wait() == TRY_AGAIN
        assert "a node /tb3_0/waypoint is already there" in second.text
        assert "another --name or --namespace, or stop the other" in second.text
        beats = len(health.received())
        wait_until(
            lambda: any(each.pid == first.pid for each in health.received()[beats:]), WITHIN_S, "the first one going on"
        )
        assert first.status is None
        third = network.start("waypoint", "--namespace", "tb3_1")
        wait_until(lambda: any(each.pid == third.pid for each in health.received()), WITHIN_S, "one of another name")
