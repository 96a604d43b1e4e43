"""The benchmark on short spans: every documented figure is reported, a missed bound fails. Speed isn't tested."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO
from xml.sax.saxutils import quoteattr

import pytest

import deploy.bench
from deploy.bench import barrier, fleet, lockstep, ros1, scale, wire
from deploy.bench.figures import FIGURE_PROPERTY, Figure, ratios, read_figures
from deploy.bench.lockstep import Span, build_schedule, fleet_robots, raw_factor
from messages.geometry import Twist
from messages.joints import JointEffort
from services.runtime.process import ROOT
from services.runtime.step import STEP_NS
from tests.harness.fork_server import ForkedProcess, run_module

SPAN = Span(1.0, 2.0)
ROS1 = {
    *("ros1_start_s", "ros1_memory_mib", "ros1_busy_cpu_percent", "ros1_decode_us"),
    *("ros1_trip_ratio", "ros1_trip_us", "ros1_lockstep_ratio", "ros1_lockstep_factor"),
}
SCALE = ("ratio", "factor", "start_s", "memory_mib", "cpu_ms")
FLEET = """
name = "few"
[run]
mode = "lockstep"
latency = 1
[[robot]]
name = "tb3_0"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[5, 0]] } }]
[[robot]]
name = "arm"
model = "arm"
pose = { x = -2.0 }
services = [{ kind = "arm" }, { kind = "reference" }]
"""
"""One of each kind that ``lab`` has and the figures measure, without the recordings."""
IDLE = """
name = "idle"
[[robot]]
name = "tb3_0"
model = "burger"
"""
"""The part of ``bare`` that its figures measure."""
MEASURED_BY_TESTS = ("help_cpu_s", "panel_cpu_percent", "page_drawings_per_s", "supervisor_cpu_percent")


def test_a_figure_is_the_median_of_its_rounds_and_keeps_its_bound() -> None:
    assert Figure("a", "", "", (3.0, 1.0, 2.0), at_most=2.0).ok
    assert not Figure("a", "", "", (3.0, 1.0, 2.5), at_most=2.0).ok
    assert not Figure("a", "", "", (3.0, 1.0, 2.0), at_least=2.1).ok
    assert Figure("a", "", "", (3.0,)).ok
    assert ratios([1.0, 6.0], [2.0, 3.0]) == (0.5, 2.0)


def test_a_span_is_counted_in_steps() -> None:
    assert SPAN.length == 1.0
    assert len(SPAN.steps) == 1_000_000_000 // STEP_NS
    assert SPAN.steps.start * STEP_NS == 1_000_000_000


def test_the_raw_loop_sets_what_the_commands_come_to_and_calls_at_every_step() -> None:
    commands = {
        each.name: [JointEffort(joint_name="bear_link", effort=1.0)] if each.name == "arm" else [Twist.planar(0.1, 0.0)]
        for each in fleet_robots()
    }
    steps = build_schedule(commands, SPAN)
    assert len(steps.efforts["arm"]) == SPAN.steps.stop
    moving = {name for step in steps.speeds.values() for name, speeds in step if min(speeds) > 0}
    assert moving == commands.keys() - {"arm"}
    called: list[int] = []
    assert raw_factor(steps, SPAN, called.append) > 0
    assert called == list(range(SPAN.steps.stop))


@pytest.fixture
def short_measurements(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Shorten the measurements: few messages and robots, little simulation time."""
    few = tmp_path / "few.toml"
    few.write_text(FLEET)
    idle = tmp_path / "idle.toml"
    idle.write_text(IDLE)
    monkeypatch.setattr(wire, "TRIPS", 50)
    monkeypatch.setattr(wire, "MESSAGES", 500)
    monkeypatch.setattr(wire, "TRIES", 2)
    monkeypatch.setattr(lockstep, "FLEET", str(few))
    monkeypatch.setattr(lockstep, "SPAN", SPAN)
    monkeypatch.setattr(deploy.bench, "DEFAULT_SIZES", (2,))
    monkeypatch.setattr(scale, "ENGINES", ("mujoco",))
    monkeypatch.setattr(scale, "FROM_S", 1.0)
    monkeypatch.setattr(scale, "LENGTH_S", 1.0)
    monkeypatch.setattr(fleet, "IDLE_FLEET", str(idle))
    monkeypatch.setattr(fleet, "FROM_S", 0.2)
    monkeypatch.setattr(fleet, "TO_S", 0.7)
    monkeypatch.setattr(ros1, "BESIDE", str(idle))
    monkeypatch.setattr(ros1, "BESIDE_FROM_S", 0.2)
    monkeypatch.setattr(ros1, "TRIPS", 20)
    monkeypatch.setattr(ros1, "BUSY_FROM_S", 0.2)
    monkeypatch.setattr(ros1, "BUSY_S", 0.5)
    monkeypatch.setattr(ros1, "LAP_S", 2.0)
    monkeypatch.setattr(ros1, "LAP_ROBOTS", 1)


