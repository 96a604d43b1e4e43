"""The picture of a sweep: a figure over a varied quantity, with its spread over the seeds."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from statistics import fmean
from typing import NamedTuple

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from deploy.sweep.definition import SEED, Axis, Definition
from deploy.sweep.results import Row, unit_of
from models import palette
from services.runtime.errors import BadInput, unknown_name

SIZE_INCHES, DPI = (7.2, 4.5), 150
MAX_LINES = 12
"""Maximum number of lines; of more combinations only the first are drawn, as the title states."""


class Line(NamedTuple):
    """A line: its label, the x values of its points, and for each of them the values of all seeds."""

    label: str
    places: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]


def choose_axis(definition: Definition, over: str) -> Axis:
    """Return the x axis: ``over``, else the first axis with several numbers, else any with several values.

    Raises:
        BadInput: No axis has this name, or nothing was varied.
    """
    if over:
        named = {each.name: each for each in definition.axes} | {each.key: each for each in definition.axes}
        if over not in named:
            raise unknown_name("axis", over, named, "--over")
        return named[over]
    varied = definition.varied
    if not varied:
        raise BadInput("nothing was varied: a picture needs --seeds or a --set with several values")
    parameters = [each for each in varied if each.name != SEED]
    return next((each for each in parameters if each.is_numeric), (parameters or list(varied))[0])


def make_lines(definition: Definition, rows: Sequence[Row], figure: str, axis: Axis) -> list[Line]:
    """Return a line for each combination of the other axes except the seeds; runs without this figure are left out."""
    others = [each for each in definition.varied if each.name not in (axis.name, SEED)]
    found: dict[tuple[str, ...], dict[str, list[float]]] = {}
    for row in rows:
        value = row.get(figure)
        if isinstance(value, (int, float)):
            line = found.setdefault(tuple(str(row[each.name]) for each in others), {})
            line.setdefault(str(row[axis.name]), []).append(float(value))
    lines = []
    for combination, by_place in found.items():
        label = ", ".join(f"{each.name} {value}" for each, value in zip(others, combination, strict=True))
        points = sorted((_place(axis, value), tuple(values)) for value, values in by_place.items())
        lines.append(Line(label, tuple(each for each, _ in points), tuple(each for _, each in points)))
    return lines


def _place(axis: Axis, value: str) -> float:
    number = axis.number(value) if axis.is_numeric else None
    return number if number is not None else float(axis.values.index(value))


def draw(definition: Definition, rows: Sequence[Row], figure: str, over: str = "") -> bytes:
    """Draw the picture as PNG; raises BadInput if no run has the figure."""
    axis = choose_axis(definition, over)
    lines = make_lines(definition, rows, figure, axis)
    if not lines:
        known = sorted({name for row in rows for name, value in row.items() if isinstance(value, (int, float))})
        raise unknown_name("figure", figure, known, "no run has a number for it")
    picture = Figure(figsize=SIZE_INCHES, layout="constrained")
    FigureCanvasAgg(picture)
    plot = picture.add_subplot()
    colours = palette.colours(each.label for each in lines)
    for line in lines[:MAX_LINES]:
        colour = palette.hexadecimal(colours[line.label])
        means = [fmean(each) for each in line.values]
        plot.plot(line.places, means, "o-", color=colour, label=line.label or None, ms=4, lw=1.5)
        if any(len(each) > 1 for each in line.values):
            least, most = [min(each) for each in line.values], [max(each) for each in line.values]
            plot.fill_between(line.places, least, most, color=colour, alpha=0.15, lw=0)
    if not axis.is_numeric:
        plot.set_xticks(range(len(axis.values)), list(axis.values))
    plot.set_xlabel(axis.name)
    plot.set_ylabel(f"{figure} [{unit}]" if (unit := unit_of(figure)) else figure)
    plot.grid(True, color="#e6e9ed")
    plot.spines[["top", "right"]].set_visible(False)
    if any(each.label for each in lines):
        picture.legend(frameon=False, fontsize="small", loc="outside right upper")
    plot.set_title(_title(definition, rows, len(lines)), fontsize="medium", loc="left")
    out = BytesIO()
    picture.savefig(out, format="png", dpi=DPI)
    return out.getvalue()


def _title(definition: Definition, rows: Sequence[Row], lines: int) -> str:
    seeds = next((len(each.values) for each in definition.axes if each.name == SEED), 1)
    spread = f", mean and range over {seeds} seeds" if seeds > 1 else ""
    more = f"; {MAX_LINES} of {lines} combinations" if lines > MAX_LINES else ""
    return f"{definition.fleet}: {len(rows)} runs{spread}{more}"
