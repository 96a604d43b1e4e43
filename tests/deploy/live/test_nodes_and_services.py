"""Commands on nodes and services, shell completion, and a reset of time, on one fleet."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import click
import pytest

from deploy.commands.completion import PARAMETER, SET
from messages.requests import SIM_REQUESTS
from models.yaml_reader import read_yaml
from services.runtime.process import ROOT
from tests.harness.background_fleet import BackgroundFleet, background_fleet, interrupt
from tests.harness.fork_server import run_verb
from tests.harness.message_recorder import WITHIN_S
from tests.harness.processes import Network
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits
CALL = ("service", "call", "--timeout", "60")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BackgroundFleet]:
    with background_fleet(tmp_path_factory.mktemp("idle")) as made:
        yield made


def test_nodes(running: BackgroundFleet) -> None:
    assert running.run("node", "list").out == "/grader\n/params\n/router\n/sim\n/supervisor\n"
    assert running.run("node", "list", "-c").out == "5\n"
    assert {"node": "/sim", "kind": "sim"}.items() <= running.run_json("node", "list")[3].items()
    with running.start("topic", "echo", "/tb3_0/cmd_vel"):
        wait_until(lambda: "/_echo_" in running.run("node", "list", "-a").out, 20.0, "a tool in the graph")
        assert "/_echo_" not in running.run("node", "list").out


def test_a_node(running: BackgroundFleet) -> None:

    def heard() -> str:
        shown = running.run("node", "info", "sim").out
        return "" if "no heartbeat" in shown else shown

    shown = wait_until(heard, WITHIN_S, "a heartbeat while the command listens")
    assert shown.startswith("/sim  (sim)\n  running")
    assert "  Publishers:\n    /clock: rosgraph_msgs/Clock  sent " in shown
    assert "    /sim/delete: elea_msgs/Name\n" in shown

    def runs() -> Any:
        """Return the grader, unless no heartbeat came, or no clock had come to it for half a second."""
        told = running.run_json("node", "info", "/grader")
        return told if told["health"] is not None and told["health"]["state"] == "running" else None

    told = wait_until(runs, WITHIN_S, "a grader that runs")
    assert (told["node"], told["kind"]) == ("/grader", "grader")
    odom = next(each for each in told["subscribers"] if each["topic"] == "/tb3_0/odom")
    assert (odom["refused"], odom["type"]) == (0, "nav_msgs/Odometry")
    assert 0 <= odom["lost"] < odom["received"]
    for name, said in (("/sim2", "no node /sim2 is on the network; did you mean '/sim'"), ("/s*", "wildcards")):
        assert said in running.run("node", "info", name, status=2).err


def test_services(running: BackgroundFleet) -> None:
    names = running.run("service", "list").out.splitlines()
    assert set(names) >= {each.name for each in SIM_REQUESTS} | {"/supervisor/restart"}
    assert int(running.run("service", "list", "-c").out) == len(names)
    assert "/sim/spawn [elea_msgs/SpawnModel -> elea_msgs/ModelState]\n" in running.run("service", "list", "-t").out
    assert "  /sim: spawn a model\n" in running.run("service", "list", "-v").out
    servers = {each["name"]: each["nodes"] for each in running.run_json("service", "list")}
    assert (servers["/params/set"], servers["/sim/spawn"]) == (["/params"], ["/sim"])
    assert running.run("service", "type", "/sim/pause").out == "std_msgs/Empty -> elea_msgs/SimTime\n"
    assert "/sim/delete\n" in running.run("service", "find", "elea_msgs/srv/Name").out
    assert running.run_json("service", "find", "elea_msgs/ModelList") == ["/sim/list"]
    found = running.run("service", "find", "nav_msgs/Path", status=1)
    assert "no running service has the type nav_msgs/Path" in found.err


def test_calls(running: BackgroundFleet) -> None:
    state = running.run_json(*CALL, "/sim/get_state", "{name: tb3_1}")
    assert state["pose"]["position"]["y"] == pytest.approx(1.0, abs=1e-3)
    by_place = running.run(*CALL, "sim/get_state", "elea_msgs/srv/GetModelState", "tb3_0").out
    assert read_yaml(by_place)["model"] == "burger"
    assert running.run(*CALL, "/sim/list", "--flow-style").out.startswith("{models: [{name: tb3_0, ")
    paused = running.run_json(*CALL, "/sim/pause")
    stepped = running.run_json(*CALL, "/sim/step", "{count: 40}")
    assert (stepped["tick"], stepped["time"]) == (paused["tick"] + 40, paused["time"] + 200_000_000)
    running.run(*CALL, "/sim/resume")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["/sim/get_state", "{name: nobody}"], 1, "/sim/get_state: unknown model 'nobody'"),
        (["/sim/step", "{count: 0}"], 2, "elea_msgs/Steps at count: Expected `int` >= 1"),
        (["/sim/step", "{cuont: 1}"], 2, "unknown field 'cuont'; did you mean 'count'"),
        (["/sim/spwan", "{}"], 2, "no service /sim/spwan is on the network; did you mean '/sim/spawn'"),
        (
            ["/sim/spawn", "std_msgs/String", "x"],
            2,
            "/sim/spawn has the request type elea_msgs/SpawnModel, not std_msgs/String",
        ),
        (["/sim/**", "{}"], 2, "wildcards are not allowed"),
        (["/sim/step", "{count: ["], 2, "is not YAML"),
    ],
)
def test_calls_that_fail(running: BackgroundFleet, arguments: list[str], status: int, said: str) -> None:
    ended = running.run(*CALL, *arguments, status=status)
    assert said in ended.err
    assert ended.out == ""


def test_a_rate_survives_a_reset(running: BackgroundFleet) -> None:
    with running.start("topic", "hz", "/tb3_0/odom") as process:
        assert process.stdout is not None
        assert any(re.match("average rate: .* by simulation time", line) for line in process.stdout)
        epoch = running.run_json(*CALL, "/sim/reset")["epoch"]
        # A report whose window is shorter than what was received, and long enough for a rate, is one after the reset.
        windows = (re.search(r"window: (\d+) received: (\d+)", line) for line in process.stdout)
        assert any(found and 1 < int(found[1]) < int(found[2]) for found in windows)
        ended = interrupt(process)
    assert f"simulation time was reset (epoch {epoch})" in ended.err
    assert "average rate: 25.000 by simulation time" in ended.out.splitlines()[-5]


def completed(running: BackgroundFleet, *words: str) -> list[str]:
    """Return bash's completions for these words, the last of which is being typed."""
    done = run_verb(
        env={
            **running.command_line.environment,
            "_ELEA_COMPLETE": "bash_complete",
            "COMP_WORDS": " ".join(("./elea", *words)),
            "COMP_CWORD": str(len(words)),
        }
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return [line.removeprefix("plain,") for line in done.stdout.splitlines() if line]


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (("to",), ["topic"]),
        (("topic", "e"), ["echo"]),
        (("topic", "echo", "/tb3_1/c"), ["/tb3_1/camera/camera_info", "/tb3_1/camera/image", "/tb3_1/cmd_vel"]),
        (("topic", "hz", "/clock", "tb3_0/od"), ["tb3_0/odom"]),
        (("topic", "echo", "/tb3_0/odom", "--field", "pose.pose.p"), ["pose.pose.position"]),
        (("topic", "pub", "/tb3_0/cmd_vel", "geometry_msgs/msg/TwistS"), ["geometry_msgs/msg/TwistStamped"]),
        (("topic", "find", "rosgraph_msgs/C"), ["rosgraph_msgs/Clock"]),
        (("node", "info", "/s"), ["/sim", "/supervisor"]),
        (("service", "call", "/sim/sp"), ["/sim/spawn"]),
        (("up", "bar"), ["bare"]),
        (("restart", "gr"), ["grader"]),
        (("logs", "ro"), ["router"]),
        (("run", "way"), ["waypoint"]),
        (("run", "my_"), ["file,my_"]),
        (("up", "./my"), ["file,./my"]),
        (("bag", "record", "/tb3_0/od"), ["/tb3_0/odom"]),
        (("topic", "echo", "--connect", "tcp/127.0.0.1:1", "/tb"), []),
        (("topic", "echo", "--onc"), ["--once"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_completion(running: BackgroundFleet, words: tuple[str, ...], wanted: list[str]) -> None:
    wait_until(lambda: completed(running, *words) == wanted, 20.0, "an answer within the time that completion has")


def test_sets_and_parameters_are_completed(running: BackgroundFleet) -> None:
    context, option = click.Context(click.Command("get")), click.Argument(["set"])
    context.params = {"connect": running.endpoint, "set": "tb3_0/base"}

    def offered(kind: click.ParamType[str], begun: str) -> list[str]:
        return [each.value for each in kind.shell_complete(context, option, begun)]

    for kind, begun, wanted in (
        (SET, "/tb3_0", "/tb3_0/base"),
        (SET, "tb3_1", "tb3_1/base"),
        (PARAMETER, "cmd_vel", "cmd_vel_timeout"),
    ):
        found = wait_until(partial(offered, kind, begun), 20.0, "an answer within the time that completion has")
        assert found == [wanted]


def test_completion_in_bash_itself(running: BackgroundFleet, tmp_path: Path) -> None:
    """The completion script calls the program by the name that was typed; what is completed needs no network."""
    program = tmp_path / "elea"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m deploy "$@"\n')
    program.chmod(0o755)
    typed = (
        'eval "$(_ELEA_COMPLETE=bash_source ./elea)"; complete -p elea; COMP_WORDS=(./elea topic ty); '
        'COMP_CWORD=2; _elea_completion ./elea; echo "${COMPREPLY[@]}"'
    )

    done = subprocess.run(
        ["bash", "--norc", "-c", typed],
        env=running.command_line.environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stderr == ""
    assert done.stdout == "complete -o nosort -F _elea_completion elea\ntype\n"


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_ask_the_script_by_its_place(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "deploy"],
        env={**os.environ, "PYTHONPATH": str(ROOT), "_ELEA_COMPLETE": f"{shell}_source"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert f"{shell}_complete" in done.stdout
    assert f" {ROOT / 'elea'})" in done.stdout
    assert "$+commands" not in done.stdout


def test_a_router_that_hangs_delays_no_completion(running: BackgroundFleet, tmp_path: Path) -> None:
    """It has no supervisor that would end it: a command that was started before the completion still waits for it."""
    with Network(tmp_path) as network:
        words = ("node", "info", "--connect", network.endpoint, "/ro")
        wait_until(lambda: completed(running, *words) == ["/router"], 20.0, "an answer within the time")
        stop_process(network.router.pid)
        with running.start("topic", "list", "--connect", network.endpoint) as waiting:
            assert completed(running, *words) == []
            assert waiting.poll() is None, "the completion took longer than a command that waits"
