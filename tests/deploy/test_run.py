"""Whole runs from the command line: real services, real Zenoh, real physics."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import psutil
import pytest

from deploy import INTERRUPTED
from deploy.fleet_file import read_fleet
from deploy.run_fleet import RunResult, reason_unmeasured
from deploy.supervisor.supervisor import Outcome
from services.runtime.process import ROOT
from tests.deploy.supervisor.supervisor_harness import has_ended
from tests.harness.command_line import WITHIN_S
from tests.harness.fork_server import ForkedVerb
from tests.harness.ports import free_port
from tests.harness.waiting import wait_until

FLEET = """
name = "one"
[run]
mode = "{mode}"
ends = "{ends}"
duration = 60
port = {port}
topology = "{topology}"
[[robot]]
name = "r"
model = "burger"
services = [{{ kind = "waypoint", from_start = ["goals"], parameters = {{ goals = [{goals}] }} }}]
"""


class FleetCommandLine:
    """A command line with a state folder, a port and a results folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.results = folder, folder / "results"
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state")}
        self.port = free_port()

    def fleet(self, mode: str, ends: str, goals: str, topology: str = "direct") -> str:
        """Write a fleet file with one robot and return its path."""
        path = self.folder / "one.toml"
        path.write_text(FLEET.format(mode=mode, ends=ends, goals=goals, topology=topology, port=self.port))
        return str(path)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        return ForkedVerb(arguments, self.folder, self.environment)

    def run(self, *arguments: str, status: int = 0) -> str:
        """Run a command, assert its exit status, and return its output."""
        process = self.start(*arguments)
        out, err = process.communicate(timeout=WITHIN_S)
        assert process.returncode == status, err
        return out

    def processes(self) -> dict[str, dict[str, Any]]:
        """Return the processes that ``ps`` shows, by name."""
        (fleet,) = json.loads(self.run("ps", "--json"))
        return {each["name"]: each for each in fleet["processes"]}

    def report(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.results / "report.json").read_text())
        return found

    def wait_until_ready(self, name: str, restarts: int) -> dict[str, Any]:
        """Wait until a process is ready after at least ``restarts`` restarts; return its entry in ``ps``."""

        def ready() -> dict[str, Any]:
            shown = self.processes()[name]
            return shown if shown["state"] == "ready" and shown["restarts"] >= restarts else {}

        return wait_until(ready, 60.0, f"{name} ready again")


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[FleetCommandLine]:
    made = FleetCommandLine(tmp_path)
    yield made
    made.start("down").communicate(timeout=90)


def test_run_to_its_goals(terminal: FleetCommandLine) -> None:
    out = terminal.run(
        "up", terminal.fleet("lockstep", "goals", "[0.3, 0]"), "--report", str(terminal.results), "--json"
    )
    report = json.loads(out)
    assert report == terminal.report()
    assert report["ok"] is True
    assert report["run"]["ended"] == "goals"
    assert report["run"]["restarts"] == 0
    assert report["robots"]["r"]["points_reached"] == 1
    assert (terminal.results / "report.png").stat().st_size > 10_000
    assert "run ended" in (terminal.results / "logs" / "grader.log").read_text()
    assert not json.loads(terminal.run("ps", "--json"))


def test_missed_bound_is_exit_status_one(terminal: FleetCommandLine) -> None:
    fleet = Path(terminal.fleet("lockstep", "goals", "[0.3, 0]"))
    fleet.write_text(fleet.read_text() + "[bounds]\npath_length_m = 0.1\n")
    arguments = ("up", str(fleet), "--no-picture", "--report", str(terminal.results))
    assert "missed: r.path_length_m" in terminal.run(*arguments, status=1)
    assert not (terminal.results / "report.png").exists()


STUMBLES = """
from services.runtime import main


def run(ctx):
    for tick in ctx.ticks():
        if tick.time >= 500_000_000:
            raise ValueError("the left wheel is missing")


main(run, name="stumbles", about="Raises after half a second.", rate=10)
"""


def test_a_run_in_lockstep_whose_controller_raised_does_not_pass(terminal: FleetCommandLine) -> None:
    (terminal.folder / "stumbles.py").write_text(STUMBLES)
    fleet = Path(terminal.fleet("lockstep", "goals", "[0.3, 0]"))
    fleet.write_text(fleet.read_text() + '[[service]]\nkind = "stumbles.py"\n')
    out = terminal.run("up", str(fleet), "--no-picture", "--report", str(terminal.results), status=1)
    assert "missed: members_lost" in out
    assert "lockstep went on without /stumbles: the run does not repeat" in out


