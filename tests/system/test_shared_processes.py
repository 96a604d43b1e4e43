"""Nodes that share a process in real fleets: the same run as in separate processes, a common crash, and the tools."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.harness.command_line import CommandLine
from tests.harness.waiting import wait_until

OWN = """
import math

from messages.geometry import Twist
from messages.topics import CMD_VEL, ODOM
from services.runtime import Parameters, main


class OwnParameters(Parameters, frozen=True, kw_only=True):
    fails_at: float = math.inf


def run(ctx):
    odom = ctx.latest(ODOM)
    ctx.log.info("here it goes")
    for tick in ctx.ticks():
        if tick.time >= ctx.params.fails_at * 1e9:
            raise RuntimeError("out of luck")
        turn = odom.value.twist.twist.linear.x if odom.value is not None else 0.0
        ctx.publish(CMD_VEL, Twist.planar(0.1 + 0.05 * math.sin(tick.time / 1e9), turn))


main(run, name="own", about="Drives in waves.", rate=25, parameters=OwnParameters)
"""
FLEET = """
name = "three"
[run]
ends = "duration"
duration = 2
latency = 1
[[robot]]
name = "tb3_0"
model = "burger"
[[robot]]
name = "tb3_1"
model = "burger"
pose = { y = 1 }
[[robot]]
name = "p3dx"
model = "p3dx"
pose = { y = -1 }
[[robot.services]]
kind = "own.py"
parameters = { fails_at = 1e9 }
restart = "never"
share = "control"
[[every_robot]]
kind = "waypoint"
models = ["burger"]
from_start = ["goals"]
parameters = { goals = [[1, 0.2], [0, 0]] }
restart = "never"
share = "control"
"""


@pytest.fixture
def terminal(tmp_path: Path) -> CommandLine:
    (tmp_path / "own.py").write_text(OWN)
    return CommandLine(tmp_path)


def _report(folder: Path, name: str, fleet: str) -> tuple[dict[str, Any], str]:
    terminal, file = CommandLine(folder), folder / f"{name}.toml"
    file.write_text(fleet)
    ended = terminal.run_fleet(file, folder / name, "--json", "--no-saved")
    assert ended.out, ended.err
    report: dict[str, Any] = json.loads(ended.out)
    return report, ended.err


def test_the_run_is_the_same_and_a_crash_takes_all_nodes_of_the_process(terminal: CommandLine) -> None:
    fleets = {
        "apart": FLEET.replace('share = "control"', ""),
        "together": FLEET,
        "crashed": FLEET.replace("1e9", "1.0"),
    }
    with ThreadPoolExecutor(len(fleets)) as pool:
        runs = dict(zip(fleets, pool.map(partial(_report, terminal.folder), fleets, fleets.values()), strict=True))
    apart, said = runs["apart"]
    assert "7 processes," in said
    together, said = runs["together"]
    assert "5 processes with 7 nodes," in said
    assert together["run"]["trajectory_hash"] == apart["run"]["trajectory_hash"]
    assert (together["run"]["messages_lost"], together["run"]["nodes_absent"]) == (0, 0)

    crashed, said = runs["crashed"]
    (note,) = [each for each in crashed["notes"] if "control" in each]
    assert note == (
        "the process control of /tb3_0/waypoint, /tb3_1/waypoint, /p3dx/own has ended: exit status 1: "
        "control: /p3dx/own failed: RuntimeError: out of luck; its process ends, and with it /tb3_0/waypoint, "
        "/tb3_1/waypoint"
    )
    assert (crashed["ok"], crashed["run"]["members_lost"]) == (False, 3)
    # The end of the run may meet the process as it prints its traceback.
    how = r"\(the process of /tb3_0/waypoint, /tb3_1/waypoint, /p3dx/own\) failed: exit status 1|ended with an error"
    assert re.search(f"control ({how}): control: /p3dx/own failed: RuntimeError: out of luck", said), said
    assert "RuntimeError: out of luck" in (terminal.folder / "crashed" / "logs" / "control.log").read_text()


@contextmanager
def _running(terminal: CommandLine) -> Iterator[None]:
    file = terminal.folder / "live.toml"
    file.write_text(FLEET.replace('ends = "duration"\nduration = 2', 'mode = "real"\nends = "never"'))
    process = terminal.start_fleet(file, terminal.folder / "live")
    try:
        wait_until(lambda: len(terminal.run("node", "list").out.split()) >= 8 or None, within=60)
        wait_until(lambda: "/tb3_1/waypoint" in terminal.run("param", "list").out or None, within=60)
        yield
    finally:
        terminal.run("down")
        terminal.finish(process)


def test_the_tools_work_on_each_node(terminal: CommandLine) -> None:
    with _running(terminal):
        listed = terminal.run("node", "list").out.split()
        assert {"/p3dx/own", "/tb3_0/waypoint", "/tb3_1/waypoint"} <= set(listed)
        (fleet,) = json.loads(terminal.run("ps", "--json").out)
        process = next(each for each in fleet["processes"] if each["name"] == "control")
        assert process["nodes"] == ["/tb3_0/waypoint", "/tb3_1/waypoint", "/p3dx/own"]
        assert "  tb3_0/waypoint" in terminal.run("ps").out
        changed = terminal.run("param", "set", "/tb3_1/waypoint", "max_linear=0.1")
        assert changed.status == 0, changed.err
        values = [terminal.run("param", "get", f"/tb3_{n}/waypoint/max_linear").out.split()[0] for n in (0, 1)]
        assert values[1] == "0.1" != values[0]
        assert terminal.run("node", "ping", "-n", "1", "--timeout", "60", "/tb3_1/waypoint").status == 0
        info = json.loads(terminal.run("node", "info", "/tb3_1/waypoint", "--json").out)
        assert info["health"]["pid"] == process["pid"]
        assert [each["topic"] for each in info["publishers"]] > ["/health"]

        logs = terminal.run("logs", "p3dx/own").out
        assert "/p3dx/own: here it goes" in logs
        assert "here it goes" not in terminal.run("logs", "/tb3_0/waypoint").out
        said = terminal.run("restart", "/tb3_0/waypoint").out
        assert said == "control, the process of /tb3_0/waypoint, /tb3_1/waypoint, /p3dx/own, restarts\n"
        wait_until(lambda: terminal.run("logs", "p3dx/own").out.count("here it goes") == 2 or None, within=60)
