"""The picture of a run: paths from above, cross-track error and speed over time, and the motion of its arms."""

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

from deploy.report.axes import (
    FAINT,
    INK,
    MIN_DISTANCE_SPAN,
    MIN_SPEED_SPAN,
    LineStyle,
    Trails,
    base_column,
    coloured_line_styles,
    draw_world,
    ensure_ground,
    ensure_span,
    shorten_name,
    style_axes,
)
from deploy.report.picture_many import STRIP_HEIGHT, draw_many
from deploy.report.ranking import FEW, worst_first
from deploy.report.record import Report
from deploy.report.table import format_fixed, square_lines, wheeled_robots
from services.grader.records import ARM_TRAIL_COLUMNS, ArmFigures, RobotFigures, StepFigures

STEP_CLOSE_UP_S = 0.6
"""Time [s] of a step shown in detail; a tenth of it is before the step."""

MIN_SPANS = (0.1, 0.01, 0.1)
"""Minimum spans of the axes of angle [deg], error [deg] and effort [N m]."""


def measured_arms(report: Report, arrays: Trails) -> dict[str, ArmFigures]:
    """Return the arms of a run that have data to show; of more than FEW the worst."""
    found = {
        name: each
        for name, each in report.robots.items()
        if isinstance(each, ArmFigures) and len(arrays[f"{name}.trail"])
    }
    if len(found) <= FEW:
        return found
    shown = [name for name in worst_first(report) if name in found][:FEW]
    return {name: found[name] for name in shown}


def draw_arms(
    step_axes: Any,
    over_time: tuple[Any, Any, Any],
    arms: dict[str, ArmFigures],
    arrays: Trails,
    line: dict[str, LineStyle],
) -> None:
    """Draw the largest steps into ``step_axes``, unless it is None, and angle, error and effort over time into the
    other axes.
    """
    angle, error, effort = over_time
    error.sharex(angle)
    effort.sharex(angle)
    for name, figures in arms.items():
        trail, drawn, label = arrays[f"{name}.trail"], line[name].plot_options, shorten_name(name)
        time = _arm_column(trail, "time")
        reference, stepwise = _arm_column(trail, "reference"), {"drawstyle": "steps-post"}
        angle.plot(
            time, reference, color=FAINT, lw=3.4, alpha=0.6, label=_arm_label("reference", label, arms), **stepwise
        )
        angle.plot(time, _arm_column(trail, "angle"), **drawn, label=label)
        error.plot(time, _arm_column(trail, "error"), **drawn, label=_tracking_label(label, figures))
        effort.plot(time, _arm_column(trail, "effort"), **drawn, **stepwise, label=_effort_label(label, figures))
        if step_axes is not None and figures.steps:
            largest = max(figures.steps, key=lambda each: abs(each.to_deg - each.from_deg))
            _draw_step(step_axes, trail, largest, drawn, label)
    _limit_error_axis(error, arms)
    if step_axes is not None:
        style_axes(step_axes, "Arm: largest step", "time since the step [s]", "angle [deg]")
        step_axes.legend(loc="lower right", fontsize=8, frameon=False, labelcolor=INK)
    style_axes(angle, "Arm: reference and true angle", "simulation time [s]", "angle [deg]")
    style_axes(error, "Error, cut off at steps", "simulation time [s]", "error [deg]")
    style_axes(effort, "Effort", "simulation time [s]", "effort [N m]")
    for each, least in zip(over_time, MIN_SPANS, strict=True):
        ensure_span(each, least)
        low, high = each.get_ylim()
        each.set_ylim(low, high + 0.3 * (high - low))
        each.legend(loc="upper left", ncols=2, fontsize=8, frameon=False, labelcolor=INK)


def _arm_label(what: str, name: str, arms: dict[str, ArmFigures]) -> str:
    return what if len(arms) == 1 else f"{name}: {what}"


def _arm_column(trail: np.ndarray, name: str) -> np.ndarray:
    column: np.ndarray = trail[:, ARM_TRAIL_COLUMNS.index(name)]
    return column


def _limit_error_axis(axes: Any, arms: dict[str, ArmFigures]) -> None:
    """Limit the error axis: a step's initial error is as large as the step, and what matters is a hundredth of that."""
    figures = (each for arm in arms.values() for each in (arm.tracking_max_deg, arm.step_steady_error_deg))
    if errors := [each for each in figures if each is not None]:
        reach = max(0.05, 1.6 * max(errors))
        axes.set_ylim(-reach, reach)


