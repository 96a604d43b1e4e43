"""The picture of a run: paths from above, and beside them cross-track error and speed over time."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from deploy.report.record import Report
from deploy.report.table import squares
from services.grader.records import TRAIL_COLUMNS

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's colours, distinct to colour-blind eyes as well; yellow left out for its contrast on white."""
INK, FAINT, GRID = "#22272e", "#8a929c", "#e6e9ed"
SIZE, DPI = (13.5, 7.6), 130

Trails = dict[str, np.ndarray]


def picture(report: Report, trajectories: Path) -> bytes:
    """The PNG's bytes; ``trajectories`` is what the grader stored."""
    with np.load(trajectories) as stored:
        arrays: Trails = {name: stored[name] for name in stored.files}
    figure = Figure(figsize=SIZE, dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        2, 2, width_ratios=(0.86, 1), left=0.055, right=0.985, top=0.855, bottom=0.115, wspace=0.15, hspace=0.26
    )
    above, across, along = (figure.add_subplot(each) for each in (grid[:, 0], grid[0, 1], grid[1, 1]))
    for colour, name in zip(_colours(len(report.robots)), report.robots, strict=True):
        _paths(above, arrays[f"{name}.path"], arrays[f"{name}.trail"], colour, name)
        trail = arrays[f"{name}.trail"]
        along.plot(_column(trail, "time"), _column(trail, "speed"), color=colour, lw=0.9, alpha=0.85)
    _cross_track(across, report, arrays)
    _dress(above, "Paths seen from above", "x [m]", "y [m]")
    above.set_aspect("equal", adjustable="datalim")
    along.sharex(across)
    _dress(along, "True speed", "simulation time [s]", "m/s")
    along.set_ylim(bottom=0)
    _squares(above, report)
    _legend(figure, above)
    _head(figure, report)
    out = BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def _colours(count: int) -> list[str]:
    return [COLOURS[index % len(COLOURS)] for index in range(count)]


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


def _cross_track(axes: Any, report: Report, arrays: Trails) -> None:
    largest = max((each.cross_track_max_m or 0.0 for each in report.robots.values()), default=0.0)
    factor, unit = (1000.0, "mm") if largest < 0.1 else (1.0, "m")
    for colour, name in zip(_colours(len(report.robots)), report.robots, strict=True):
        trail, rms = arrays[f"{name}.trail"], report.robots[name].cross_track_rms_m
        label = name if rms is None else f"{name}: rms {rms * factor:.2f} {unit}"
        axes.plot(
            _column(trail, "time"),
            factor * _column(trail, "cross_track"),
            color=colour,
            lw=0.9,
            alpha=0.85,
            label=label,
        )
    _dress(axes, "Distance of the true position from the reference path", "", unit)
    axes.set_ylim(bottom=0)
    if report.robots:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * 1.3)
        axes.legend(loc="upper center", ncols=2, fontsize=8, frameon=False, labelcolor=INK)


def _dress(axes: Any, title: str, x: str, y: str) -> None:
    axes.set_title(title, loc="left", fontsize=10.5, color=INK, fontweight="bold")
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8.5, colors=INK, length=0)
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _legend(figure: Any, axes: Any) -> None:
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
        bbox_to_anchor=(0.045, 0.008),
        ncols=11,
        fontsize=8.5,
        frameon=False,
        labelcolor=INK,
    )


def _head(figure: Any, report: Report) -> None:
    run = report.run
    reached = sum(each.points_reached for each in report.robots.values())
    points = sum(each.points for each in report.robots.values())
    collisions = sum(each.collisions for each in report.robots.values())
    figure.text(0.055, 0.945, f"{run.fleet}", fontsize=17, fontweight="bold", color=INK)
    verdict, colour = ("all checks hold", "#1a7f37") if report.ok else ("checks missed", "#c1121f")
    figure.text(0.985, 0.945, verdict, fontsize=13, fontweight="bold", color=colour, ha="right")
    facts = (
        f"{reached} of {points} points reached",
        f"{run.sim_seconds:.1f} s simulated",
        f"{run.mode}, {run.real_time_factor:.1f} x real time",
        f"{collisions} collisions",
        f"{run.messages_lost} messages lost",
        f"seed {run.seed}",
        f"trajectory hash {run.trajectory_hash[:12]}",
    )
    figure.text(0.055, 0.908, "   ·   ".join(facts), fontsize=9.5, color=FAINT)
