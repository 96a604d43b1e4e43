"""The report on the terminal: a coloured table, or plain columns when the output is piped."""

from __future__ import annotations

import sys
from typing import TextIO

from deploy.report.checks import is_service_check
from deploy.report.record import Check, Report
from services.grader.records import ArmFigures, CornerFigures, RobotFigures

ROUNDING_SHARE = 1e-6
"""A number below this share of the numbers beside it is shown as zero."""


def format_fixed(value: float, digits: int, sign: bool = False) -> str:
    """A number with ``digits`` decimals; with ``sign``, a plus before a positive one."""
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    return text if float(text) else f"{0:.{digits}f}"


def format_number(value: float, scale: float) -> str:
    """As short as it goes, beside numbers of the size ``scale``."""
    return "0" if abs(value) < ROUNDING_SHARE * abs(scale) or value == 0 else f"{value:.6g}"


_HEADINGS = (
    ("", "", "robot"),
    ("", "", "points"),
    ("", "time", "s"),
    ("", "path", "m"),
    ("track", "rms", "mm"),
    ("track", "max", "mm"),
    ("odom", "max", "mm"),
    ("near", "robot", "m"),
    ("near", "body", "m"),
    ("col-", "li-", "sions"),
    ("", "timed", "out"),
    ("", "msgs", "lost"),
)
"""Of three lines each, so that the table fits 80 columns; track is the cross-track error, near a body the clearance."""


def print_report(report: Report, out: TextIO | None = None) -> None:
    """Print the report to ``out``, standard output if None."""
    out = out or sys.stdout
    rows = [_row(name, figures) for name, figures in wheeled_robots(report).items()]
    if out.isatty():
        _print_coloured(report, rows, out)
    else:
        _print_plain(report, rows, out)


def summary(report: Report) -> str:
    """The run in one line."""
    run = report.run
    return (
        f"{run.fleet}, {run.mode}: {run.sim_seconds:.1f} s simulated in {run.wall_seconds:.1f} s "
        f"({run.real_time_factor:.2f} x real time), ended: {run.ended}, messages lost: {run.messages_lost}, "
        f"restarts: {run.restarts}, seed {run.seed}, version {run.version}\n"
        f"trajectory hash {run.trajectory_hash}"
    )


def missed_lines(report: Report) -> list[str]:
    """One line for each check that does not hold."""
    lines = []
    for each in report.checks:
        if not each.ok:
            lines += [f"missed: {describe_check(each)}", *_cause_lines(each.name, report)]
    return lines


def describe_check(check: Check) -> str:
    """A check in words."""
    sign = {"min": "at least", "max": "at most"}
    value = "not measured" if check.value is None else format_number(check.value, check.bound)
    reason = f": {check.reason}" if check.reason else ""
    return f"{check.name} is {value}, should be {sign[check.kind]} {check.bound:g}{reason}"


def service_check_lines(report: Report) -> list[str]:
    """The passed checks of services; failed ones are listed as missed."""
    return [f"holds: {describe_check(each)}" for each in report.checks if is_service_check(each) and each.ok]


def _cause_lines(check: str, report: Report) -> list[str]:
    """The hint behind a count that is too high."""
    robot, _, figure = check.rpartition(".")
    figures = report.robots.get(robot)
    if figure == "min_clearance_m" and isinstance(figures, RobotFigures) and figures.min_clearance_at_s is not None:
        return [f"  nearest to {figures.min_clearance_to} at {figures.min_clearance_at_s:.2f} s"]
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


def detail_lines(report: Report) -> list[str]:
    """Figures without a column in the table."""
    return [
        *square_lines(report),
        *stop_lines(report),
        *arm_lines(report),
        *service_check_lines(report),
        *report.notes,
        *pending_change_lines(report),
        *observer_loss_lines(report),
    ]


def pending_change_lines(report: Report) -> list[str]:
    """The scheduled changes whose time the run did not reach."""
    left = [f"{each.set} at {each.at_s:g} s" for each in report.changes if each.made is None]
    return [f"not reached before the end: the scheduled changes of {', '.join(left)}"] if left else []


def observer_loss_lines(report: Report) -> list[str]:
    """The losses of observers, which do not count for the run."""
    missed = ", ".join(f"{node} {count}" for node, count in report.run.onlookers_lost.items())
    return [f"messages missed by onlookers, which the run does not depend on: {missed}"] if missed else []


def wheeled_robots(report: Report) -> dict[str, RobotFigures]:
    """The robots that drive."""
    return {name: each for name, each in report.robots.items() if isinstance(each, RobotFigures)}