def _draw_step(axes: Any, trail: np.ndarray, step: StepFigures, drawn: dict[str, Any], name: str) -> None:
    since = _arm_column(trail, "time") - step.at_s
    shown = (since >= -STEP_CLOSE_UP_S / 10) & (since <= STEP_CLOSE_UP_S)
    axes.step(since[shown], _arm_column(trail, "reference")[shown], where="post", color=FAINT, lw=2.4, alpha=0.7)
    label = (
        f"{name}: {format_fixed(step.final_deg, 2)} deg, rise {1000 * step.rise_s:.0f} ms,\n"
        f"overshoot {step.overshoot_percent:.2f} %, settled in {1000 * step.settling_s:.0f} ms"
    )
    axes.plot(since[shown], _arm_column(trail, "angle")[shown], **drawn, marker=".", ms=3, label=label)
    start, change = step.from_deg, step.final_deg - step.from_deg
    for share in (0.1, 0.9):
        axes.axhline(start + share * change, color=INK, lw=0.6, ls=(0, (1, 4)))
    axes.axvline(step.settling_s, color=INK, lw=0.6, ls=(0, (1, 4)))


def _tracking_label(name: str, figures: ArmFigures) -> str:
    parts = []
    if figures.tracking_rms_deg is not None:
        parts.append(f"{figures.tracking_rms_deg:.3f} deg rms in motion")
    if figures.step_steady_error_deg is not None:
        parts.append(f"{figures.step_steady_error_deg:.3f} deg at rest")
    return f"{name}: " + "\n".join(parts) if parts else name


def _effort_label(name: str, figures: ArmFigures) -> str:
    return f"{name}: saturated for {figures.saturated_s:.2f} s"


WIDTH, HEIGHT, ARM_HEIGHT, EMPTY_HEIGHT, DPI = 13.5, 7.6, 3.4, 1.6, 130
"""Sizes [inches]; a picture of driving robots and arms has both heights."""

PALETTE_SIZE = 256
"""Number of colours in the file, which looks the same with a third of the bytes."""


def render_png(report: Report, trajectories: Path) -> bytes:
    """Return the picture as PNG; ``trajectories`` is the grader's file. Plots without data are left out."""
    canvas: Any = draw_figure(report, trajectories).canvas
    out = BytesIO()
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    # Not with optimize=True: that takes seven times as long for a twentieth fewer bytes.
    image.quantize(PALETTE_SIZE, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(out, "PNG")
    return out.getvalue()


def draw_figure(report: Report, trajectories: Path) -> Figure:
    """Return the picture as a Matplotlib figure."""
    with np.load(trajectories) as stored:
        arrays: Trails = {name: stored[name] for name in stored.files}
    driving = {name: each for name, each in wheeled_robots(report).items() if len(arrays[f"{name}.trail"])}
    arms = measured_arms(report, arrays)
    many = len(driving) > FEW
    height = (HEIGHT if driving or not arms else 0.0) + (ARM_HEIGHT if driving and arms else HEIGHT if arms else 0.0)
    height = height + (STRIP_HEIGHT if many else 0.0) if driving or arms else EMPTY_HEIGHT
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    if driving:
        bottom = ((ARM_HEIGHT if arms else 0.0) + (0.5 if many else 0.874)) / height
        (draw_many if many else _draw_bases)(figure, bottom, report, driving, arrays)
    if arms:
        step_axes, *rest = _arm_axes(figure, bool(driving), any(each.steps for each in arms.values()))
        draw_arms(step_axes, (rest[0], rest[1], rest[2]), arms, arrays, coloured_line_styles(arms, report.robots))
    if not driving and not arms:
        figure.text(0.055, 0.2, "Nothing was measured: no robot was seen.", fontsize=11, color=INK)
    _draw_header(figure, report)
    return figure


def _draw_bases(figure: Any, bottom: float, report: Report, driving: dict[str, RobotFigures], arrays: Trails) -> None:
    """Draw the driving robots above ``bottom``, a share of the height, with the legend below."""
    top, line = 1 - 1.102 / figure.get_figheight(), coloured_line_styles(driving, report.robots)
    tracked = [name for name in driving if not np.isnan(base_column(arrays[f"{name}.trail"], "cross_track")).all()]
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
        _draw_path(above, arrays[f"{name}.path"], trail, line[name].colour, shorten_name(name))
        along.plot(
            base_column(trail, "time"), base_column(trail, "speed"), **line[name].plot_options, label=shorten_name(name)
        )
    if tracked:
        across = figure.add_subplot(grid[0, 1], sharex=along)
        _draw_cross_track(across, {name: driving[name] for name in tracked}, arrays, line)
    ensure_ground(above)
    draw_world(above, arrays)
    style_axes(above, "Paths seen from above", "x [m]", "y [m]")
    above.set_aspect("equal", adjustable="datalim")
    style_axes(along, "True speed", "simulation time [s]", "speed [m/s]")
    _add_line_legend(along, MIN_SPEED_SPAN)
    _draw_square_notes(above, report)
    _add_path_legend(figure, above, bottom - 0.813 / figure.get_figheight(), bool(tracked))


def _arm_axes(figure: Any, beside: bool, steps: bool) -> list[Any]:
    """Return the axes of step, angle, error and effort: the whole picture, or a row below the driving robots. Without
    ``steps`` the first is None.
    """
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


def _draw_path(axes: Any, path: np.ndarray, trail: np.ndarray, colour: str, name: str) -> None:
    axes.plot(path[:, 0], path[:, 1], color=colour, lw=5, alpha=0.16, solid_joinstyle="round", zorder=1)
    axes.plot(base_column(trail, "x"), base_column(trail, "y"), color=colour, lw=1.3, label=name, zorder=3)
    # Odometry may arrive less often than ground truth; between its samples the trail has none.
    seen = trail[~np.isnan(base_column(trail, "odom_x"))]
    axes.plot(
        base_column(seen, "odom_x"), base_column(seen, "odom_y"), color=INK, lw=0.8, ls=(0, (1, 4)), alpha=0.8, zorder=4
    )
    axes.plot(path[1:, 0], path[1:, 1], ls="", marker="o", ms=5, mfc="white", mec=colour, mew=1.3, zorder=5)
    start = path[:1] if len(path) else np.array([[base_column(trail, "x")[0], base_column(trail, "y")[0]]])
    axes.plot(start[:, 0], start[:, 1], ls="", marker="s", ms=6, color=colour, zorder=6)


def _draw_square_notes(axes: Any, report: Report) -> None:
    """Draw the closure of each square, or why it did not close, below the title of the paths."""
    lines = [line for line in square_lines(report.robots) if "closed" in line]
    lines += [line for note in report.notes for line in wrap(note, 78)]
    if lines:
        axes.text(
            0.01,
            0.985,
            "\n".join(lines),
            transform=axes.transAxes,
            va="top",
            fontsize=7.5,
            color=INK,
            zorder=7,
            bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 2},
        )
        # An invisible point extends the limits; setting them by hand would cut the paths, since the scales are equal.
        reach = axes.dataLim
        axes.plot([reach.x0], [reach.y1 + reach.height * (0.05 + 0.03 * len(lines))], ls="")


