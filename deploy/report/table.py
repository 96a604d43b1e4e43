"""The report on the terminal: a coloured table, or plain columns when the output is piped."""

from __future__ import annotations

import sys
from typing import TextIO

from deploy.report.numbers import fixed, plain
from deploy.report.own_checks import is_own
from deploy.report.record import Check, Report
from services.grader.records import ArmFigures, CornerFigures, RobotFigures

_HEADINGS = (
    ("", "robot"),
    ("", "points"),
    ("time", "s"),
    ("path", "m"),
    ("track", "rms mm"),
    ("track", "max mm"),
    ("odom", "max mm"),
    ("near", "m"),
    ("colli-", "sions"),
    ("timed", "out"),
    ("msgs", "lost"),
)
"""Of two lines each, so that the table fits 80 columns; track is the cross-track error."""


def show(report: Report, out: TextIO | None = None) -> None:
    """Print the report to ``out``, standard output if None."""
    out = out or sys.stdout
    rows = [_row(name, figures) for name, figures in bases(report).items()]
    if out.isatty():
        _coloured(report, rows, out)
    else:
        _plain(report, rows, out)


def summary(report: Report) -> str:
    """The run in one line."""
    run = report.run
    return (
        f"{run.fleet}, {run.mode}: {run.sim_seconds:.1f} s simulated in {run.wall_seconds:.1f} s "
        f"({run.real_time_factor:.2f} x real time), ended: {run.ended}, messages lost: {run.messages_lost}, "
        f"restarts: {run.restarts}, seed {run.seed}, version {run.version}\n"
        f"trajectory hash {run.trajectory_hash}"
    )


def missed(report: Report) -> list[str]:
    """One line for each check that does not hold."""
    lines = []
    for each in report.checks:
        if not each.ok:
            lines += [f"missed: {stated(each)}", *_named(each.name, report)]
    return lines


def stated(check: Check) -> str:
    """A check in words."""
    sign = {"min": "at least", "max": "at most"}
    value = "not measured" if check.value is None else plain(check.value, check.bound)
    reason = f": {check.reason}" if check.reason else ""
    return f"{check.name} is {value}, should be {sign[check.kind]} {check.bound:g}{reason}"


def own(report: Report) -> list[str]:
    """The checks of the services' own that hold; those that do not are told as missed."""
    return [f"holds: {stated(each)}" for each in report.checks if is_own(each) and each.ok]


def _named(check: str, report: Report) -> list[str]:
    """What stands behind a count that is too high."""
    if check == "nodes_absent":
        return [f"  time began without {', '.join(report.run.absent)}"]
    if check != "changes_missed":
        return []
    return [
        f"  the change of {each.set} at {each.at_s:g} s was not made ("
        f"{', '.join(f'{name} = {value}' for name, value in each.values.items())}): {each.reason}"
        for each in report.changes
        if each.made is False
    ]


def told(report: Report) -> list[str]:
    """What the table has no columns for."""
    return [
        *squares(report),
        *stops(report),
        *arms(report),
        *own(report),
        *report.notes,
        *later(report),
        *onlookers(report),
    ]


def later(report: Report) -> list[str]:
    """The scheduled changes whose time the run did not reach."""
    left = [f"{each.set} at {each.at_s:g} s" for each in report.changes if each.made is None]
    return [f"not reached before the end: the scheduled changes of {', '.join(left)}"] if left else []


def onlookers(report: Report) -> list[str]:
    """What those missed who only looked on: it is not the run's loss."""
    missed = ", ".join(f"{node} {count}" for node, count in report.run.onlookers_lost.items())
    return [f"messages missed by onlookers, which the run does not depend on: {missed}"] if missed else []


def bases(report: Report) -> dict[str, RobotFigures]:
    """The robots that drive."""
    return {name: each for name, each in report.robots.items() if isinstance(each, RobotFigures)}


def arms(report: Report) -> list[str]:
    """For each arm: how it took its largest step and how it followed, and how hard it had to work."""
    lines = []
    for name, each in report.robots.items():
        if not isinstance(each, ArmFigures):
            continue
        for step in each.steps:
            lines.append(
                f"{name}: step from {fixed(step.from_deg, 1)} to {fixed(step.to_deg, 1)} deg at {step.at_s:.2f} s: "
                f"rise {step.rise_s:.3f} s, overshoot {step.overshoot_percent:.2f} %, settled in "
                f"{step.settling_s:.3f} s at {fixed(step.final_deg, 3)} deg, error {step.steady_error_deg:.3f} deg"
            )
        if each.tracking_rms_deg is not None:
            most = _number(each.tracking_max_deg, 1, 3)
            lines.append(f"{name}: in motion off by {each.tracking_rms_deg:.3f} deg rms, {most} deg at most")
        lines.append(
            f"{name}: at most {_number(each.effort_max_nm, 1, 1)} N m, saturated for {each.saturated_s:.2f} s "
            f"({100 * each.saturated_share:.1f} %), {each.messages_lost} messages lost"
        )
    return lines


