"""Making the report: measurements and facts in; report.json and report.png out."""

from __future__ import annotations

from pathlib import Path

import msgspec

from deploy.report.bounds import Bounds, checks
from deploy.report.lateness import lateness
from deploy.report.record import PICTURE_FILE, REPORT_FILE, SCHEMA, Report, RunFacts, member_notes, run_figures
from services.grader.folder import write_whole
from services.grader.records import MEASUREMENTS_FILE, TRAJECTORIES_FILE, Measurements
from services.runtime.errors import BadInput


def read_measurements(folder: Path) -> Measurements:
    """The figures that the grader left in ``folder``; raises BadInput when there are none."""
    path = folder / MEASUREMENTS_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=Measurements)
    except FileNotFoundError:
        raise BadInput(f"no {MEASUREMENTS_FILE} in {folder}: the grader ended before the run; see its log") from None
    except (OSError, msgspec.MsgspecError) as error:
        raise BadInput(f"{path} cannot be read: {error}") from None


def compose(measured: Measurements, facts: RunFacts, bounds: Bounds) -> Report:
    """The report of a run."""
    run = run_figures(facts, measured)
    found = (*checks(run, measured.robots, bounds), *facts.checks)
    ok = all(each.ok for each in found)
    return Report(
        schema=SCHEMA,
        ok=ok,
        run=run,
        robots=measured.robots,
        checks=found,
        parameters=facts.parameters,
        notes=(*facts.notes, *member_notes(measured), *lateness(run, ok)),
        changes=facts.changes,
    )


def write_report(folder: Path, facts: RunFacts, bounds: Bounds) -> Report:
    """Grade the run whose measurements lie in ``folder``, and put report.json and report.png beside them.

    Raises BadInput when the folder cannot be written, or when the grader left nothing.
    """
    report = compose(read_measurements(folder), facts, bounds)
    write_whole(folder / REPORT_FILE, to_json(report))
    if (folder / TRAJECTORIES_FILE).exists():
        from deploy.report.picture import picture

        write_whole(folder / PICTURE_FILE, picture(report, folder / TRAJECTORIES_FILE))
    return report


def to_json(report: Report) -> bytes:
    """report.json's text."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n"
