"""The results of a sweep as a table: a row for each run, with the varied values and every figure of its report."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import msgspec.inspect

from deploy.report.checks import KEYS, RUN_KEYS
from deploy.report.record import RunFigures, read_report
from deploy.sweep.definition import Definition, Run
from messages.base import DECODE_ERRORS
from services.grader.records import ArmFigures, RobotFigures
from services.runtime.atomic_file import write_atomic
from services.runtime.errors import BadInput, unknown_name

RESULT_FILE = "result.json"
"""Result file in the folder of a run that has ended by itself; a run without one is run again."""
CSV_FILE, PARQUET_FILE = "sweep.csv", "sweep.parquet"
OWN_COLUMNS = ("run", "ended", "status", "missed", "error", "trajectory_hash")
"""Columns besides the varied values and the figures."""

Cell = str | float | int | bool | None
Row = dict[str, Cell]


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended: the exit status of ``up``, its wall time [s], and its last output line if it has no report."""

    status: int
    seconds: float
    error: str = ""


def read_result(folder: Path) -> Result | None:
    """Return the result of the run in a folder; None if it has not ended by itself yet."""
    try:
        return msgspec.json.decode((folder / RESULT_FILE).read_bytes(), type=Result)
    except (OSError, *DECODE_ERRORS):
        return None


def make_row(run: Run, folder: Path, result: Result) -> Row:
    """Return the table row of a run; without a report, only the varied values and the error."""
    report = read_report(folder)
    row: Row = {"run": run.folder_name(), **run.values, "status": result.status, "error": result.error}
    row |= {"ended": "", "missed": None, "trajectory_hash": ""}
    if report is None:
        return row
    row |= {
        "ended": report.run.ended,
        "missed": sum(not each.ok for each in report.checks),
        "trajectory_hash": report.run.trajectory_hash,
    }
    row |= {name: getattr(report.run, name) for name in RUN_KEYS}
    for robot, figures in report.robots.items():
        row |= {f"{robot}.{name}": value for name, value in _scalars(msgspec.to_builtins(figures))}
    # A service's own checks are not figures of a robot or the run.
    row |= {each.name: each.value for each in report.checks if each.name not in row}
    return row


def _scalars(figures: Mapping[str, Any]) -> Iterator[tuple[str, Cell]]:
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}.{inner}", each) for inner, each in _scalars(value))
        elif value is None or isinstance(value, (bool, int, float)):
            yield name, value


def unit_of(figure: str) -> str:
    """Return the unit of a figure, e.g. ``s`` for ``arm.step_settling_s``; empty if unknown."""
    name = figure.rpartition(".")[2]
    for record in (RunFigures, RobotFigures, ArmFigures):
        info = msgspec.inspect.type_info(record)
        assert isinstance(info, msgspec.inspect.StructType)
        for each in info.fields:
            if each.name == name:
                return _stated_unit(each.type)
    return ""


def _stated_unit(kind: Any) -> str:
    """Return the unit in the schema of a type, or of a member of a union."""
    if isinstance(kind, msgspec.inspect.Metadata):
        return str((kind.extra_json_schema or {}).get("unit", ""))
    return next((unit for each in getattr(kind, "types", ()) if (unit := _stated_unit(each))), "")


def columns(definition: Definition, rows: Sequence[Row]) -> list[str]:
    """Return the columns of a table: the run, the varied values, how it ended, then all figures that any row has."""
    first = ["run", *(each.name for each in definition.axes), *OWN_COLUMNS[1:]]
    return list(dict.fromkeys((*first, *(name for row in rows for name in row))))


def write_tables(definition: Definition, rows: Sequence[Row], folder: Path) -> None:
    """Write sweep.csv and, if there are rows, sweep.parquet, each atomically."""
    names = columns(definition, rows)
    text = io.StringIO()
    table = csv.DictWriter(text, names, restval="", lineterminator="\n")
    table.writeheader()
    table.writerows({name: "" if value is None else value for name, value in row.items()} for row in rows)
    write_atomic(folder / CSV_FILE, text.getvalue().encode())
    if rows:
        write_atomic(folder / PARQUET_FILE, _parquet(definition, rows, names))


def _parquet(definition: Definition, rows: Sequence[Row], names: Sequence[str]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    numbers = {each.name: each for each in definition.axes if each.is_numeric}
    values: dict[str, list[Any]] = {}
    for name in names:
        found = [row.get(name) for row in rows]
        if name in numbers:
            found = [None if each is None else numbers[name].number(str(each)) for each in found]
        elif any(isinstance(each, float) for each in found):
            found = [None if each is None else float(each) for each in found]
        values[name] = found
    into = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(pyarrow.table(values), into)
    return bytes(into.getvalue())


def check_figure(name: str, robots: Sequence[str], where: str) -> None:
    """Raise BadInput for a figure that no report has; a service's own figure is recognized by its slash."""
    if name.startswith("/") or name in RUN_KEYS or name == "missed":
        return
    robot, dot, figure = name.partition(".")
    if robot in robots and dot:
        if figure.partition(".")[0] not in KEYS:
            raise unknown_name("figure", name, [f"{robot}.{each}" for each in KEYS], where)
        return
    if name in KEYS:
        raise BadInput(
            f"{where}: {name} is a figure of a robot: say whose, e.g. {robots[0] if robots else 'NAME'}.{name}"
        )
    raise unknown_name("figure", name, [*RUN_KEYS, *(f"{each}.{key}" for each in robots for key in KEYS)], where)
