"""The picture of a run: paths from above, cross-track error and speed over time; and what its arms did."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from deploy.report.arm_picture import draw_arms, shown_arms
from deploy.report.axes import FAINT, INK, Line, coloured, dress, shortened
from deploy.report.record import Report
from deploy.report.table import bases, squares
from services.grader.records import TRAIL_COLUMNS, RobotFigures

WIDTH, HEIGHT, ARM_HEIGHT, EMPTY_HEIGHT, DPI = 13.5, 7.6, 3.4, 1.6, 130
"""Inches; a run with robots that drive and arms is as high as both."""

LEAST_SPEED, LEAST_DISTANCE = 0.01, 1e-5
"""m/s and m that the axes reach at least: what lies far below is a rest of a calculation."""

SHADES = 256
"""Colours in the file: it looks the same, in a third of the bytes."""

Trails = dict[str, np.ndarray]


def picture(report: Report, trajectories: Path) -> bytes:
    """The PNG's bytes; ``trajectories`` is what the grader stored. Only what has something to show gets a plot."""
    figure = drawn(report, trajectories)
    plain, out = BytesIO(), BytesIO()
    figure.savefig(plain, format="png", pil_kwargs={"compress_level": 1})
    with Image.open(plain) as whole:
        shades = whole.convert("RGB").quantize(SHADES, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    shades.save(out, "PNG", optimize=True)
    return out.getvalue()


def drawn(report: Report, trajectories: Path) -> Figure:
    """The same as a figure of Matplotlib."""
    with np.load(trajectories) as stored:
        arrays: Trails = {name: stored[name] for name in stored.files}
    driving = {name: each for name, each in bases(report).items() if len(arrays[f"{name}.trail"])}
    arms = shown_arms(report, arrays)
    height = (HEIGHT if driving or not arms else 0.0) + (ARM_HEIGHT if driving and arms else HEIGHT if arms else 0.0)
    height = height if driving or arms else EMPTY_HEIGHT
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    if driving:
        bottom = ((ARM_HEIGHT if arms else 0.0) + 0.874) / height
        _bases(figure, bottom, report, driving, arrays)
    if arms:
        near, *rest = _arm_axes(figure, bool(driving), any(each.steps for each in arms.values()))
        draw_arms(near, (rest[0], rest[1], rest[2]), arms, arrays, coloured(arms, report.robots))
    if not driving and not arms:
        figure.text(0.055, 0.2, "Nothing was measured: no robot was seen.", fontsize=11, color=INK)
    _head(figure, report)
    return figure


def _bases(figure: Any, bottom: float, report: Report, driving: dict[str, RobotFigures], arrays: Trails) -> None:
    """The robots that drive, above ``bottom``, a share of the height; their legend lies below it."""
    top, line = 1 - 1.102 / figure.get_figheight(), coloured(driving, report.robots)
    tracked = [name for name in driving if not np.isnan(_column(arrays[f"{name}.trail"], "cross_track")).all()]
    grid = figure.add_gridspec(
        2 if tracked else 1,
        2,
        width_ratios=(0.86, 1),
        left=0.055,
        right=0.985,
        top=top,
        bottom=bottom,
        wspace=0.15,
        hspace=0.3,
    )
    above, along = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[-1, 1])
    for name in driving:
        trail = arrays[f"{name}.trail"]
        _paths(above, arrays[f"{name}.path"], trail, line[name].colour, shortened(name))
        along.plot(_column(trail, "time"), _column(trail, "speed"), **line[name].drawn, label=shortened(name))
    if tracked:
        across = figure.add_subplot(grid[0, 1], sharex=along)
        _cross_track(across, {name: driving[name] for name in tracked}, arrays, line)
    dress(above, "Paths seen from above", "x [m]", "y [m]")
    above.set_aspect("equal", adjustable="datalim")
    dress(along, "True speed", "simulation time [s]", "speed [m/s]")
    _key(along, LEAST_SPEED)
    _squares(above, report)
    _legend(figure, above, bottom - 0.813 / figure.get_figheight(), bool(tracked))


def _arm_axes(figure: Any, beside: bool, steps: bool) -> list[Any]:
    """Step, angle, error and effort: the whole picture, or a row of it below the robots that drive. Without ``steps``
    the first is None."""
    none = [] if steps else [None]
    if beside:
        top, bottom = (ARM_HEIGHT - 0.45) / figure.get_figheight(), 0.5 / figure.get_figheight()
        columns = 4 if steps else 3
        grid = figure.add_gridspec(1, columns, left=0.055, right=0.985, top=top, bottom=bottom, wspace=0.26)
        return [*none, *(figure.add_subplot(grid[0, column]) for column in range(columns))]
    sides = {"left": 0.055, "right": 0.985, "top": 0.855, "bottom": 0.075}
    if not steps:
        grid = figure.add_gridspec(3, 1, **sides, hspace=0.5)
        return [None, *(figure.add_subplot(grid[row, 0]) for row in range(3))]
    grid = figure.add_gridspec(3, 2, width_ratios=(0.8, 1), **sides, wspace=0.15, hspace=0.5)
    return [figure.add_subplot(each) for each in (grid[:, 0], grid[0, 1], grid[1, 1], grid[2, 1])]


