"""The command line: bad input with the nearest valid name, exit statuses, a missing package."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from deploy.commands import cli
from services.runtime.process import ROOT
from tests.harness.fork_server import run_verb


@pytest.fixture
def state(tmp_path: Path) -> dict[str, str]:
    """An environment in which no fleet runs."""
    return {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(tmp_path / "state")}


def elea(environment: dict[str, str], *arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return run_verb(*arguments, env=environment, cwd=cwd)


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["upp"], "unknown command 'upp'; did you mean 'up'"),
        (["up", "lap"], "unknown fleet 'lap'; did you mean 'lab'"),
        (["up", "--robots", "3"], "--robots 3: this fleet has no [[grid]]"),
        (["up", "--mode", "reel"], "'reel' is not one of"),
        (["up", "--factor", "0"], "--factor 0.0: Expected `float` > 0"),
        (["up", "--duration", "nan"], "--duration nan: Expected"),
        (["up", "--port", "0"], "--port 0: Expected `int` >= 1"),
        (["up", "--connect", "nowhere"], "'nowhere' is not an endpoint"),
        (["up", "--listen", "tls/127.0.0.1:7447"], "it needs certificates, which Elea does not have yet"),
        (["up", "--listen", "0.0.0.0:7447"], "drive the robots, without a password. Listen on 127.0.0.1"),
        (["up", "--listen", "0.0.0.0:7447"], "--insecure"),
        (["up", "--report", "/dev/null/x"], "/dev/null/x cannot be written"),
        (["run", "wayponit"], "unknown service 'wayponit'; did you mean 'waypoint'"),
        (["run", "nowhere.py"], "there is no file nowhere.py"),
        (["run", "tests/harness/memory_node.py"], "defines things but runs nothing"),
        (["run", "--seed", "0", "waypoint"], "--seed is for programs of ROS, which waypoint is not"),
        (["param", "set", "/sim", "--timeot", "3"], "unknown option '--timeot'; did you mean '--timeout'"),
        (["report", "."], ". holds no report.json"),
        (["view", "."], ". is not a bag"),
        (["down"], "no fleet is running"),
        (["restart", "sim"], "no fleet is running"),
        (["graph", "--port", "1"], "is a fleet up? ./elea ps lists those that run"),
    ],
)
def test_bad_input(arguments: list[str], hint: str, state: dict[str, str]) -> None:
    done = elea(state, *arguments)
    assert done.returncode == 2
    assert hint in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_taken_port_is_told_before_anything_starts(state: dict[str, str], tmp_path: Path) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        done = elea(state, "up", "bare", "--port", port, "--report", str(tmp_path / "run"))
    assert done.returncode == 2
    assert f"port {port} of 127.0.0.1 is held by another program: choose another one with --port" in done.stderr
    assert list((tmp_path / "run" / "logs").iterdir()) == []


def test_ps_without_a_fleet(state: dict[str, str]) -> None:
    assert elea(state, "ps").stdout == "no fleet is running\n"
    assert json.loads(elea(state, "ps", "--json").stdout) == []


def test_run_passes_the_rest_of_the_line_to_a_file_in_its_own_folder(state: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("NAME = 'beside'\n")
    (tmp_path / "mine.py").write_text(
        "import sys, beside, messages.topics\nprint(beside.NAME, sys.argv[1:])\nsys.exit(7)\n"
    )
    done = elea(state, "run", "mine.py", "--name", "x", "--help", cwd=tmp_path)
    assert done.stdout == "beside ['--name', 'x', '--help']\n"
    assert done.returncode == 7


def test_run_gives_a_service_its_options(state: dict[str, str]) -> None:
    done = elea(state, "run", "waypoint", "--namespace", "/tb3_0", "--param", "laps=2", "--print-config")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["params"]["laps"] == 2
    done = elea(state, "run", "waypoint", "--remap", "_laps:=3", "--remap", "cmd_vel:=/v", "--print-config")
    told = json.loads(done.stdout)
    assert (told["params"]["laps"], told["origins"], told["identity"]["rules"]) == (
        3,
        {"laps": "command line"},
        [["cmd_vel", "/v"]],
    ), "a private parameter, as ROS 1 writes it"
    done = elea(state, "run", "waypoint", "--remap", "_lap:=3", "--print-config")
    assert (done.returncode, "unknown parameter 'lap'; did you mean 'laps'?" in done.stderr) == (2, True)


def test_an_interrupted_verb_has_a_status_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "argv", ["elea", "ps"])
    monkeypatch.setattr(click.Group, "invoke", interrupt)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 130


def test_test_has_the_exit_status_of_pytest(state: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "test_x.py").write_text("def test_x():\n    assert False\n")
    assert elea(state, "test", str(tmp_path / "test_x.py"), "--no-header").returncode == 1
    assert elea(state, "test", str(tmp_path / "nowhere.py")).returncode == 4


@pytest.mark.parametrize(("package", "verb"), [("msgspec", "ps"), ("zenoh", "up")])
def test_an_environment_with_a_package_missing_is_told_with_the_remedy(
    state: dict[str, str], tmp_path: Path, package: str, verb: str
) -> None:
    program = f"import runpy, sys; sys.modules[{package!r}] = None; sys.argv[1:] = [{verb!r}]; "
    program += "runpy.run_module('deploy', run_name='__main__', alter_sys=True)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", program], env=state, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"elea: the Python package {package} is missing in {sys.prefix}: ")
    assert "Remove that folder" in done.stderr
    assert "Traceback" not in done.stderr
