"""What the picture of a run shows of its arms: reference and angle, error, effort, and the largest step from near."""

from __future__ import annotations

from typing import Any

import numpy as np

from deploy.report.axes import FAINT, INK, Line, dress, shortened, widen
from deploy.report.numbers import fixed
from deploy.report.record import Report
from services.grader.records import ARM_COLUMNS, ArmFigures, StepFigures

NEAR_S = 0.6
"""Of a step, so much is shown from near, and a tenth of it before."""

LEAST = (0.1, 0.01, 0.1)
"""What the axes of angle [deg], error [deg] and effort [N m] span at least."""

Trails = dict[str, np.ndarray]


def shown_arms(report: Report, arrays: Trails) -> dict[str, ArmFigures]:
    """The arms of a run of which there is something to show."""
    return {
        name: each
        for name, each in report.robots.items()
        if isinstance(each, ArmFigures) and len(arrays[f"{name}.trail"])
    }


def draw_arms(
    near: Any, over_time: tuple[Any, Any, Any], arms: dict[str, ArmFigures], arrays: Trails, line: dict[str, Line]
) -> None:
    """Draw the largest steps into ``near``, None without any, and angle, error and effort into the axes of one time."""
    angle, error, effort = over_time
    error.sharex(angle)
    effort.sharex(angle)
    for name, figures in arms.items():
        trail, drawn, label = arrays[f"{name}.trail"], line[name].drawn, shortened(name)
        time = _column(trail, "time")
        wanted, held = _column(trail, "reference"), {"drawstyle": "steps-post"}
        angle.plot(time, wanted, color=FAINT, lw=3.4, alpha=0.6, label=_of("reference", label, arms), **held)
        angle.plot(time, _column(trail, "angle"), **drawn, label=label)
        error.plot(time, _column(trail, "error"), **drawn, label=_tracked(label, figures))
        effort.plot(time, _column(trail, "effort"), **drawn, **held, label=_worked(label, figures))
        if near is not None and figures.steps:
            largest = max(figures.steps, key=lambda each: abs(each.to_deg - each.from_deg))
            _step(near, trail, largest, drawn, label)
    _limit(error, arms)
    if near is not None:
        dress(near, "Arm: largest step", "time since the step [s]", "angle [deg]")
        near.legend(loc="lower right", fontsize=8, frameon=False, labelcolor=INK)
    dress(angle, "Arm: reference and true angle", "simulation time [s]", "angle [deg]")
    dress(error, "Error, cut off at steps", "simulation time [s]", "error [deg]")
    dress(effort, "Effort", "simulation time [s]", "effort [N m]")
    for each, least in zip(over_time, LEAST, strict=True):
        widen(each, least)
        low, high = each.get_ylim()
        each.set_ylim(low, high + 0.3 * (high - low))
        each.legend(loc="upper left", ncols=2, fontsize=8, frameon=False, labelcolor=INK)


def _of(what: str, name: str, arms: dict[str, ArmFigures]) -> str:
    return what if len(arms) == 1 else f"{name}: {what}"


def _column(trail: np.ndarray, name: str) -> np.ndarray:
    column: np.ndarray = trail[:, ARM_COLUMNS.index(name)]
    return column


def _limit(axes: Any, arms: dict[str, ArmFigures]) -> None:
    """A step's error is as large as the step; what is worth seeing is a hundredth of it."""
    figures = (each for arm in arms.values() for each in (arm.tracking_max_deg, arm.step_steady_error_deg))
    if worth := [each for each in figures if each is not None]:
        reach = max(0.05, 1.6 * max(worth))
        axes.set_ylim(-reach, reach)


def _step(axes: Any, trail: np.ndarray, step: StepFigures, drawn: dict[str, Any], name: str) -> None:
    since = _column(trail, "time") - step.at_s
    shown = (since >= -NEAR_S / 10) & (since <= NEAR_S)
    axes.step(since[shown], _column(trail, "reference")[shown], where="post", color=FAINT, lw=2.4, alpha=0.7)
    label = (
        f"{name}: {fixed(step.final_deg, 2)} deg, rise {1000 * step.rise_s:.0f} ms,\n"
        f"overshoot {step.overshoot_percent:.2f} %, settled in {1000 * step.settling_s:.0f} ms"
    )
    axes.plot(since[shown], _column(trail, "angle")[shown], **drawn, marker=".", ms=3, label=label)
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
