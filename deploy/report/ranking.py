"""Ranks the robots of a run, worst first, for a table and a picture that show only some of them."""

from __future__ import annotations

from collections import Counter

from deploy.report.record import Report
from models.palette import natural_order
from services.grader.records import ArmFigures, Figures

FEW = 8
"""Maximum number of robots that are all shown; of more, the worst are shown and the others summarized."""


def robot_of_check(name: str, report: Report) -> str | None:
    """Return the robot that a check is about, by its figure or its own service; None for a check of the run."""
    if name.startswith("/"):
        parts = name.rpartition(".")[0].strip("/").split("/")
        spaces = ["/".join(parts[:count]) for count in range(len(parts) - 1, 0, -1)]
        return next((each for each in spaces if each in report.robots), None)
    robot = name.rpartition(".")[0]
    return robot if robot in report.robots else None


def missed_checks(report: Report) -> Counter[str]:
    """Return the number of missed checks of each robot that missed any."""
    found = (robot_of_check(each.name, report) for each in report.checks if not each.ok)
    return Counter(robot for robot in found if robot is not None)


def worst_first(report: Report) -> list[str]:
    """Return all robots, sorted by missed checks, points not reached, collisions, losses, time-outs, then errors."""
    missed = missed_checks(report)
    ordered = sorted(report.robots, key=natural_order)
    return sorted(ordered, key=lambda name: [-each for each in (missed[name], *_faults(report.robots[name]))])


def _faults(each: Figures) -> tuple[float, ...]:
    if isinstance(each, ArmFigures):
        errors = (each.tracking_max_deg, each.step_steady_error_deg)
        return (0, 0, each.messages_lost, 0, *(value or 0.0 for value in errors))
    return (
        each.points - each.points_reached,
        each.collisions or 0,
        each.messages_lost,
        each.commands_timed_out or 0,
        each.cross_track_max_m or 0.0,
        each.odometry_error_max_m or 0.0,
    )
