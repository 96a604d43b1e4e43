"""The arm in real processes: its exercise graded in lockstep, at three rates and by both laws."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import matplotlib.image
import pytest

from deploy.fleet_file import find_fleet
from deploy.report.record import SCHEMA_FILE
from tests.harness.command_line import CommandLine, CommandResult

BRIEF = (("at = 4\n", "at = 2.5\n"), ("at = 20.2 ", "at = 8 "), ("at = 22\n", "at = 9\n"))
"""What makes the fleets' exercise a brief one."""


class Run:
    """A fleet's run to its report."""

    def __init__(self, terminal: CommandLine, fleet: str | Path, name: str) -> None:
        self.results = terminal.folder / name
        self.ended: CommandResult = terminal.run_fleet(fleet, self.results, "--json", picture=name == "first")
        assert self.ended.out, self.ended.err
        self.report: dict[str, Any] = json.loads(self.ended.out)
        self.arm: dict[str, Any] = self.report["robots"]["arm"]


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> CommandLine:
    return CommandLine(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def first(terminal: CommandLine) -> Run:
    return Run(terminal, "arm", "first")


def holds(run: Run, end: float = 23) -> None:
    """What the fleet promises; its exercise is over within the second after ``end``."""
    assert run.ended.status == 0, run.ended.err
    arm = run.arm
    assert run.report["run"]["ended"] == "goals"
    assert arm["step_final_deg"] == pytest.approx(29.63, abs=0.05)
    assert arm["step_overshoot_percent"] < 1.0
    assert 0.12 <= arm["step_rise_s"] <= 0.15
    assert arm["tracking_rms_deg"] == pytest.approx(0.19, abs=0.02)
    assert arm["messages_lost"] == 0
    whole, weightless = arm["steps"]
    assert (whole["from_deg"], whole["to_deg"]) == (0.0, 30.0)
    assert weightless["to_deg"] == 20.0
    assert weightless["steady_error_deg"] < 0.02, "its weight is fed forward by then"
    assert end < arm["time_s"] < end + 1


def test_step_sine_and_weight_by_the_default_law(first: Run) -> None:
    holds(first)
    assert first.arm["control_gap_s"] == pytest.approx(0.01)


def test_its_report_fits_the_schema_and_has_a_picture(first: Run) -> None:
    jsonschema.validate(first.report, json.loads(SCHEMA_FILE.read_text()))
    assert matplotlib.image.imread(first.results / "report.png").shape[1] >= 1200


@pytest.mark.parametrize(("fleet", "rate"), [("arm", 200), ("arm_tutorial", 50)])
def test_other_rates_and_the_tutorials_laws(terminal: CommandLine, first: Run, fleet: str, rate: int) -> None:
    """The tutorial's laws are no better than the default; tests/services/arm compares both at every rate."""
    text = find_fleet(fleet).read_text()
    own = '{ kind = "arm", parameters = { law = "tutorial" } }' if fleet == "arm_tutorial" else '{ kind = "arm" }'
    law = fleet.removeprefix("arm_") if fleet != "arm" else "default"
    assert own in text
    assert all(old in text for old, _ in BRIEF)
    for old, new in (*BRIEF, (own, f'{{ kind = "arm", parameters = {{ law = "{law}", rate = {rate} }} }}')):
        text = text.replace(old, new)
    path = terminal.folder / f"{fleet}_{rate}.toml"
    path.write_text(text)
    other = Run(terminal, path, path.stem)
    holds(other, end=10)
    assert other.arm["control_gap_s"] == pytest.approx(1 / rate)
    if law == "tutorial":
        assert first.arm["step_steady_error_deg"] <= other.arm["step_steady_error_deg"] + 0.001
        assert first.arm["tracking_rms_deg"] <= other.arm["tracking_rms_deg"] + 0.002
        assert first.arm["effort_rms_nm"] <= other.arm["effort_rms_nm"] + 0.1
