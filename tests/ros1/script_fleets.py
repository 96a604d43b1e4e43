"""Fleets of programs written for ROS 1: runs of them, and what each program wrote."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deploy.supervisor.log_file import log_name
from tests.harness.cases import case
from tests.harness.command_line import CommandLine

HERE = Path(__file__).parent
FLEETS = HERE / "fleets"
WITHIN_S = 200.0
"""Wall time of a run, which takes a tenth of it on an idle machine."""

_WALL_TIME = re.compile(r"\[\d{10}\.\d+")
PACE = {"real": {"lag_s"}, "lockstep": set[str]()}
"""What a busy machine misses in real time, and what no program is to blame for: all here is told by simulated time."""

_OF_NODE = re.compile(r"^\[\d+\.\d+\] [A-Z]+ ")
"""A line of the node itself: it waits for a clock, or for others, as long as the machine takes."""
_ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}")
_LOGGED = re.compile(r"^\[[A-Z]+\] \[[^]]*\]: ")
_SUPERVISOR = "--- "


@dataclass(frozen=True)
class ScriptRun:
    """A fleet that has run to its end."""

    report: dict[str, Any]
    logs: Path

    def lines(self, process: str) -> list[str]:
        """What a program wrote on standard output and standard error, without wall times and places in memory."""
        text = (self.logs / log_name(process)).read_text(errors="replace")
        own = (each for each in text.splitlines() if not each.startswith(_SUPERVISOR) and not _OF_NODE.match(each))
        return [_ADDRESS.sub("0x", _WALL_TIME.sub("[wall", each)) for each in own]

    def processes(self) -> list[str]:
        """The names of the logs."""
        return sorted(each.stem.replace(".", "/") for each in self.logs.glob("*.log"))


def run_scripts(fleet: str, folder: Path, mode: str, *options: str, flooded: str = "") -> ScriptRun:
    """Run a fleet of this folder to its end.

    In real time the commands of a ``flooded`` robot, whose program never waits, may be lost, and no other message.
    """
    results = folder / "results"
    folder.mkdir(exist_ok=True)
    terminal = CommandLine(folder)
    started = terminal.start_fleet(FLEETS / f"{fleet}.toml", results, "--mode", mode, "--json", *options)
    ended = terminal.finish(started, WITHIN_S)
    report = json.loads(ended.out)
    assert ended.status == (0 if report["ok"] else 1), ended.err
    missed = {each["name"] for each in report["checks"] if not each["ok"]} - PACE[mode]
    if flooded and report["run"]["messages_lost"] == report["robots"][flooded]["messages_lost"]:
        missed.discard("messages_lost")
    assert not missed, f"{missed}\n{ended.err}"
    return ScriptRun(report, results / "logs")


def assert_said(run: ScriptRun, expected: dict[str, list[str]]) -> None:
    """Each program wrote its lines in their order, perhaps others between them."""
    for process, wanted in expected.items():
        with case(process):
            said = [_LOGGED.sub("", each) for each in run.lines(process)]
            _assert_in_order(wanted, said, said)


def assert_began(run: ScriptRun, expected: dict[str, list[str]]) -> None:
    """Each program wrote lines that begin with the words of those expected, in their order.

    For real time, where a machine that lets a program wait changes what it measures, but not what it does.
    """
    for process, wanted in expected.items():
        with case(process):
            said = [_LOGGED.sub("", each) for each in run.lines(process)]
            _assert_in_order([each.split()[0] for each in wanted], [each.partition(" ")[0] for each in said], said)


def _assert_in_order(wanted: list[str], found: list[str], said: list[str]) -> None:
    rest = iter(found)
    missing = [each for each in wanted if each not in rest]
    assert not missing, "\n".join([f"missing: {missing}", "of:", *said[-40:]])


def assert_same(first: ScriptRun, second: ScriptRun, scripts: list[str]) -> None:
    """Two runs in lockstep left the same trajectories and the same words.

    Behind the end of the run, simulation goes on until the processes have ended, in one run longer than in the other.
    """
    assert first.report["run"]["trajectory_hash"] == second.report["run"]["trajectory_hash"]
    for process in scripts:
        with case(process):
            both = list(zip(first.lines(process), second.lines(process), strict=False))
            assert both
            assert [one for one, _ in both] == [other for _, other in both]
