"""Runs fleets of ROS 1 programs and checks the output of each program."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from deploy.supervisor.log_file import log_name
from tests.harness.cases import case
from tests.harness.command_line import CommandLine
from tests.harness.waiting import PATIENCE, wait_until

HERE = Path(__file__).parent
FLEETS = HERE / "fleets"
WITHIN_S = 350.0
"""Wall time limit of a run, which takes some 20 s on an idle machine."""
AT_A_TIME = 2
"""Fleets in parallel: one in real time mostly waits, and each does while it starts and ends."""

Lines = Mapping[str, Sequence[str]]
"""Output lines of each program, by process."""
NOTHING: Lines = MappingProxyType({})

_WALL_TIME = re.compile(r"\[\d{10}\.\d+")
PACE = {"real": {"lag_s"}, "lockstep": set[str]()}
"""Checks that may fail in real time on a busy machine, through no fault of a program: output is on simulated time."""

_OF_NODE = re.compile(r"^\[\d+\.\d+\] [A-Z]+ ")
"""A line of the node itself about waiting for a clock or other nodes, which depends on the machine."""
_ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}")
_LOGGED = re.compile(r"^\[[A-Z]+\] \[[^]]*\]: ")
_SUPERVISOR = "--- "


@dataclass(frozen=True)
class ScriptRun:
    """A finished run of a fleet."""

    report: dict[str, Any]
    logs: Path

    def lines(self, process: str) -> list[str]:
        """Return a program's standard output and standard error, without wall times and memory addresses."""
        return _lines(self.logs, process)

    def processes(self) -> list[str]:
        """Return the names of the processes that have a log."""
        return sorted(each.stem.replace(".", "/") for each in self.logs.glob("*.log"))


Jobs = dict[str, Callable[[], ScriptRun]]
"""Runs to start, by name."""
Runs = Mapping[str, Future[ScriptRun]]
"""Started runs, by name."""


def run_until_said(
    fleet: str, folder: Path, said: Lines, *options: str, begun: Lines = NOTHING, flooded: str = ""
) -> ScriptRun:
    """Run a fleet of this folder in real time until its programs have printed their lines, then end it with Ctrl-C.

    Args:
        fleet: Name of the fleet.
        folder: Working folder of the run.
        said: Lines to wait for, by process.
        options: Further options of ``up``.
        begun: Lines to wait for of which only the first word must match.
        flooded: A robot whose program never waits: only commands to it may be lost, no other messages.
    """
    terminal = _terminal(folder)
    started = _start(terminal, fleet, "real", "--set", "run.ends=never", *options)
    interrupt_when_said(started, folder / "results" / "logs", said, begun)
    return _finish(terminal, started, "real", flooded)


def run_scripts(fleet: str, folder: Path, mode: str, *options: str) -> ScriptRun:
    """Run a fleet of this folder to its end."""
    terminal = _terminal(folder)
    return _finish(terminal, _start(terminal, fleet, mode, *options), mode)


def lockstep_runs(folder: Path, seconds: Mapping[str, float], repeated: Collection[str]) -> Jobs:
    """Return a run of each fleet for its simulation time [s], ``FLEET 1``, and a second one of each in ``repeated``."""
    return {
        f"{fleet} {number}": partial(
            run_scripts, fleet, folder / f"{fleet}{number}", "lockstep", "--duration", str(end)
        )
        for fleet, end in seconds.items()
        for number in ((1, 2) if fleet in repeated else (1,))
    }


@contextmanager
def side_by_side(runs: Jobs) -> Iterator[Runs]:
    """Run fleets in their order, AT_A_TIME in parallel; those in real time, which wait most, come first."""
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        yield {name: pool.submit(run) for name, run in runs.items()}


def interrupt_when_said(fleet: subprocess.Popen[str], logs: Path, said: Lines, begun: Lines = NOTHING) -> None:
    """End a fleet with Ctrl-C once its programs have printed their lines, it has ended itself, or WITHIN_S has
    passed.
    """
    silent = [*said.items()], [*begun.items()]

    def all_spoke() -> bool:
        for lines, missing in zip(silent, (missing_lines, missing_words), strict=True):
            while lines and not missing(lines[-1][1], _said(logs, lines[-1][0])):
                lines.pop()
        return not any(silent) or fleet.poll() is not None

    with suppress(AssertionError):  # missing lines are reported by the later checks
        wait_until(all_spoke, WITHIN_S / PATIENCE)
    fleet.send_signal(signal.SIGINT)


