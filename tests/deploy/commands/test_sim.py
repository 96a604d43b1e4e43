"""``elea sim`` against a running simulation: every action, as text and as JSON, and rejected input."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from deploy.commands.sim import STEP_TIMEOUT_S, TIMEOUT_S, pause, step
from messages.topics import CLOCK
from tests.harness.fork_server import run_verb
from tests.harness.processes import Network
from tests.harness.waiting import wait_until

ROBOTS = [{"name": "arm", "model": "arm_corrected"}, {"name": "tb3", "model": "burger", "x": 3.0}]


class SimCommandLine:
    """The command line on one network."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint = endpoint

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run ``elea sim WORDS``."""
        return run_verb("sim", *words, "--timeout", "60", "--connect", self._endpoint, within=180.0)

    def output(self, *words: str) -> str:
        """Run it, assert success, and return its output."""
        done = self.run(*words)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        return done.stdout

    def output_json(self, *words: str) -> Any:
        """Like ``output``, with ``--json``."""
        return json.loads(self.output(*words, "--json"))


@pytest.fixture(scope="module")
def sim_command(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimCommandLine]:
    """A paused simulation of an arm and a burger."""
    with Network(tmp_path_factory.mktemp("sim")) as network, network.node() as node:
        network.start("sim", "--param", f"robots={json.dumps(ROBOTS)}")

        clock = node.subscribe(CLOCK)
        wait_until(lambda: clock.recv() is not None, 20.0, "a simulation")
        made = SimCommandLine(network.endpoint)
        made.output("pause")
        yield made


def test_steps_are_awaited_longer_than_other_requests() -> None:
    waits = {each.name: option.default for each in (pause, step) for option in each.params if option.name == "timeout"}
    assert waits == {"pause": TIMEOUT_S, "step": STEP_TIMEOUT_S}


def test_time(sim_command: SimCommandLine) -> None:
    before = sim_command.output_json("pause")
    assert sim_command.output_json("step", "20")["tick"] == before["tick"] + 20
    assert sim_command.output("step").startswith("1 steps taken: t = ")
    assert sim_command.output_json("reset") == {"time": 0, "tick": 0, "epoch": before["epoch"] + 1}
    assert "models are where they were spawned: t = 0.000 s" in sim_command.output("reset-world")
    assert sim_command.output("resume").startswith("running: t = ")
    refused = sim_command.run("step", "5")
    assert (refused.returncode, refused.stderr) == (1, "elea: /sim/step: time is running: pause it before stepping\n")
    sim_command.output("pause")


def test_models_come_move_and_go(sim_command: SimCommandLine) -> None:
    placed = ("-x", "-1.5", "-y", "-1", "-Y", "1.57", "--frame", "tb3")
    spawned = sim_command.output_json(
        "spawn", "arm", "new", *placed, "-J", "bear_link=-0.4", "--param", "effort_mode=sum"
    )
    assert spawned["pose"]["position"] == pytest.approx({"x": 1.5, "y": -1.0, "z": 0.0}, abs=1e-3)
    listed = sim_command.output("list")
    assert [row.split()[0] for row in listed.splitlines()] == ["name", "arm", "tb3", "new"]
    assert listed.splitlines()[-1].split() == ["new", "arm", "1.500", "-1.000", "0.000", "1.570"]
    assert sim_command.output_json("joints", "new")[0]["position"] == -0.4
    moved = sim_command.output_json("set-state", "tb3", "-y", "0.5")
    assert moved["pose"]["position"] == pytest.approx({"x": 3.0, "y": 0.5, "z": 0.0}, abs=1e-3)
    seen = sim_command.output_json("state", "tb3", "--relative", "arm")
    assert seen["pose"]["position"]["y"] == pytest.approx(0.5, abs=1e-3)
    words = sim_command.output("state", "new::end_link").splitlines()
    assert [row.split("  ")[0] for row in words[1:]] == [
        "position m",
        "roll, pitch, yaw rad",
        "velocity m/s",
        "turn rate rad/s",
    ]
    assert sim_command.output("delete", "new") == "deleted new\n"
    assert [each["name"] for each in sim_command.output_json("list")["models"]] == ["arm", "tb3"]


def test_efforts_and_positions(sim_command: SimCommandLine) -> None:
    assert (
        sim_command.output("effort", "bear_link", "-30", "--duration", "0.2")
        == "-30 on arm::bear_link from now for 0.2 s\n"
    )
    sim_command.output("step", "10")
    (joint,) = sim_command.output_json("joints", "arm::bear_link")
    assert (joint["applied_effort"], joint["jobs"], joint["velocity_limit"]) == (-30.0, 1, 20.0)
    assert joint["position"] < -0.01
    header, row = sim_command.output("joints", "arm").splitlines()
    assert header.split()[:4] == ["joint", "type", "position", "rate"]
    assert row.split()[:2] == ["arm::bear_link", "revolute"]
    assert len(sim_command.output("joints").splitlines()) == 4, "the arm's and both wheels"
    assert sim_command.output("clear", "arm/bear_link") == "1 job of arm::bear_link cleared\n"
    assert sim_command.output("configure", "arm", "bear_link=-0.5") == "arm: bear_link -0.5\n"
    assert sim_command.output_json("joints", "arm")[0]["position"] == -0.5
    sim_command.output("reset")


def test_wrenches(sim_command: SimCommandLine) -> None:
    pushed = sim_command.output("wrench", "tb3", "--force", "-1", "0", "30", "--duration", "-1")
    assert pushed == "wrench on tb3::base_footprint from now until it is cleared\n"
    sim_command.output("step", "20")
    assert sim_command.output_json("properties", "tb3::base_footprint")["wrenches"] == 1
    assert sim_command.output_json("state", "tb3::base_footprint")["twist"]["linear"]["z"] > 1.0
    assert sim_command.output("clear", "--wrench", "tb3") == "1 job of tb3::base_footprint cleared\n"
    sim_command.output("reset")


def test_properties(sim_command: SimCommandLine) -> None:
    world = sim_command.output_json("properties")
    assert (world["model_names"], world["mode"], world["pause"]) == (["arm", "tb3"], "real", True)
    assert "gravity          x 0, y 0, z -9.81" in sim_command.output("properties")
    assert sim_command.output_json("properties", "arm")["is_static"] is True


@pytest.mark.parametrize(
    ("words", "status", "says"),
    [
        (("effort", "elbow", "1"), 1, "elea: /sim/apply_effort: unknown joint 'elbow' (known: arm::bear_link, tb3::"),
        (("effort", "bear_link", "much"), 2, "'much' is not a valid float"),
        (("effort", "bear_link", "nan"), 1, "job.effort"),
        (("configure", "arm", "bear_link"), 2, "write it as joint=position"),
        (("configure", "arm", "bear_link=3"), 1, "its limits are -1.5708 and 1.5708"),
        (("configure", "arm"), 2, "Missing argument"),
        (("spawn", "arn", "new"), 1, "unknown model 'arn'; did you mean 'arm'"),
        (("spawn", "burger", "tb3"), 1, "already a robot 'tb3'"),
        (("spawn", "burger", "new", "-Y", "90"), 2, "90 rad is more than a whole turn, 6.28: angles are in rad"),
        (("set-state", "tb3", "-R", "-90"), 2, "'-R' / '--roll': -90 rad is more than a whole turn"),
        (("delete", "nobody"), 1, "unknown model 'nobody'"),
        (("step", "0"), 2, "0 is not in the range"),
        (("stepp",), 2, "unknown command 'stepp'; did you mean 'step'"),
    ],
)
def test_what_is_refused(sim_command: SimCommandLine, words: tuple[str, ...], status: int, says: str) -> None:
    done = sim_command.run(*words)
    assert (done.returncode, done.stdout) == (status, "")
    assert says in done.stderr
    assert "Traceback" not in done.stderr


def test_without_a_fleet_it_says_where_it_looked(tmp_path: Path) -> None:
    done = SimCommandLine("tcp/127.0.0.1:1").run("list")
    assert done.returncode == 2
    assert "no router at tcp/127.0.0.1:1" in done.stderr
    assert "is a fleet up?" in done.stderr
