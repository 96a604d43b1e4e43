"""The picture of many driving robots: all paths faintly, the worst by name, and the others as percentiles."""

from __future__ import annotations

from textwrap import shorten, wrap
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from deploy.report.axes import (
    FAINT,
    INK,
    MIN_DISTANCE_SPAN,
    MIN_SPEED_SPAN,
    Trails,
    base_column,
    draw_world,
    ensure_ground,
    line_styles,
    shorten_name,
    style_axes,
)
from deploy.report.ranking import missed_checks, worst_first
from deploy.report.record import Report
from models import palette
from services.grader.records import RobotFigures

STRIP_HEIGHT = 2.6
"""Height [inches] of the row of small plots below the paths."""

LINES, NAMED = 4, 8
"""Number of worst robots with their own line over time, and of those named on the map."""

BAD, BAND = "#c1121f", "#566270"

INSTANTS, PATH_POINTS = 600, 800
"""Number of instants at which robots are compared, and maximum number of points of a drawn path."""

BANDS = ((5, 95, 0.16), (25, 75, 0.32))
"""Pairs of percentiles with a filled area between them, and its opacity."""


class _Quantity(NamedTuple):
    """A figure with its own small plot: key, title, unit and factor to it, and whether small values are bad."""

    key: str
    title: str
    unit: str
    factor: float
    small_is_bad: bool = False


_QUANTITIES = (
    _Quantity("cross_track_max_m", "Largest distance from the path", "mm", 1000),
    _Quantity("odometry_error_max_m", "Largest odometry error", "mm", 1000),
    _Quantity("min_distance_m", "Least distance to a robot", "m", 1, True),
    _Quantity("min_clearance_m", "Least clearance to a body", "m", 1, True),
    _Quantity("time_s", "Time to finish the plan", "s", 1),
    _Quantity("path_length_m", "Length of the path", "m", 1),
)
_SMALL_PLOTS = 4


def draw_many(figure: Any, bottom: float, report: Report, driving: dict[str, RobotFigures], arrays: Trails) -> None:
    """Draw driving robots into ``figure`` above ``bottom``, a share of its height."""
    height = figure.get_figheight()
    top, middle = 1 - 1.102 / height, bottom + (STRIP_HEIGHT + 0.62) / height
    colours = {name: palette.hexadecimal(each) for name, each in palette.colours(report.robots).items()}
    ordered = [name for name in worst_first(report) if name in driving]
    missed = missed_checks(report)
    worst, bad = ordered[:LINES], [name for name in ordered if name in missed]
    tracked = [name for name in driving if not np.isnan(base_column(arrays[f"{name}.trail"], "cross_track")).all()]
    sides = {"left": 0.055, "right": 0.985}
    grid = figure.add_gridspec(
        2 if tracked else 1, 2, width_ratios=(0.86, 1), **sides, top=top, bottom=middle, wspace=0.15, hspace=0.34
    )
    above, along = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[-1, 1])
    _draw_paths(above, driving, arrays, colours, bad, report)
    if tracked:
        largest = max((driving[name].cross_track_max_m or 0.0 for name in tracked), default=0.0)
        factor, unit = (1000.0, "mm") if largest < 0.1 else (1.0, "m")
        across, title = figure.add_subplot(grid[0, 1], sharex=along), "Distance of the true position from the path"
        named = [name for name in worst if name in tracked]
        _draw_bands(across, {name: arrays[f"{name}.trail"] for name in tracked}, "cross_track", factor, named, colours)
        style_axes(across, title, "simulation time [s]", f"distance [{unit}]")
        _add_legend(across, MIN_DISTANCE_SPAN * factor)
    _draw_bands(along, {name: arrays[f"{name}.trail"] for name in driving}, "speed", 1.0, worst, colours)
    style_axes(along, "True speed", "simulation time [s]", "speed [m/s]")
    _add_legend(along, MIN_SPEED_SPAN)
    measured = [each for each in _QUANTITIES if any(getattr(one, each.key) is not None for one in driving.values())]
    shown = measured[:_SMALL_PLOTS]
    strip = figure.add_gridspec(
        1, len(shown), **sides, top=bottom + (STRIP_HEIGHT - 0.45) / height, bottom=bottom, wspace=0.22
    )
    for column, quantity in enumerate(shown):
        _draw_sorted(figure.add_subplot(strip[0, column]), quantity, driving, report)