def test_interrupt_ends_it_with_a_report_of_what_was_driven(terminal: FleetCommandLine) -> None:
    fleet = terminal.fleet("real", "goals", "[50, 0]")
    up = terminal.start("up", fleet, "--report", str(terminal.results), "--no-view", "--no-picture")
    assert up.stderr
    for line in up.stderr:
        if "processes ready after" in line:
            break
    up.send_signal(signal.SIGINT)
    _, err = up.communicate(timeout=60)
    assert up.returncode == INTERRUPTED
    assert "it was interrupted" in err
    assert terminal.report()["run"]["ended"] == "stopped"


def test_a_fleet_that_ends_while_it_starts_does_not_blame_its_grader(terminal: FleetCommandLine) -> None:
    """The grader had measured nothing yet. One that failed, as on a full disk, is still reported."""
    fleet = read_fleet(Path(terminal.fleet("real", "never", "")))
    ended = Outcome(ended="interrupted", reason="it was interrupted", wall_seconds=0.5, restarts=0)
    said = "the fleet ended before its grader had written any measurements"
    assert reason_unmeasured(ended, terminal.folder) == said
    assert RunResult(outcome=ended, report=None, error=said).exit_status(fleet) == INTERRUPTED
    broken = msgspec.structs.replace(ended, ended="failed", reason="sim failed: exit status 2: no such world")
    assert reason_unmeasured(broken, terminal.folder) == said
    assert RunResult(outcome=broken, report=None, error=said).exit_status(fleet) == 1
    full = msgspec.structs.replace(ended, failed_on_stop=("grader",))
    guilty = msgspec.structs.replace(broken, reason="grader failed: exit status 1")
    for failed in (full, guilty):
        assert reason_unmeasured(failed, terminal.folder) == ""
        assert RunResult(outcome=failed, report=None).exit_status(fleet) == 1


@pytest.mark.parametrize("topology", ["direct", "star"])
def test_life_in_the_background(terminal: FleetCommandLine, topology: str) -> None:
    fleet = terminal.fleet("real", "never", "", topology)
    started = json.loads(
        terminal.run("up", fleet, "--detach", "--no-picture", "--json", "--report", str(terminal.results))
    )
    before = terminal.processes()
    pids = [started["pid"], *(each["pid"] for each in before.values())]
    assert {name: each["state"] for name, each in before.items()} == dict.fromkeys(
        ("router", "params", "sim", "grader", "r/waypoint"), "ready"
    )
    assert all(each["memory_mib"] > 5 for each in before.values())

    entities = json.loads(terminal.run("graph", "--json"))
    assert {"/supervisor", "/router", "/sim", "/grader", "/r/waypoint"} <= {each["node"] for each in entities}
    ends = {(each["kind"], each["node"], each["name"]) for each in entities}
    assert {("pub", "/sim", "/r/odom"), ("sub", "/r/waypoint", "/r/odom"), ("srv", "/sim", "/sim/spawn")} <= ends

    assert terminal.run("restart", "r/waypoint") == "r/waypoint restarts\n"
    psutil.Process(before["router"]["pid"]).kill()
    after = terminal.wait_until_ready("router", 1)
    assert after["pid"] != before["router"]["pid"]
    terminal.wait_until_ready("r/waypoint", 0)
    now = terminal.processes()
    assert now["sim"]["pid"] == before["sim"]["pid"]
    assert now["r/waypoint"]["pid"] != before["r/waypoint"]["pid"]
    assert "killed by signal 9" in terminal.run("logs", "router")

    assert f"held by the fleet one (supervisor {started['pid']}" in _refused(terminal, fleet)
    for arguments, refused in (
        (("down", "two"), "unknown running fleet 'two'"),
        (("down", "--all", "one"), "--all stops every fleet: give either --all or the name one"),
    ):
        process = terminal.start(*arguments)
        assert refused in process.communicate(timeout=60)[1]
        assert process.returncode == 2
    assert f"results in {terminal.results}" in terminal.run("down", "one")
    assert terminal.report()["run"]["restarts"] == 1
    assert [pid for pid in (*pids, *(each["pid"] for each in now.values())) if not has_ended(pid)] == []


def _refused(terminal: FleetCommandLine, fleet: str) -> str:
    second = terminal.start("up", fleet, "--report", str(terminal.folder / "second"))
    err = second.communicate(timeout=60)[1]
    assert second.returncode == 2
    return err
