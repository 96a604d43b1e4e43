"""What the picture of a run shows of its arms: reference and angle, error, effort, and the largest step from near."""

from __future__ import annotations

from typing import Any

import numpy as np

from deploy.report.axes import FAINT, INK, dress
from deploy.report.record import Report
from services.grader.records import ARM_COLUMNS, ArmFigures, StepFigures

NEAR_S = 0.6
"""Of a step, so much is shown from near, and a tenth of it before."""

Trails = dict[str, np.ndarray]


def arms_of(report: Report) -> dict[str, ArmFigures]:
    """The arms of a run."""
    return {name: each for name, each in report.robots.items() if isinstance(each, ArmFigures)}


def draw_arms(axes: tuple[Any, Any, Any, Any], report: Report, arrays: Trails, colour: dict[str, str]) -> None:
    """Step, angle, error and effort, each into its axes; the times of the last three are one."""
    near, angle, error, effort = axes
    error.sharex(angle)
    effort.sharex(angle)
    for name, figures in arms_of(report).items():
        trail, own = arrays[f"{name}.trail"], colour[name]
        time = _column(trail, "time")
        angle.plot(time, _column(trail, "reference"), color=FAINT, lw=2.4, alpha=0.7, label="reference")
        angle.plot(time, _column(trail, "angle"), color=own, lw=1.2, label=name)
        error.plot(time, _column(trail, "error"), color=own, lw=0.9, label=_tracked(name, figures))
        effort.plot(time, _column(trail, "effort"), color=own, lw=0.9, label=_worked(name, figures))
        _limit(error, figures)
        if figures.steps:
            largest = max(figures.steps, key=lambda each: abs(each.to_deg - each.from_deg))
            _step(near, trail, largest, own, name)
    dress(near, "Arm: largest step", "seconds since the step", "deg")
    dress(angle, "Arm: reference and true angle", "", "deg")
    dress(error, "Error, cut off at steps", "", "deg")
    dress(effort, "Effort", "simulation time [s]", "N m")
    near.legend(loc="lower right", fontsize=8, frameon=False, labelcolor=INK)
    for each in (angle, error, effort):
        low, high = each.get_ylim()
        each.set_ylim(low, high + 0.3 * (high - low))
        each.legend(loc="upper left", ncols=2, fontsize=8, frameon=False, labelcolor=INK)


def _column(trail: np.ndarray, name: str) -> np.ndarray:
    column: np.ndarray = trail[:, ARM_COLUMNS.index(name)]
    return column


def _limit(axes: Any, figures: ArmFigures) -> None:
    """A step's error is as large as the step; what is worth seeing is a hundredth of it."""
    worth = [each for each in (figures.tracking_max_deg, figures.step_steady_error_deg) if each is not None]
    if worth:
        reach = max(0.05, 1.6 * max(worth))
        axes.set_ylim(-reach, reach)


def _step(axes: Any, trail: np.ndarray, step: StepFigures, colour: str, name: str) -> None:
    since = _column(trail, "time") - step.at_s
    shown = (since >= -NEAR_S / 10) & (since <= NEAR_S)
    axes.step(since[shown], _column(trail, "reference")[shown], where="post", color=FAINT, lw=2.4, alpha=0.7)
    label = (
        f"{name}: {step.final_deg:.2f} deg, rise {1000 * step.rise_s:.0f} ms,\n"
        f"overshoot {step.overshoot_percent:.2f} %, settled in {1000 * step.settling_s:.0f} ms"
    )
    axes.plot(since[shown], _column(trail, "angle")[shown], color=colour, lw=1.6, marker=".", ms=3, label=label)
    start, way = step.from_deg, step.final_deg - step.from_deg
    for share in (0.1, 0.9):
        axes.axhline(start + share * way, color=INK, lw=0.6, ls=(0, (1, 4)))
    axes.axvline(step.settling_s, color=INK, lw=0.6, ls=(0, (1, 4)))


def _tracked(name: str, figures: ArmFigures) -> str:
    parts = []
    if figures.tracking_rms_deg is not None:
        parts.append(f"{figures.tracking_rms_deg:.3f} deg rms in motion")
    if figures.step_steady_error_deg is not None:
        parts.append(f"{figures.step_steady_error_deg:.3f} deg at rest")
    return f"{name}: " + "\n".join(parts) if parts else name


def _worked(name: str, figures: ArmFigures) -> str:
    return f"{name}: saturated for {figures.saturated_s:.2f} s"
