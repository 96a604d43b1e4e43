"""Commands find and describe a running fleet that has a port and domain of its own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.fleet_file import read_fleet
from services.runtime.errors import BadInput
from tests.deploy.test_run import FleetCommandLine
from tests.harness.ports import free_port
from tests.harness.processes import Process
from tests.harness.waiting import wait_until

CONTROLLER = """
from services.runtime import Service, main


def run(ctx):
    for tick in ctx.ticks():
        print("tick", flush=True)


main(Service(name="mine", about="Says that time passes.", run=run, rate=5))
"""

HANGING = """
import time
from services.runtime import Service, main


def run(ctx):
    for tick in ctx.ticks():
        print("hangs", flush=True)
        time.sleep(1000)


main(Service(name="hanging", about="Hangs at its first tick.", run=run, rate=5))
"""

FAILING = """
from services.runtime import Service, main


def run(ctx):
    for tick in ctx.ticks():
        raise ValueError("the left wheel is missing")


main(Service(name="failing", about="Fails at its first tick.", run=run, rate=5))
"""


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FleetCommandLine]:
    made = FleetCommandLine(tmp_path_factory.mktemp("fleet"))
    (made.folder / "mine.py").write_text(CONTROLLER)
    (made.folder / "hanging.py").write_text(HANGING)
    fleet = made.fleet("real", "never", "")
    made.run(
        "up",
        fleet,
        "--detach",
        "--no-view",
        "--no-picture",
        "--no-saved",
        "--domain",
        "apart",
        "--report",
        str(made.results),
    )
    yield made
    made.start("down").communicate(timeout=90)


def ran(terminal: FleetCommandLine, *arguments: str) -> Process:
    log = terminal.folder / f"{'-'.join(arguments).replace('/', '_')}.log"
    return Process(["-m", "deploy", *arguments], log, terminal.environment)


def test_run_joins_the_fleet_that_runs(terminal: FleetCommandLine) -> None:
    """Connected elsewhere, where it receives no clock, it names the running fleets."""
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    with ran(terminal, "run", "mine.py", "--connect", nowhere, "--name", "lost") as lost:
        for arguments in (("run", "mine.py"), ("run", "mine.py", "--port", str(terminal.port), "--name", "other")):
            with ran(terminal, *arguments) as mine:
                wait_until(lambda: "tick" in mine.text, 30, f"ticks of {arguments}")
        _refuses_another_port(terminal)
        wait_until(lambda: "no clock for" in lost.text, 30)
        assert f"Fleets that run here: one (port {terminal.port}, domain apart)" in lost.text


def _refuses_another_port(terminal: FleetCommandLine) -> None:
    for arguments in (("run", "--port", "1", "mine.py"), ("ps", "--port", "1")):
        process = terminal.start(*arguments)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 2
        assert "no fleet is running on port 1: choose one of --fleet one" in err
    (fleet,) = json.loads(terminal.run("ps", "--json", "--port", str(terminal.port)))
    assert fleet["domain"] == "apart"


def test_help_of_run_says_how_it_was_called(terminal: FleetCommandLine) -> None:
    for target in ("arm", "mine.py"):
        assert terminal.run("run", target, "--help").startswith(f"Usage: ./elea run {target} [OPTIONS]\n")


def test_logs_of_a_silent_process_and_of_an_unknown_one(terminal: FleetCommandLine) -> None:
    # On a busy machine it may have waited for the clock, and said so.
    (terminal.results / "logs" / "grader.log").unlink(missing_ok=True)
    silent = terminal.start("logs", "grader")
    out, err = silent.communicate(timeout=60)
    assert (silent.returncode, out, err) == (0, "", "grader has written nothing yet\n")
    unknown = terminal.start("logs", "graders")
    _, err = unknown.communicate(timeout=60)
    assert unknown.returncode == 2
    assert "did you mean 'grader'" in err


def test_parameters_by_path_and_by_line(terminal: FleetCommandLine) -> None:
    assert terminal.run("param", "get", "/r/base/cmd_vel_timeout", "-t", "60") == "0.25\n"
    assert terminal.run("param", "get", "r/base", "cmd_vel_timeout", "-t", "60") == "0.25\n"
    lines = terminal.run("param", "list", "--values", "-t", "60").splitlines()
    assert "/r/base/cmd_vel_timeout 0.25" in lines
    assert all(each.startswith("/") and " " in each for each in lines)
    terminal.run("param", "get", "/r/base/nothing", status=2)


def test_bandwidth_of_several_topics(terminal: FleetCommandLine) -> None:
    out = terminal.run("topic", "bw", "/r/odom", "/clock", "-n", "5", "--json")
    assert {"/r/odom", "/clock"} == {json.loads(line)["topic"] for line in out.splitlines()}


def test_ping_measures_the_loop_of_a_node(terminal: FleetCommandLine) -> None:
    for node in ("/sim", "router", "/r/waypoint", "/supervisor"):
        told = json.loads(terminal.run("node", "ping", node, "-n", "3", "--interval", "0", "--timeout", "20", "--json"))
        assert told["sent"] == told["answered"] == 3
        assert 0 < told["min_ms"] <= told["mean_ms"] <= told["max_ms"]
    terminal.run("node", "ping", "/nobody", status=2)
    # Not one of the fleet: its supervisor would end it. Its process lives, so it stays in the graph.
    with ran(terminal, "run", "hanging.py") as hanging:
        wait_until(lambda: "hangs" in hanging.text, 30, "a loop that hangs")
        out = terminal.run("node", "ping", "/hanging", "-n", "1", "--timeout", "0.5", status=1)
        hanging.kill()
    assert "0 of 1 answered" in out


def test_page_that_the_verb_serves_ends_with_its_fleet_and_logs_outlive_it(terminal: FleetCommandLine) -> None:
    panel = ran(terminal, "panel", "--no-open")
    wait_until(lambda: "http://127.0.0.1:" in panel.text, 60, "an address")
    wait_until(lambda: "this command serves the page until the fleet ends, or Ctrl-C" in panel.text)
    terminal.run("down")
    panel.wait(60)
    assert "one has ended, and its page with it" in panel.text
    assert "listening on" in terminal.run("logs", "router")


def test_required_service_that_raises_is_quoted(tmp_path: Path) -> None:
    terminal = FleetCommandLine(tmp_path)
    (tmp_path / "failing.py").write_text(FAILING)
    fleet = Path(terminal.fleet("real", "never", ""))
    fleet.write_text(
        fleet.read_text() + '[[service]]\nkind = "failing.py"\nrequired = true\nrestart = { limit = 1, first = 0.01 }\n'
    )
    up = terminal.start("up", str(fleet), "--no-view", "--no-picture", "--no-saved", "--report", str(terminal.results))
    _, err = up.communicate(timeout=90)
    assert up.returncode == 1
    (ended,) = [line for line in err.splitlines() if line.startswith("the fleet ended: failing failed: exit status 1")]
    assert ended.endswith(": ValueError: the left wheel is missing")


def test_name_of_a_fleet_leads_nowhere_else(tmp_path: Path) -> None:
    file = tmp_path / "odd.toml"
    for name in ("a/../../x", "..", "", ".hidden", "a b", "x" * 65):
        file.write_text(f'name = "{name}"\n')
        with pytest.raises(BadInput, match="name"):
            read_fleet(file)
