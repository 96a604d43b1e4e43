"""Runs on the wall clock, on a machine that may be busy: checks hold where it keeps up, else the report names it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.harness.command_line import CommandLine

FACTORS = (1.0, 0.5, 0.25)
"""One after the other, while the machine is late: a slower clock gives everybody time."""
WITHIN_S = 300.0
OVERLOADED = 0.05
"""Share of the wall time, or of a node's ticks, by which a machine is late that no factor above helps."""
LOAD_SENSITIVE = ("tracking_", "step_", "cross_track_", "closure_", "odometry_", "messages_lost")
"""Figures that a machine which is late may spoil. Nobody is to be absent, no change or point to be missed on any."""


def run_in_real_time(terminal: CommandLine, fleet: str | Path, name: str) -> dict[str, Any]:
    """The report of a run in real time whose checks hold.

    Where some are missed, the report must say that the machine was late, and the run is repeated on a slower clock. A
    machine that is overloaded even then may spoil figures of control, and nothing else.
    """
    tried = []
    for factor in FACTORS:
        folder = terminal.folder / f"{name}-{factor}"
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
    """Whether the machine was so late that nothing can be said of control."""
    figures = report["run"]
    slowest_hz = 25
    ticks = max(figures["ticks_missed"].values(), default=0)
    late: bool = (
        figures["lag_s"] > OVERLOADED * figures["wall_seconds"]
        or ticks > OVERLOADED * slowest_hz * figures["sim_seconds"]
    )
    return late
