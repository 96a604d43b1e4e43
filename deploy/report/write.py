"""Builds the report: from measurements and facts to report.json and report.png."""

from __future__ import annotations

from pathlib import Path

import msgspec

from deploy.report.checks import Bounds, check_figures
from deploy.report.notes import real_time_notes
from deploy.report.record import (
    PICTURE_FILE,
    REPORT_FILE,
    SCHEMA,
    Report,
    RunFacts,
    loss_notes,
    member_notes,
    run_figures,
)
from messages.base import DECODE_ERRORS
from services.grader.records import MEASUREMENTS_FILE, TRAJECTORIES_FILE, Measurements
from services.grader.results import write_atomic
from services.runtime.errors import BadInput


def read_measurements(folder: Path) -> Measurements:
    """Return the figures that the grader wrote to ``folder``; raises BadInput if there are none."""
    path = folder / MEASUREMENTS_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=Measurements)
    except FileNotFoundError:
        raise BadInput(f"no {MEASUREMENTS_FILE} in {folder}: the grader ended before the run; see its log") from None
    except (OSError, *DECODE_ERRORS) as error:
        raise BadInput(f"{path} cannot be read: {error}") from None


def build_report(measured: Measurements, facts: RunFacts, bounds: Bounds) -> Report:
    """Build the report of a run."""
    run = run_figures(facts, measured)
    found = (*check_figures(run, measured.robots, bounds), *facts.checks)
    ok = all(each.ok for each in found)
    return Report(
        schema=SCHEMA,
        ok=ok,
        run=run,
        robots=measured.robots,
        checks=found,
        parameters=facts.parameters,
        notes=(*facts.notes, *member_notes(facts, measured), *loss_notes(measured), *real_time_notes(run, ok)),
        changes=facts.changes,
    )


def write_report(folder: Path, facts: RunFacts, bounds: Bounds, picture: bool = True) -> Report:
    """Grade the run with measurements in ``folder``; write report.json and the picture report.png next to them.

    Raises BadInput if the folder cannot be written, or has no measurements.
    """
    report = build_report(read_measurements(folder), facts, bounds)
    write_atomic(folder / REPORT_FILE, to_json(report))
    if picture and (folder / TRAJECTORIES_FILE).exists():
        from deploy.report.picture import render_png

        write_atomic(folder / PICTURE_FILE, render_png(report, folder / TRAJECTORIES_FILE))
    return report


def to_json(report: Report) -> bytes:
    """Return the text of report.json."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n"
