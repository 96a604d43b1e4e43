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

from deploy.report.arm_picture import arms_of, draw_arms
from deploy.report.axes import FAINT, INK, colours, dress
from deploy.report.record import Report
from deploy.report.table import bases, squares
from services.grader.records import TRAIL_COLUMNS

WIDTH, HEIGHT, ARM_HEIGHT, DPI = 13.5, 7.6, 3.4, 130
"""Inches; a run with robots that drive and arms is as high as both."""

SHADES = 256
"""Colours in the file: it looks the same, in a third of the bytes."""

Trails = dict[str, np.ndarray]


def picture(report: Report, trajectories: Path) -> bytes:
    """The PNG's bytes; ``trajectories`` is what the grader stored."""
    with np.load(trajectories) as stored:
        arrays: Trails = {name: stored[name] for name in stored.files}
    drives, jointed, colour = bool(bases(report)) or not report.robots, bool(arms_of(report)), colours(report.robots)
    height = HEIGHT + (ARM_HEIGHT if drives and jointed else 0.0)
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    bottom = ((ARM_HEIGHT if jointed else 0.0) + 0.874) / height if drives else 0.0
    if drives:
        _bases(figure, bottom, report, arrays, colour)
    if jointed:
        draw_arms(_arm_axes(figure, drives), report, arrays, colour)
    _head(figure, report)
    drawn, out = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", pil_kwargs={"compress_level": 1})
    with Image.open(drawn) as whole:
        shades = whole.convert("RGB").quantize(SHADES, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    shades.save(out, "PNG", optimize=True)
    return out.getvalue()


def _bases(figure: Any, bottom: float, report: Report, arrays: Trails, colour: dict[str, str]) -> None:
    """The robots that drive, above ``bottom``, a share of the height; their legend lies below it."""
    top = 1 - 1.102 / figure.get_figheight()
    grid = figure.add_gridspec(
        2, 2, width_ratios=(0.86, 1), left=0.055, right=0.985, top=top, bottom=bottom, wspace=0.15, hspace=0.26
    )
    above, across, along = (figure.add_subplot(each) for each in (grid[:, 0], grid[0, 1], grid[1, 1]))
    for name in bases(report):
        trail = arrays[f"{name}.trail"]
        _paths(above, arrays[f"{name}.path"], trail, colour[name], name)
        along.plot(_column(trail, "time"), _column(trail, "speed"), color=colour[name], lw=0.9, alpha=0.85)
    _cross_track(across, report, arrays, colour)
    dress(above, "Paths seen from above", "x [m]", "y [m]")
    above.set_aspect("equal", adjustable="datalim")
    along.sharex(across)
    dress(along, "True speed", "simulation time [s]", "m/s")
    along.set_ylim(bottom=0)
    _squares(above, report)
    _legend(figure, above, bottom - 0.813 / figure.get_figheight())


def _arm_axes(figure: Any, beside: bool) -> tuple[Any, Any, Any, Any]:
    """Step, angle, error and effort: the whole picture, or a row of it below the robots that drive."""
    if beside:
        top, bottom = (ARM_HEIGHT - 0.45) / figure.get_figheight(), 0.5 / figure.get_figheight()
        grid = figure.add_gridspec(1, 4, left=0.055, right=0.985, top=top, bottom=bottom, wspace=0.22)
        near, angle, error, effort = (figure.add_subplot(grid[0, column]) for column in range(4))
        return near, angle, error, effort
    grid = figure.add_gridspec(
        3, 2, width_ratios=(0.8, 1), left=0.055, right=0.985, top=0.855, bottom=0.075, wspace=0.15, hspace=0.38
    )
    near, angle, error, effort = (figure.add_subplot(each) for each in (grid[:, 0], grid[0, 1], grid[1, 1], grid[2, 1]))
    return near, angle, error, effort


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
    axes.plot(path[:1, 0], path[:1, 1], ls="", marker="s", ms=6, color=colour, zorder=6)


def _squares(axes: Any, report: Report) -> None:
    """How each square closed, and why it did not, below the title of the paths."""
    lines = [line for line in squares(report) if "closed" in line]
    lines += [line for note in report.notes for line in wrap(note, 78)]
    if lines:
        axes.text(0.01, 0.985, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=7.5, color=INK, zorder=7)
        # A point that is not drawn makes room; limits set by hand would cut the paths, the scales being equal.
        reach = axes.dataLim
        axes.plot([reach.x0], [reach.y1 + reach.height * (0.05 + 0.03 * len(lines))], ls="")


def _cross_track(axes: Any, report: Report, arrays: Trails, colour: dict[str, str]) -> None:
    largest = max((each.cross_track_max_m or 0.0 for each in bases(report).values()), default=0.0)
    factor, unit = (1000.0, "mm") if largest < 0.1 else (1.0, "m")
    for name, figures in bases(report).items():
        trail, rms = arrays[f"{name}.trail"], figures.cross_track_rms_m
        label = name if rms is None else f"{name}: rms {rms * factor:.2f} {unit}"
        axes.plot(
            _column(trail, "time"),
            factor * _column(trail, "cross_track"),
            color=colour[name],
            lw=0.9,
            alpha=0.85,
            label=label,
        )
    dress(axes, "Distance of the true position from the reference path", "", unit)
    axes.set_ylim(bottom=0)
    if report.robots:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * 1.3)
        axes.legend(loc="upper center", ncols=2, fontsize=8, frameon=False, labelcolor=INK)


def _legend(figure: Any, axes: Any, bottom: float) -> None:
    kinds = [
        Line2D([], [], color=FAINT, lw=5, alpha=0.4, label="reference"),
        Line2D([], [], color=FAINT, lw=1.3, label="true"),
        Line2D([], [], color=INK, lw=0.8, ls=(0, (1, 4)), label="odometry"),
        Line2D([], [], color=FAINT, ls="", marker="s", ms=6, label="start"),
        Line2D([], [], color=FAINT, ls="", marker="o", mfc="white", ms=5, label="point"),
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
        *((f"{reached} of {points} points reached",) if driving else ()),
        f"{run.sim_seconds:.1f} s simulated",
        f"{run.mode}, {run.real_time_factor:.1f} x real time",
        *((f"{sum(each.collisions for each in driving)} collisions",) if driving else ()),
        f"{run.messages_lost} messages lost",
        f"seed {run.seed}",
        f"trajectory hash {run.trajectory_hash[:12]}",
    )
    figure.text(0.055, facts_at, "   ·   ".join(facts), fontsize=9.5, color=FAINT)