class ForkedCommand(ForkedProcess):
    """``python -P -m MODULE``, forked with all that it starts: Python's start-up time is measured elsewhere."""

    def __init__(self, command: Sequence[str], stdout: IO[bytes] | int, stderr: IO[bytes] | int, **_: bool) -> None:
        assert command[:3] == [sys.executable, "-P", "-m"]
        super().__init__(command[3], command[4:], ROOT, os.environ, log=stdout)


def run_forked(command: Sequence[str], **_: object) -> subprocess.CompletedProcess[str]:
    return run_module(command[3], *command[4:])


@pytest.fixture
def forked_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork the fleets, partners and programs of the measurements, so that their start costs little."""

    class Forking:
        Popen, PIPE, DEVNULL = ForkedCommand, subprocess.PIPE, subprocess.DEVNULL
        run = staticmethod(run_forked)

    for each in (barrier, fleet, ros1, wire):
        monkeypatch.setattr(each, "subprocess", Forking)


@pytest.mark.fleet
@pytest.mark.usefixtures("short_measurements", "forked_commands")
def test_every_promised_figure_is_there(capsys: pytest.CaptureFixture[str]) -> None:
    measured = deploy.bench.measure(1)
    status = deploy.bench.report(measured, as_json=True)
    figures = json.loads(capsys.readouterr().out)
    assert {"echo_p50_ratio", "throughput_ratio", "lockstep_ratio", "barrier_ratio", "start_s"} <= figures.keys()
    assert {"scans_ratio", "scans_per_s", "scans_loss_percent", "throughput_loss_percent"} <= figures.keys()
    assert {"scan_encode_us", "scan_decode_us", "scan_list_us", "odometry_decode_us"} <= figures.keys()
    assert {"lockstep_cpu_sim_ms", "lockstep_cpu_waypoint_ms", "lockstep_cpu_reference_ms"} <= figures.keys()
    assert {"idle_cpu_sim_percent", "memory_sim_mib", "memory_router_mib"} <= figures.keys()
    assert figures.keys() >= ROS1
    assert figures.keys() >= {f"swarm_mujoco_2_{how}_{name}" for how in scale.SHARED for name in SCALE}
    assert figures["swarm_mujoco_2_raw_factor"] > 0
    assert all(value >= 0 for value in figures.values())
    assert list(figures) == [each.name for each in measured]
    assert status == (0 if all(each.ok for each in measured) else 1)


@pytest.mark.process
def test_only_the_parts_that_are_named_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, ...]] = []
    monkeypatch.setattr(scale, "measure_scale", lambda rounds, sizes, port, say: asked.append(tuple(sizes)) or [])
    assert deploy.bench.measure(1, ["scale"]) == []
    assert deploy.bench.measure(1, ["scale"], [7]) == []
    assert asked == [scale.SIZES, (7,)]
    monkeypatch.setattr(deploy.bench, "PARTS", ("scale",))
    assert deploy.bench.bench(1, True) == 0
    assert asked[2:] == [deploy.bench.DEFAULT_SIZES]


def test_a_missed_bound_fails_the_bench(capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = Figure("a", "s", "", (1.0,), at_most=1.0), Figure("b", "s", "", (1.1,), at_most=1.0)
    assert deploy.bench.report([good], as_json=False) == 0
    assert deploy.bench.report([good, bad], as_json=False) == 1
    assert [line.partition(": ")[2].strip() for line in capsys.readouterr().out.splitlines()] == [
        "holds",
        "holds",
        "MISSED",
    ]


def test_figures_of_tests_are_read_from_their_results(tmp_path: Path) -> None:
    figure = Figure("a", "s", "text", (1.0, 2.0), at_most=3.0)
    value = quoteattr(json.dumps(asdict(figure)))
    results = tmp_path / "results.xml"
    results.write_text(
        f"<testsuites><testsuite><testcase><properties>"
        f'<property name="other" value="1"/><property name="{FIGURE_PROPERTY}" value={value}/>'
        f"</properties></testcase></testsuite></testsuites>"
    )
    assert read_figures(results) == [figure]


def test_the_readme_describes_every_figure() -> None:
    told = (Path(deploy.bench.__file__).parent / "README.md").read_text()
    for name in ("echo_p50_ratio", "throughput_ratio", "lockstep_ratio", "barrier_ratio", "loop_cpu_ms", "start_s"):
        assert f"| `{name}` |" in told
    for name in ("scans_ratio", "scan_encode_us", "scan_decode_us", *MEASURED_BY_TESTS, *ROS1):
        assert f"| `{name}` |" in told
    families = [f"swarm_ENGINE_N_HOW_{name}" for name in SCALE]
    for family in ("lockstep_cpu_NAME_ms", "idle_cpu_NAME_percent", "memory_NAME_mib", *families):
        assert f"| `{family}` |" in told