def _terminal(folder: Path) -> CommandLine:
    folder.mkdir(exist_ok=True)
    return CommandLine(folder)


def _start(terminal: CommandLine, fleet: str, mode: str, *options: str) -> subprocess.Popen[str]:
    path, results = FLEETS / f"{fleet}.toml", terminal.folder / "results"
    return terminal.start_fleet(path, results, "--mode", mode, "--json", *options)


def _finish(terminal: CommandLine, started: subprocess.Popen[str], mode: str, flooded: str = "") -> ScriptRun:
    ended = terminal.finish(started, WITHIN_S)
    report = json.loads(ended.out)
    assert ended.status == (0 if report["ok"] else 1), ended.err
    missed = {each["name"] for each in report["checks"] if not each["ok"]} - PACE[mode]
    flood = flooded and report["run"]["messages_lost"] == report["robots"][flooded]["messages_lost"]
    # Topics of sensors may drop messages, and do when the machine is so busy that the simulation lags.
    if flood or report["run"]["lag_s"]:
        missed.discard("messages_lost")
    lost = {robot: each["messages_lost"] for robot, each in report["robots"].items() if each["messages_lost"]}
    assert not missed, f"{missed}; messages lost: {lost} of {report['run']['messages_lost']}\n{ended.err}"
    return ScriptRun(report, terminal.folder / "results" / "logs")


def assert_said(run: ScriptRun, expected: Lines) -> None:
    """Assert that each program printed its lines in order, possibly with others between them."""
    _assert_none(missing_lines, run, expected)


def assert_began(run: ScriptRun, expected: Lines) -> None:
    """Assert that each program printed lines with the first words of those expected, in order.

    For real time, where a busy machine changes a program's measurements, but not its actions.
    """
    _assert_none(missing_words, run, expected)


def missing_lines(wanted: Sequence[str], said: Sequence[str]) -> list[str]:
    """Return the wanted lines that were not printed in order."""
    rest = iter(said)
    return [each for each in wanted if each not in rest]


def missing_words(wanted: Sequence[str], said: Sequence[str]) -> list[str]:
    """Return the first words of the wanted lines with which no line starts, in order."""
    return missing_lines([each.split()[0] for each in wanted], [each.partition(" ")[0] for each in said])


def _assert_none(missing: Callable[[Sequence[str], Sequence[str]], list[str]], run: ScriptRun, expected: Lines) -> None:
    for process, wanted in expected.items():
        with case(process):
            said = _said(run.logs, process)
            absent = missing(wanted, said)
            assert not absent, "\n".join([f"missing: {absent}", "of:", *said[-40:]])


def _said(logs: Path, process: str) -> list[str]:
    return [_LOGGED.sub("", each) for each in _lines(logs, process)]


def _lines(logs: Path, process: str) -> list[str]:
    log = logs / log_name(process)
    text = log.read_text(errors="replace") if log.exists() else ""
    own = (each for each in text.splitlines() if not each.startswith(_SUPERVISOR) and not _OF_NODE.match(each))
    return [_ADDRESS.sub("0x", _WALL_TIME.sub("[wall", each)) for each in own]


def assert_same(first: ScriptRun, second: ScriptRun, scripts: Sequence[str], silent: Sequence[str] = ()) -> None:
    """Assert that two lockstep runs have the same trajectories and output; ``silent`` programs may print nothing.

    Lines after the end of the shorter output are ignored, as the simulation continues until all processes have ended.
    """
    assert first.report["run"]["trajectory_hash"] == second.report["run"]["trajectory_hash"]
    for process in (*scripts, *silent):
        with case(process):
            both = list(zip(first.lines(process), second.lines(process), strict=False))
            assert both or process in silent
            assert [one for one, _ in both] == [other for _, other in both]
