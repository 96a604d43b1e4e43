"""How parameters are shown: as columns for a person, as plain values for JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any

from deploy.live.output import printable
from messages.parameters import Assignment, ParameterChange, ParameterDescription, ParameterValues, Value


def text_of(value: Value) -> str:
    """A value as one would write it."""
    return printable(value) if isinstance(value, str) else json.dumps(value)


def columns(rows: Iterable[Sequence[str]]) -> str:
    """Rows with each column as wide as its widest cell."""
    table = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table)
    return printable("".join(f"{line}\n" for line in lines))


def print_json(value: Any) -> None:
    """Indented, on standard output."""
    sys.stdout.write(json.dumps(value, indent=2) + "\n")


def values_as_json(record: ParameterValues) -> dict[str, Any]:
    """A set's values."""
    values = {each.name: {"value": each.value, "origin": each.origin} for each in record.values}
    return {"set": record.set, "revision": record.revision, "values": values, "note": record.note}


def description_as_row(each: ParameterDescription) -> tuple[str, ...]:
    """Name, type, bounds or choices, default, whether it is live, text."""
    from services.runtime.parameters.allowed import beside, long, within

    bounds = (within(each) or each.unit or ", ".join(each.choices), long(each), beside(each))
    allowed = ", ".join(part for part in bounds if part)
    kind = each.type + (" or null" if each.optional else "")
    return each.name, kind, allowed, text_of(each.default), "" if each.live else "at start only", each.text


def change_as_row(each: ParameterChange) -> tuple[str, ...]:
    """Revision, set, kind, values, who, when."""
    wall = datetime.fromtimestamp(each.wall_time / 1e9).strftime("%Y-%m-%d %H:%M:%S")
    marks = ", ".join(mark for mark, set_ in (("run only", each.run), ("undone", each.undone)) if set_)
    kind = f"{each.kind} ({marks})" if marks else each.kind
    changed = moves(each.before, each.after)
    return str(each.revision), each.set, kind, changed, each.who, wall, f"{each.sim_time.ns / 1e9:.3f} s"


def moves(before: Iterable[Assignment], after: Iterable[Assignment]) -> str:
    """``kp 1.0 -> 2.0, kd 3.0 -> 4.0``."""
    old = {each.name: each.value for each in before}
    return ", ".join(f"{each.name} {text_of(old.get(each.name))} -> {text_of(each.value)}" for each in after)


def difference(before: ParameterValues, after: ParameterValues, names: Iterable[str]) -> str:
    """A line for each name: its value, what it was, and where it comes from."""
    old = {each.name: each for each in before.values}
    new = {each.name: each for each in after.values}
    lines = []
    for name in names:
        if name not in new:
            lines.append(f"{after.set} {name}: no longer kept\n")
            continue
        now, was = new[name], old.get(name)
        same = was is not None and was.value == now.value
        change = "is" if same or was is None else f"{text_of(was.value)} ->"
        lines.append(f"{after.set} {name}: {change} {text_of(now.value)}  ({now.origin})\n")
    return "".join(lines)