def _column(trail: np.ndarray, name: str) -> np.ndarray:
    column: np.ndarray = trail[:, TRAIL_COLUMNS.index(name)]
    return column


def _paths(axes: Any, path: np.ndarray, trail: np.ndarray, colour: str, name: str) -> None:
    axes.plot(path[:, 0], path[:, 1], color=colour, lw=5, alpha=0.16, solid_joinstyle="round", zorder=1)
    axes.plot(_column(trail, "x"), _column(trail, "y"), color=colour, lw=1.3, label=name, zorder=3)
    # Odometry may come less often than ground truth; between its samples the trail has none.
    seen = trail[~np.isnan(_column(trail, "odom_x"))]
    axes.plot(_column(seen, "odom_x"), _column(seen, "odom_y"), color=INK, lw=0.8, ls=(0, (1, 4)), alpha=0.8, zorder=4)
    axes.plot(path[1:, 0], path[1:, 1], ls="", marker="o", ms=5, mfc="white", mec=colour, mew=1.3, zorder=5)
    start = path[:1] if len(path) else np.array([[_column(trail, "x")[0], _column(trail, "y")[0]]])
    axes.plot(start[:, 0], start[:, 1], ls="", marker="s", ms=6, color=colour, zorder=6)


def _squares(axes: Any, report: Report) -> None:
    """How each square closed, and why it did not, below the title of the paths."""
    lines = [line for line in squares(report) if "closed" in line]
    lines += [line for note in report.notes for line in wrap(note, 78)]
    if lines:
        axes.text(0.01, 0.985, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=7.5, color=INK, zorder=7)
        # A point that is not drawn makes room; limits set by hand would cut the paths, the scales being equal.
        reach = axes.dataLim
        axes.plot([reach.x0], [reach.y1 + reach.height * (0.05 + 0.03 * len(lines))], ls="")


def _cross_track(axes: Any, robots: dict[str, RobotFigures], arrays: Trails, line: dict[str, Line]) -> None:
    largest = max((each.cross_track_max_m or 0.0 for each in robots.values()), default=0.0)
    factor, unit = (1000.0, "mm") if largest < 0.1 else (1.0, "m")
    for name, figures in robots.items():
        trail, rms = arrays[f"{name}.trail"], figures.cross_track_rms_m
        label = shortened(name) if rms is None else f"{shortened(name)}: rms {rms * factor:.2f} {unit}"
        axes.plot(_column(trail, "time"), factor * _column(trail, "cross_track"), **line[name].drawn, label=label)
    dress(axes, "Distance of the true position from the reference path", "simulation time [s]", f"distance [{unit}]")
    _key(axes, LEAST_DISTANCE * factor)


def _key(axes: Any, least: float) -> None:
    """A legend over the lines, which begin at 0 and make room for it; the axis reaches ``least`` at least."""
    axes.set_ylim(0, 1.3 * max(least, axes.get_ylim()[1]))
    axes.legend(loc="upper center", ncols=3, fontsize=8, frameon=False, labelcolor=INK, handlelength=3)


def _legend(figure: Any, axes: Any, bottom: float, planned: bool) -> None:
    reference = [Line2D([], [], color=FAINT, lw=5, alpha=0.4, label="reference")]
    points = [Line2D([], [], color=FAINT, ls="", marker="o", mfc="white", ms=5, label="point")]
    kinds = [
        *(reference if planned else ()),
        Line2D([], [], color=FAINT, lw=1.3, label="true"),
        Line2D([], [], color=INK, lw=0.8, ls=(0, (1, 4)), label="odometry"),
        Line2D([], [], color=FAINT, ls="", marker="s", ms=6, label="start"),
        *(points if planned else ()),
    ]
    names = axes.get_legend_handles_labels()[0]
    figure.legend(
        handles=[*names, *kinds],
        loc="lower left",
        bbox_to_anchor=(0.045, bottom),
        ncols=11,
        fontsize=8.5,
        frameon=False,
        labelcolor=INK,
    )


def _head(figure: Any, report: Report) -> None:
    run, driving = report.run, bases(report).values()
    name_at, facts_at = (1 - inches / figure.get_figheight() for inches in (0.418, 0.699))
    figure.text(0.055, name_at, f"{run.fleet}", fontsize=17, fontweight="bold", color=INK)
    verdict, colour = ("all checks hold", "#1a7f37") if report.ok else ("checks missed", "#c1121f")
    figure.text(0.985, name_at, verdict, fontsize=13, fontweight="bold", color=colour, ha="right")
    reached, points = sum(each.points_reached for each in driving), sum(each.points for each in driving)
    facts = (
        *((f"{reached} of {points} points reached",) if points else ()),
        f"{run.sim_seconds:.1f} s simulated",
        f"{run.mode}, {run.real_time_factor:.1f} x real time",
        *((f"{sum(each.collisions for each in driving)} collisions",) if driving else ()),
        f"{run.messages_lost} messages lost",
        f"seed {run.seed}",
        f"trajectory hash {run.trajectory_hash[:12]}",
    )
    figure.text(0.055, facts_at, "   ·   ".join(facts), fontsize=9.5, color=FAINT)
