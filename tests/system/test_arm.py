"""The arm in real processes: its exercise graded in lockstep, at three rates and by both laws."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jsonschema
import matplotlib.image
import pytest

from deploy.fleet_file import find_fleet
from deploy.report.record import SCHEMA_FILE
from tests.harness.cases import case
from tests.harness.command_line import CommandLine, CommandResult
from tests.system.short_fleets import without_logger

BRIEF = (("at = 4\n", "at = 2.5\n"), ("at = 20.2 ", "at = 8 "), ("at = 22\n", "at = 9\n"))
"""Replacements that shorten the fleets' exercise."""


LAWS = {"arm": ("default", 200), "arm_tutorial": ("tutorial", 50)}
"""Law and rate [Hz] of the other fleets, by the fleet from which they are made."""


class Run:
    """A complete run of a fleet, in a folder of its own."""

    def __init__(self, folder: Path, fleet: str | Path) -> None:
        self.results = folder / "results"
        terminal, picture = CommandLine(folder), folder.name == "first"
        self.ended: CommandResult = terminal.run_fleet(fleet, self.results, "--json", picture=picture)
        assert self.ended.out, self.ended.err
        self.report: dict[str, Any] = json.loads(self.ended.out)
        self.arm: dict[str, Any] = self.report["robots"]["arm"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Future[Run]]]:
    """All runs in parallel, as each mostly waits while it starts and ends."""
    folder = tmp_path_factory.mktemp("arm")
    for name in ("first", *LAWS):
        (folder / name).mkdir()
    fleets = {"first": "arm", **{name: brief(folder / name / "brief.toml", name) for name in LAWS}}
    with ThreadPoolExecutor(len(fleets)) as pool:
        yield {name: pool.submit(Run, folder / name, fleet) for name, fleet in fleets.items()}


def brief(path: Path, fleet: str) -> Path:
    """Write a fleet with a short exercise, without a logger, and with its law and rate in LAWS; return the path."""
    text, (law, rate) = without_logger(find_fleet(fleet)), LAWS[fleet]
    own = '{ kind = "arm", parameters = { law = "tutorial" } }' if law == "tutorial" else '{ kind = "arm" }'
    for old, new in (*BRIEF, (own, f'{{ kind = "arm", parameters = {{ law = "{law}", rate = {rate} }} }}')):
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def first(runs: Mapping[str, Future[Run]]) -> Run:
    return runs["first"].result()


def holds(run: Run, end: float = 23) -> None:
    """Assert the fleet's bounds, and that its exercise ends within the second after ``end`` [s]."""
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


def test_other_rates_and_the_tutorials_laws(runs: Mapping[str, Future[Run]], first: Run) -> None:
    """The tutorial's laws are no better than the default law; tests/services/arm compares both at every rate."""
    for fleet, (law, rate) in LAWS.items():
        with case(fleet):
            other = runs[fleet].result()
            holds(other, end=10)
            assert other.arm["control_gap_s"] == pytest.approx(1 / rate)
            if law == "tutorial":
                assert first.arm["step_steady_error_deg"] <= other.arm["step_steady_error_deg"] + 0.001
                assert first.arm["tracking_rms_deg"] <= other.arm["tracking_rms_deg"] + 0.002
                assert first.arm["effort_rms_nm"] <= other.arm["effort_rms_nm"] + 0.1