def squares(report: Report) -> list[str]:
    """For each robot that drove a closed way: how it met the corners, and how the way closed."""
    lines = []
    for name, each in bases(report).items():
        met = [corner for corner in each.corners if corner is not None]
        if met and len(met) <= 8:
            off, turned = _each(met, "true_m", 1000, 1), _each(met, "true_deg", 1, 2, sign=True)
            lines.append(f"{name}: off its corners by {off} mm, in heading {turned} deg")
        elif met:
            most, turn = max(corner.true_m for corner in met), max(abs(corner.true_deg) for corner in met)
            lines.append(f"{name}: off its {len(met)} corners by at most {1000 * most:.1f} mm, {turn:.2f} deg")
        if each.closure_m is not None:
            true = f"{_number(each.closure_m, 1000, 1)} mm and {_number(each.closure_heading_deg, 1, 2)} deg"
            odometry = f"{_number(each.closure_odometry_m, 1000, 1)} mm and "
            odometry += f"{_number(each.closure_odometry_heading_deg, 1, 2)} deg"
            lines.append(f"{name}: closed to {true}; by odometry {odometry}")
    return lines


def stops(report: Report) -> list[str]:
    """For each robot whose commander fell silent: how it came to rest, against the theory."""
    return [
        f"{name}: left without a command {each.stops} times; from {_number(each.stop_speed, 1, 2)} m/s to rest in "
        f"{_number(each.stop_time_s, 1, 2)} s and {_number(each.stop_distance_m, 1000, 0)} mm (theory "
        f"{_number(each.stop_time_theory_s, 1, 2)} s, {_number(each.stop_distance_theory_m, 1000, 0)} mm)"
        for name, each in bases(report).items()
        if each.stops
    ]


def verdict(report: Report) -> str:
    """How many checks hold."""
    held = sum(each.ok for each in report.checks)
    return f"{'passed' if report.ok else 'FAILED'}: {held} of {len(report.checks)} checks hold"


def _row(name: str, figures: RobotFigures) -> tuple[str, ...]:
    return (
        name,
        f"{figures.points_reached}/{figures.points}",
        _number(figures.time_s, 1, 1),
        _number(figures.path_length_m, 1, 1),
        _number(figures.cross_track_rms_m, 1000, 2),
        _number(figures.cross_track_max_m, 1000, 2),
        _number(figures.odometry_error_max_m, 1000, 1),
        _number(figures.min_distance_m, 1, 3),
        str(figures.collisions),
        str(figures.commands_timed_out),
        str(figures.messages_lost),
    )


def _each(corners: list[CornerFigures], name: str, factor: float, digits: int, sign: bool = False) -> str:
    return " ".join(fixed(factor * getattr(corner, name), digits, sign) for corner in corners)


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else fixed(value * factor, digits)


def _plain(report: Report, rows: list[tuple[str, ...]], out: TextIO) -> None:
    lines = [*zip(*_HEADINGS, strict=True), *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for row in lines if rows or not report.robots else ():
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        out.write("  ".join(cells).rstrip() + "\n")
    out.write("\n".join((*told(report), summary(report), *missed(report), verdict(report))) + "\n")


def _coloured(report: Report, rows: list[tuple[str, ...]], out: TextIO) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=out)
    table = Table(box=SIMPLE_HEAD, header_style="bold", border_style="dim", collapse_padding=True, pad_edge=False)
    for heading in _HEADINGS:
        table.add_column("\n".join(heading), justify="left" if heading[1] == "robot" else "right", no_wrap=True)
    bad = {each.name.partition(".")[0] for each in report.checks if not each.ok}
    for row in rows:
        table.add_row(*row, style="red" if row[0] in bad else None)
    if rows or not report.robots:
        console.print(table)
    for line in told(report):
        console.print(Text(line))
    console.print(Text(summary(report), style="dim"))
    for line in missed(report):
        console.print(Text(line, style="red"))
    console.print(Text(verdict(report), style="bold green" if report.ok else "bold red"))
