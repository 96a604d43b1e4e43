"""The report on the terminal: a coloured table, or plain columns when the output is piped."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from statistics import median
from typing import TextIO

from deploy.report.checks import is_service_check
from deploy.report.ranking import FEW, missed_checks, robot_of_check, worst_first
from deploy.report.record import MAX_NAMED, Check, Report
from messages.errors import list_names
from services.grader.records import ArmFigures, CornerFigures, Figures, RobotFigures

ROUNDING_SHARE = 1e-6
"""A number smaller than this share of the numbers beside it is shown as zero."""


def format_fixed(value: float, digits: int, sign: bool = False) -> str:
    """Format a number with ``digits`` decimals; with ``sign``, a plus before a positive one."""
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    return text if float(text) else f"{0:.{digits}f}"


def format_number(value: float, scale: float) -> str:
    """Format a number as briefly as possible, among numbers of the magnitude ``scale``."""
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
"""Three lines each, so that the table fits 80 columns; track is the cross-track error, near a body the clearance."""


SHOWN, DETAILED = 10, 3
"""Of more than FEW robots, the number with a row in the table, and the number with detail lines below it."""


def print_report(report: Report, out: TextIO | None = None, every: bool = False) -> None:
    """Print the report to ``out``, standard output if None.

    Of more than FEW robots, the worst are shown and the others summarized; ``every`` shows all, the worst first.
    """
    out = out or sys.stdout
    many = len(report.robots) > FEW
    names = worst_first(report) if many else list(report.robots)
    wheeled = wheeled_robots(report)
    driving = [name for name in names if name in wheeled]
    shown = driving[:SHOWN] if many and not every else driving
    rows = [_row(name, wheeled[name]) for name in shown]
    if many and driving:
        rows.append(_median_row([wheeled[name] for name in driving]))
    lines = [*_rest_lines(driving[len(shown) :], report), *detail_lines(report, every), *note_lines(report)]
    missed = missed_lines(report, every)
    if out.isatty():
        _print_coloured(report, rows, lines, missed, out)
    else:
        _print_plain(report, rows, lines, missed, out)


def summary(report: Report) -> str:
    """Summarize the run in one line."""
    run = report.run
    engine = f"engine {run.engine}, " if run.engine else ""
    topology = f"topology {run.topology}, " if run.topology else ""
    return (
        f"{run.fleet}, {run.mode}: {run.sim_seconds:.1f} s simulated in {run.wall_seconds:.1f} s "
        f"({run.real_time_factor:.2f} x real time), ended: {run.ended}, messages lost: {run.messages_lost}, "
        f"restarts: {run.restarts}, {engine}{topology}seed {run.seed}, version {run.version}\n"
        f"trajectory hash {run.trajectory_hash}"
    )


def missed_lines(report: Report, every: bool = False) -> list[str]:
    """Return the missed checks: a line for each, or one for a kind that many robots miss."""
    lines = []
    for group in _groups((each for each in report.checks if not each.ok), report, every):
        if len(group) > 1:
            lines.append(f"missed by {_describe_group(group, report)}")
        else:
            lines += [f"missed: {describe_check(group[0])}", *_cause_lines(group[0].name, report)]
    return lines


def describe_check(check: Check) -> str:
    """Describe a check in words."""
    sign = {"min": "at least", "max": "at most"}
    value = "not measured" if check.value is None else format_number(check.value, check.bound)
    reason = f": {check.reason}" if check.reason else ""
    return f"{check.name} is {value}, should be {sign[check.kind]} {check.bound:g}{reason}"


def service_check_lines(report: Report, every: bool = False) -> list[str]:
    """Return the passed checks of services; failed ones are listed as missed."""
    held = (each for each in report.checks if is_service_check(each) and each.ok)
    return [
        f"holds for {_describe_group(group, report)}" if len(group) > 1 else f"holds: {describe_check(group[0])}"
        for group in _groups(held, report, every)
    ]


def _groups(checks: Iterable[Check], report: Report, every: bool) -> Iterator[list[Check]]:
    """Group checks: those of a kind that more than DETAILED of more than FEW robots have together, others alone."""
    if every or len(report.robots) <= FEW:
        yield from ([each] for each in checks)
        return
    kinds: dict[tuple[str, str], list[Check]] = {}
    for each in checks:
        robot = robot_of_check(each.name, report)
        kinds.setdefault((_kind(each.name, robot), each.kind), []).append(each)
    for group in kinds.values():
        if len(group) > DETAILED:
            yield sorted(group, key=_goodness)
        else:
            yield from ([each] for each in group)


def _goodness(check: Check) -> float:
    """Sort key of checks of a kind: worst first, those not measured before all others."""
    if check.value is None:
        return -math.inf
    return check.value - check.bound if check.kind == "min" else check.bound - check.value


def _kind(check: str, robot: str | None) -> str:
    """Return the name of a check without its robot."""
    return check.removeprefix("/").removeprefix(robot or "").lstrip("./")


def _describe_group(group: list[Check], report: Report) -> str:
    """Describe how many robots missed which figure, its bounds, and the values of the worst."""
    first, robots = group[0], [robot_of_check(each.name, report) for each in group]
    bounds = sorted({each.bound for each in group})
    bound = f"{bounds[0]:g}" if len(bounds) == 1 else f"{bounds[0]:g} to {bounds[-1]:g}"
    values = [
        f"{robot} {'not measured' if each.value is None else format_number(each.value, each.bound)}"
        for robot, each in zip(robots, group, strict=True)
    ]
    limit = "at least" if first.kind == "min" else "at most"
    return (
        f"{len(set(robots))} of {len(report.robots)} robots: {_kind(first.name, robots[0])}, "
        f"should be {limit} {bound}: {list_names(values, DETAILED)}"
    )


def _cause_lines(check: str, report: Report) -> list[str]:
    """Return the hint about a count that is too high."""
    robot, _, figure = check.rpartition(".")
    figures = report.robots.get(robot)
    if figure == "min_clearance_m" and isinstance(figures, RobotFigures) and figures.min_clearance_at_s is not None:
        return [f"  nearest to {figures.min_clearance_to} at {figures.min_clearance_at_s:.2f} s"]
    if check == "nodes_absent":
        return [f"  time began without {list_names(report.run.absent, MAX_NAMED)}"]
    if check != "changes_missed":
        return []
    return [
        f"  the change of {each.set} at {each.at_s:g} s was not made ("
        f"{', '.join(f'{name} = {value}' for name, value in each.values.items())}): {each.reason}"
        for each in report.changes
        if each.made is False
    ]


def detail_lines(report: Report, every: bool = False) -> list[str]:
    """Return figures that are not in the table's columns; of more than FEW robots, for the worst DETAILED unless
    ``every``.
    """
    robots, lines = dict(report.robots), list[str]()
    if len(robots) > FEW and not every:
        names = worst_first(report)
        for kind in (RobotFigures, ArmFigures):
            for name in [each for each in names if isinstance(report.robots[each], kind)][DETAILED:]:
                del robots[name]
    for lines_of in (square_lines, stop_lines, arm_lines):
        lines += lines_of(robots)
        if left := sum(bool(lines_of({name: each})) for name, each in report.robots.items() if name not in robots):
            lines.append(f"  and {left} more")
    return [*lines, *service_check_lines(report, every)]


def note_lines(report: Report) -> list[str]:
    """Return the notes of the report."""
    return [*report.notes, *pending_change_lines(report), *observer_loss_lines(report)]


def pending_change_lines(report: Report) -> list[str]:
    """Return the scheduled changes whose time the run did not reach."""
    left = [f"{each.set} at {each.at_s:g} s" for each in report.changes if each.made is None]
    return [f"not reached before the end: the scheduled changes of {list_names(left, MAX_NAMED)}"] if left else []


def observer_loss_lines(report: Report) -> list[str]:
    """Return the losses of observers, which do not count for the run."""
    missed = list_names([f"{node} {count}" for node, count in report.run.onlookers_lost.items()], MAX_NAMED)
    return [f"messages missed by observers, on which the run does not depend: {missed}"] if missed else []


def wheeled_robots(report: Report) -> dict[str, RobotFigures]:
    """Return the driving robots."""
    return _driving(report.robots)


def _driving(robots: Mapping[str, Figures]) -> dict[str, RobotFigures]:
    return {name: each for name, each in robots.items() if isinstance(each, RobotFigures)}


def arm_lines(robots: Mapping[str, Figures]) -> list[str]:
    """Describe for each arm its steps, tracking error, effort and saturation."""
    lines = []
    for name, each in robots.items():
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
            lines.append(f"{name}: error in motion {each.tracking_rms_deg:.3f} deg rms, {most} deg at most")
        lines.append(
            f"{name}: at most {_number(each.effort_max_nm, 1, 1)} N m, saturated for {each.saturated_s:.2f} s "
            f"({100 * each.saturated_share:.1f} %), {each.messages_lost} messages lost"
        )
    return lines


def square_lines(robots: Mapping[str, Figures]) -> list[str]:
    """Describe for each robot that drove a closed path its errors at the corners, and the closure."""
    lines = []
    for name, each in _driving(robots).items():
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


def stop_lines(robots: Mapping[str, Figures]) -> list[str]:
    """Describe for each robot that stopped after its last command the stop, compared with theory."""
    return [
        f"{name}: left without a command {each.stops} times; from {_number(each.stop_speed, 1, 2)} m/s to rest in "
        f"{_number(each.stop_time_s, 1, 2)} s and {_number(each.stop_distance_m, 1000, 0)} mm"
        + (
            f" (theory {_number(each.stop_time_theory_s, 1, 2)} s, {_number(each.stop_distance_theory_m, 1000, 0)} mm)"
            if each.stop_time_theory_s is not None
            else ""
        )
        for name, each in _driving(robots).items()
        if each.stops
    ]


def verdict(report: Report) -> str:
    """Return the number of passed checks."""
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


def _median_row(robots: list[RobotFigures]) -> tuple[str, ...]:
    """Return the row of medians of the measured values, and sums of the counts and points."""

    def middle(name: str, factor: float, digits: int) -> str:
        values = [value for each in robots if (value := getattr(each, name)) is not None]
        return _number(median(values) if values else None, factor, digits)

    def total(name: str) -> str:
        values = [value for each in robots if (value := getattr(each, name)) is not None]
        return _count(sum(values) if values else None)

    return (
        f"{MEDIAN_ROW} {len(robots)}",
        f"{total('points_reached')}/{total('points')}",
        middle("time_s", 1, 1),
        middle("path_length_m", 1, 1),
        middle("cross_track_rms_m", 1000, 2),
        middle("cross_track_max_m", 1000, 2),
        middle("odometry_error_max_m", 1000, 1),
        middle("min_distance_m", 1, 2),
        middle("min_clearance_m", 1, 2),
        total("collisions"),
        total("commands_timed_out"),
        total("messages_lost"),
    )


MEDIAN_ROW = "all"
"""First part of the name of the row about all robots."""


def _rest_lines(names: list[str], report: Report) -> list[str]:
    """Return a line about the robots without a row, with the command that shows them all."""
    if not names:
        return []
    missed = missed_checks(report)
    bad = sum(name in missed for name in names)
    well = f"{len(names) - bad} more hold all their checks" if len(names) > bad else ""
    ill = f"{bad} more miss checks" if bad else ""
    return [
        f"{MEDIAN_ROW}: medians, and sums of points and counts",
        f"{', '.join(filter(None, (ill, well)))}: ./elea report --all shows each",
    ]


def _join_corners(corners: list[CornerFigures], name: str, factor: float, digits: int, sign: bool = False) -> str:
    return " ".join(format_fixed(factor * getattr(corner, name), digits, sign) for corner in corners)


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else format_fixed(value * factor, digits)


def _count(value: int | None) -> str:
    return "-" if value is None else str(value)


def _print_plain(report: Report, rows: list[tuple[str, ...]], lines: list[str], missed: list[str], out: TextIO) -> None:
    cells = [*zip(*_HEADINGS, strict=True), *rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells if rows or not report.robots else ():
        padded = [
            row[0].ljust(widths[0]),
            *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)),
        ]
        out.write("  ".join(padded).rstrip() + "\n")
    out.write("\n".join((*lines, summary(report), *missed, verdict(report))) + "\n")


def _print_coloured(
    report: Report, rows: list[tuple[str, ...]], lines: list[str], missed: list[str], out: TextIO
) -> None:
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
    bad = missed_checks(report)
    for row in rows:
        table.add_row(*row, style="red" if row[0] in bad else "bold" if row[0] not in report.robots else None)
    if rows or not report.robots:
        console.print(table)
    for line in lines:
        console.print(Text(line))
    console.print(Text(summary(report), style="dim"))
    for line in missed:
        console.print(Text(line, style="red"))
    console.print(Text(verdict(report), style="bold green" if report.ok else "bold red"))