def _draw_cross_track(axes: Any, robots: dict[str, RobotFigures], arrays: Trails, line: dict[str, LineStyle]) -> None:
    largest = max((each.cross_track_max_m or 0.0 for each in robots.values()), default=0.0)
    factor, unit = (1000.0, "mm") if largest < 0.1 else (1.0, "m")
    for name, figures in robots.items():
        trail, rms = arrays[f"{name}.trail"], figures.cross_track_rms_m
        label = shorten_name(name) if rms is None else f"{shorten_name(name)}: rms {rms * factor:.2f} {unit}"
        axes.plot(
            base_column(trail, "time"),
            factor * base_column(trail, "cross_track"),
            **line[name].plot_options,
            label=label,
        )
    style_axes(
        axes, "Distance of the true position from the reference path", "simulation time [s]", f"distance [{unit}]"
    )
    _add_line_legend(axes, MIN_DISTANCE_SPAN * factor)


def _add_line_legend(axes: Any, least: float) -> None:
    """Add a legend above the lines, extending the axis from 0 to make space for it and reach at least ``least``."""
    axes.set_ylim(0, 1.3 * max(least, axes.get_ylim()[1]))
    axes.legend(loc="upper center", ncols=3, fontsize=8, frameon=False, labelcolor=INK, handlelength=3)


def _add_path_legend(figure: Any, axes: Any, bottom: float, planned: bool) -> None:
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


def _draw_header(figure: Any, report: Report) -> None:
    run, driving = report.run, wheeled_robots(report).values()
    name_at, facts_at = (1 - inches / figure.get_figheight() for inches in (0.418, 0.699))
    figure.text(0.055, name_at, f"{run.fleet}", fontsize=17, fontweight="bold", color=INK)
    verdict, colour = ("all checks hold", "#1a7f37") if report.ok else ("checks missed", "#c1121f")
    figure.text(0.985, name_at, verdict, fontsize=13, fontweight="bold", color=colour, ha="right")
    reached, points = sum(each.points_reached for each in driving), sum(each.points for each in driving)
    clear = [each.min_clearance_m for each in driving if each.min_clearance_m is not None]
    facts = (
        *((f"{reached} of {points} points reached",) if points else ()),
        f"{run.sim_seconds:.1f} s simulated",
        f"{run.mode}, {run.real_time_factor:.1f} x real time",
        *((f"{sum(each.collisions or 0 for each in driving)} collisions",) if driving else ()),
        *((f"least clearance {min(clear):.2f} m",) if clear else ()),
        f"{run.messages_lost} messages lost",
        f"seed {run.seed}",
        f"trajectory hash {run.trajectory_hash[:12]}",
    )
    figure.text(0.055, facts_at, "   ·   ".join(facts), fontsize=9.5, color=FAINT)
