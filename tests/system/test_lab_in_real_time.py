"""The lab in real time: its checks hold if the machine keeps up, else the report says that it was late."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.harness.command_line import CommandLine
from tests.system.short_fleets import short_lab
from tests.system.test_lab import ROBOTS

FACTORS = (1.0, 0.5, 0.25, 0.1)
"""Real-time factors, tried in turn while the machine is late: a slower clock gives all processes more time."""
WITHIN_S = 300.0
OVERLOADED = 0.05
"""Lag, as a share of wall time or of a node's ticks, above which the machine is overloaded at any of these factors."""
LOAD_SENSITIVE = ("tracking_", "step_", "cross_track_", "closure_", "odometry_", "messages_lost")
"""Prefixes of figures that a late machine may spoil; absent nodes and missed changes or points are always errors."""


@pytest.mark.timeout(900)
def test_on_the_wall_clock_all_checks_hold(tmp_path: Path) -> None:
    report = run_in_real_time(CommandLine(tmp_path), short_lab(tmp_path / "brief.toml"))
    assert (report["run"]["mode"], report["run"]["ended"]) == ("real", "goals")
    assert [report["robots"][name]["points_reached"] for name in ROBOTS] == [2] * 4
    assert [each["made"] for each in report["changes"]] == [True] * 3
    assert report["robots"]["arm"]["steps"][0]["to_deg"] == 30.0
    pioneer = report["robots"]["p3dx"]
    assert pioneer["points_reached"] == 4
    assert is_overloaded(report) or (pioneer["closure_m"] < 0.02 and pioneer["closure_heading_deg"] < 1.0)


def run_in_real_time(terminal: CommandLine, fleet: Path) -> dict[str, Any]:
    """Run a fleet in real time and return the report of a run whose checks hold.

    If a check fails, the report must say that the machine was late, and the run is repeated on a slower clock. A
    machine that is overloaded even then may spoil control figures, and nothing else.
    """
    tried = []
    for factor in FACTORS:
        folder = terminal.folder / f"real-{factor}"
        options = ("--no-view", "--no-picture", "--no-saved", "--json", "--mode", "real", "--factor", str(factor))
        at = ("--port", str(terminal.port), "--report", str(folder))
        ended = terminal.run("up", str(fleet), *at, *options, within=WITHIN_S)
        assert ended.out, ended.err
        report: dict[str, Any] = json.loads(ended.out)
        missed = {each["name"]: each["value"] for each in report["checks"] if not each["ok"]}
        tried.append((factor, missed, report["run"]["lag_s"], report["run"]["ticks_missed"]))
        if not missed:
            assert (ended.status, report["ok"]) == (0, True), ended.err
            assert report["run"]["real_time_factor"] <= 1.02 * factor
            return report
        assert ended.status == 1
        named = any("This machine did not keep up with real time" in each for each in report["notes"])
        assert named, f"checks are missed where nobody was late: {missed}\n{ended.err}"
        spoilt = [each for each in missed if each.rpartition(".")[2].startswith(LOAD_SENSITIVE)]
        assert spoilt == [*missed], ended.err
    assert is_overloaded(report), f"checks are missed at every factor: {tried}"
    return report


def is_overloaded(report: dict[str, Any]) -> bool:
    """Whether the machine was too late to judge control figures."""
    figures = report["run"]
    slowest_hz = 25
    ticks = max(figures["ticks_missed"].values(), default=0)
    late: bool = (
        figures["lag_s"] > OVERLOADED * figures["wall_seconds"]
        or ticks > OVERLOADED * slowest_hz * figures["sim_seconds"]
    )
    return late