def _draw_paths(
    axes: Any,
    driving: dict[str, RobotFigures],
    arrays: Trails,
    colours: dict[str, str],
    bad: list[str],
    report: Report,
) -> None:
    """Draw all true paths with start and goals; a robot that missed a check ends in a cross, the
    worst with its name.
    """
    paths, starts, goals = [], [], []
    for name in driving:
        trail, reference = arrays[f"{name}.trail"], arrays[f"{name}.path"]
        line = np.column_stack((base_column(trail, "x"), base_column(trail, "y")))
        paths.append(line[:: max(1, -(-len(line) // PATH_POINTS))])
        starts.append(line[0])
        goals += list(reference[1:])
    each = [colours[name] for name in driving]
    axes.add_collection(LineCollection(paths, colors=each, linewidths=0.9, alpha=0.55, zorder=3))
    spread = np.array([*starts, *goals])
    if goals:
        at = np.array(goals)
        axes.scatter(at[:, 0], at[:, 1], s=9, facecolors="white", edgecolors=FAINT, linewidths=0.7, zorder=2)
    axes.scatter(*np.array(starts).T, s=13, marker="s", c=each, linewidths=0, zorder=4)
    axes.update_datalim(spread)
    if bad:
        ends = np.array([[base_column(arrays[f"{name}.trail"], key)[-1] for key in ("x", "y")] for name in bad])
        axes.scatter(*ends.T, s=42, marker="x", c=BAD, linewidths=1.6, zorder=6)
        for name, end in zip(bad[:NAMED], ends, strict=False):
            axes.annotate(
                shorten_name(name),
                end,
                (5, 4),
                textcoords="offset points",
                fontsize=8,
                color=BAD,
                zorder=7,
                bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.8},
            )
    axes.autoscale_view()
    ensure_ground(axes)
    draw_world(axes, arrays)
    style_axes(axes, "Paths seen from above", "x [m]", "y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    _draw_notes(axes, report)
    kinds = [
        Line2D([], [], color=FAINT, lw=0.9, label=f"{len(driving)} true paths"),
        Line2D([], [], color=FAINT, ls="", marker="s", ms=4, label="start"),
        *([Line2D([], [], color=FAINT, ls="", marker="o", mfc="white", ms=4, label="point")] if goals else ()),
        *(
            [Line2D([], [], color=BAD, ls="", marker="x", ms=6, mew=1.6, label=f"end of {len(bad)} that missed checks")]
            if bad
            else ()
        ),
    ]
    axes.legend(
        handles=kinds,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.075),
        ncols=4,
        fontsize=8.5,
        frameon=False,
        labelcolor=INK,
    )


MAX_NOTE_LINES = 4


def _draw_notes(axes: Any, report: Report) -> None:
    lines = [line for note in report.notes for line in wrap(note, 92)]
    if len(lines) > MAX_NOTE_LINES:
        lines = [*lines[: MAX_NOTE_LINES - 1], shorten(" ".join(lines[MAX_NOTE_LINES - 1 :]), 88, placeholder=" …")]
    if not lines:
        return
    box = {"fc": "white", "ec": "none", "alpha": 0.8, "pad": 2}
    axes.text(
        0.01, 0.985, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=7, color=INK, zorder=8, bbox=box
    )
    reach = axes.dataLim  # an invisible point extends the limits
    axes.plot([reach.x0], [reach.y1 + reach.height * (0.04 + 0.025 * len(lines))], ls="")


def _draw_bands(
    axes: Any, trails: dict[str, np.ndarray], key: str, factor: float, worst: list[str], colours: dict[str, str]
) -> None:
    """Draw the percentiles of all robots at each instant, their extreme, and the lines of the worst."""
    ends = [base_column(trail, "time")[[0, -1]] for trail in trails.values()]
    instants = np.linspace(min(first for first, _ in ends), max(last for _, last in ends), INSTANTS)
    values = np.array([factor * sample_trail(trail, key, instants) for trail in trails.values()])
    seen = ~np.isnan(values).all(axis=0)
    instants, values = instants[seen], values[:, seen]
    for low, high, opacity in BANDS:
        lower, upper = np.nanpercentile(values, (low, high), axis=0)
        axes.fill_between(instants, lower, upper, color=BAND, alpha=opacity, lw=0, label=f"{low} to {high} %")
    axes.plot(instants, np.nanmedian(values, axis=0), color=BAND, lw=1.5, label="median")
    axes.plot(instants, np.nanmax(values, axis=0), color=FAINT, lw=0.8, ls=(0, (3, 2)), label="largest")
    for name, style in line_styles(worst).items():
        trail = trails[name]
        axes.plot(
            base_column(trail, "time"),
            factor * base_column(trail, key),
            color=colours[name],
            lw=style.width,
            ls=style.dash,
            alpha=0.9,
            label=shorten_name(name),
        )


def sample_trail(trail: np.ndarray, key: str, instants: np.ndarray) -> np.ndarray:
    """Return a column of a trail interpolated linearly at ``instants`` [s], shape (n,); nan where
    it was not measured.
    """
    time, column = base_column(trail, "time"), base_column(trail, key)
    known = ~np.isnan(column)
    if not known.any():
        return np.full(len(instants), np.nan)
    sampled: np.ndarray = np.interp(instants, time[known], column[known], left=np.nan, right=np.nan)
    return sampled


def _add_legend(axes: Any, least: float) -> None:
    axes.set_ylim(0, 1.35 * max(least, axes.get_ylim()[1]))
    handles, labels = axes.get_legend_handles_labels()
    handles = [
        Patch(color=BAND, alpha=each.get_alpha()) if label.endswith("%") else each
        for each, label in zip(handles, labels, strict=True)
    ]
    axes.legend(
        handles, labels, loc="upper center", ncols=4, fontsize=8, frameon=False, labelcolor=INK, handlelength=2.4
    )


def _draw_sorted(axes: Any, quantity: _Quantity, driving: dict[str, RobotFigures], report: Report) -> None:
    """Draw a figure of every robot from the best to the worst, its bounds, and the robots that miss them."""
    values = {
        name: quantity.factor * value
        for name, each in driving.items()
        if (value := getattr(each, quantity.key)) is not None
    }
    names = sorted(values, key=lambda name: -values[name] if quantity.small_is_bad else values[name])
    checks = [each for each in report.checks if each.name.endswith(f".{quantity.key}")]
    missed = {each.name.rpartition(".")[0] for each in checks if not each.ok}
    held = [(rank, values[name]) for rank, name in enumerate(names, 1) if name not in missed]
    failed = [(rank, values[name]) for rank, name in enumerate(names, 1) if name in missed]
    for points, colour in ((held, BAND), (failed, BAD)):
        if points:
            axes.scatter(*np.array(points).T, s=9, c=colour, linewidths=0, zorder=4)
    low, high = min(values.values()), max(values.values())
    for bound in sorted({quantity.factor * each.bound for each in checks}):
        if bound <= 4 * high + 1e-9:
            axes.axhline(bound, color=INK, lw=0.8, ls=(0, (4, 3)), zorder=3)
            axes.annotate("bound", (1, bound), (0, 2), textcoords="offset points", fontsize=7.5, color=INK)
            low, high = min(low, bound), max(high, bound)
    room = 0.08 * (high - low or max(abs(high), 1e-3))
    bottom = low - room if low < 0 or low > 0.5 * high else 0.0 - room / 2
    axes.set_ylim(bottom, high + 2 * room)
    if names:
        last, left = names[-1], 0.5 * len(names)
        axes.annotate(
            shorten_name(last),
            (len(names), values[last]),
            (-4, -9 if quantity.small_is_bad else 4),
            textcoords="offset points",
            ha="right",
            fontsize=7.5,
            color=BAD if last in missed else INK,
        )
        unmeasured = len(driving) - len(names)
        if unmeasured:
            axes.text(left, bottom + 0.3 * room, f"{unmeasured} not measured", fontsize=7.5, color=FAINT, ha="center")
    style_axes(axes, quantity.title, "robots, the best first", f"[{quantity.unit}]")