def arm_lines(report: Report) -> list[str]:
    """For each arm: how it took its largest step and how it followed, and how hard it had to work."""
    lines = []
    for name, each in report.robots.items():
        if not isinstance(each, ArmFigures):
            continue
        for step in each.steps:
            lines.append(
                f"{name}: step from {format_fixed(step.from_deg, 1)} to {format_fixed(step.to_deg, 1)} deg "
                f"at {step.at_s:.2f} s: rise {step.rise_s:.3f} s, overshoot {step.overshoot_percent:.2f} %, settled in "
                f"{step.settling_s:.3f} s at {format_fixed(step.final_deg, 3)} deg, "
                f"error {step.steady_error_deg:.3f} deg"
            )
        if each.tracking_rms_deg is not None:
            most = _number(each.tracking_max_deg, 1, 3)
            lines.append(f"{name}: in motion off by {each.tracking_rms_deg:.3f} deg rms, {most} deg at most")
        lines.append(
            f"{name}: at most {_number(each.effort_max_nm, 1, 1)} N m, saturated for {each.saturated_s:.2f} s "
            f"({100 * each.saturated_share:.1f} %), {each.messages_lost} messages lost"
        )
    return lines


def square_lines(report: Report) -> list[str]:
    """For each robot that drove a closed way: how it met the corners, and how the way closed."""
    lines = []
    for name, each in wheeled_robots(report).items():
        met = [corner for corner in each.corners if corner is not None]
        if met and len(met) <= 8:
            off, turned = _join_corners(met, "true_m", 1000, 1), _join_corners(met, "true_deg", 1, 2, sign=True)
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


def stop_lines(report: Report) -> list[str]:
    """For each robot that stopped after its last command: the stop, against the theory."""
    return [
        f"{name}: left without a command {each.stops} times; from {_number(each.stop_speed, 1, 2)} m/s to rest in "
        f"{_number(each.stop_time_s, 1, 2)} s and {_number(each.stop_distance_m, 1000, 0)} mm"
        + (
            f" (theory {_number(each.stop_time_theory_s, 1, 2)} s, {_number(each.stop_distance_theory_m, 1000, 0)} mm)"
            if each.stop_time_theory_s is not None
            else ""
        )
        for name, each in wheeled_robots(report).items()
        if each.stops
    ]


def verdict(report: Report) -> str:
    """The number of passed checks."""
    held = sum(each.ok for each in report.checks)
    unmeasured = sum(each.value is None for each in report.checks)
    missing = f", {unmeasured} not measured" if unmeasured else ""
    return f"{'passed' if report.ok else 'FAILED'}: {held} of {len(report.checks)} checks hold{missing}"


def _row(name: str, figures: RobotFigures) -> tuple[str, ...]:
    return (
        name,
        f"{figures.points_reached}/{figures.points}",
        _number(figures.time_s, 1, 1),
        _number(figures.path_length_m, 1, 1),
        _number(figures.cross_track_rms_m, 1000, 2),
        _number(figures.cross_track_max_m, 1000, 2),
        _number(figures.odometry_error_max_m, 1000, 1),
        _number(figures.min_distance_m, 1, 2),
        _number(figures.min_clearance_m, 1, 2),
        _count(figures.collisions),
        _count(figures.commands_timed_out),
        str(figures.messages_lost),
    )


def _join_corners(corners: list[CornerFigures], name: str, factor: float, digits: int, sign: bool = False) -> str:
    return " ".join(format_fixed(factor * getattr(corner, name), digits, sign) for corner in corners)


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else format_fixed(value * factor, digits)


def _count(value: int | None) -> str:
    return "-" if value is None else str(value)


def _print_plain(report: Report, rows: list[tuple[str, ...]], out: TextIO) -> None:
    lines = [*zip(*_HEADINGS, strict=True), *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for row in lines if rows or not report.robots else ():
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        out.write("  ".join(cells).rstrip() + "\n")
    out.write("\n".join((*detail_lines(report), summary(report), *missed_lines(report), verdict(report))) + "\n")


def _print_coloured(report: Report, rows: list[tuple[str, ...]], out: TextIO) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=out)
    table = Table(
        box=SIMPLE_HEAD, header_style="bold", border_style="dim", collapse_padding=True, pad_edge=False, show_edge=False
    )
    for heading in _HEADINGS:
        table.add_column("\n".join(heading), justify="left" if heading[-1] == "robot" else "right", no_wrap=True)
    bad = {each.name.partition(".")[0] for each in report.checks if not each.ok}
    for row in rows:
        table.add_row(*row, style="red" if row[0] in bad else None)
    if rows or not report.robots:
        console.print(table)
    for line in detail_lines(report):
        console.print(Text(line))
    console.print(Text(summary(report), style="dim"))
    for line in missed_lines(report):
        console.print(Text(line, style="red"))
    console.print(Text(verdict(report), style="bold green" if report.ok else "bold red"))
