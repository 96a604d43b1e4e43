"""Compares two runs: their trajectories, and their bags if both have one."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import msgspec
import numpy as np

from deploy.report.load import read_trails
from deploy.report.record import read_report
from deploy.report.write import read_measurements
from services.bag.compare import PLACE_PARAMETERS, BagComparison, compare_bags
from services.bag.info import lost_messages
from services.bag.reader import Bag, open_bag
from services.grader.records import (
    ARM_TRAIL_COLUMNS,
    MEASUREMENTS_FILE,
    ROBOT_TRAIL_COLUMNS,
    TRAJECTORIES_FILE,
    ArmFigures,
    Measurements,
)
from services.runtime.errors import BadInput
from services.runtime.step import STEP_NS


class TrajectoryDifference(msgspec.Struct, frozen=True, kw_only=True):
    """The first sample at which two trajectories differ.

    ``column`` is one of ROBOT_TRAIL_COLUMNS or ARM_TRAIL_COLUMNS, in the units of the trajectories file. An empty
    ``column`` means that one run has no sample there: that side is None.
    """

    robot: str
    time_s: float
    column: str
    left: float | None
    right: float | None


class RunComparison(msgspec.Struct, frozen=True, kw_only=True):
    """The result of comparing two runs.

    ``same`` is true if everything that both runs have is equal. ``hashes`` are the trajectory hashes, None for a bag
    without a run. ``notes`` list differences of the reports, and what could not be compared.
    """

    same: bool
    left: str
    right: str
    hashes: tuple[str, str] | None = None
    trajectory: TrajectoryDifference | None = None
    messages: BagComparison | None = None
    notes: tuple[str, ...] = ()


def tick_of(time_s: float) -> int:
    """Return the physics step at a simulation time [s]."""
    return round(time_s * 1e9) // STEP_NS


def compare_runs(left: Path, right: Path, bag_folder: str = "bag") -> RunComparison:
    """Compare two runs, or two bags.

    Args:
        left: The folder of a run, or a bag.
        right: The other one.
        bag_folder: Name of the bag in the folder of a run.

    Returns:
        The first difference of the trajectories, and of the messages if both have a bag.

    Raises:
        BadInput: One of them is neither a graded run nor a bag, or cannot be read.
    """
    sides = (left, right)
    for each in sides:
        if not each.exists():
            raise BadInput(f"there is no run {each}")
    graded = [(each / MEASUREMENTS_FILE).is_file() for each in sides]
    if not any(graded):
        bags = [open_bag(each / bag_folder if (each / bag_folder).is_dir() else each) for each in sides]
        found = _compare_messages(bags)
        same = found.difference is None
        notes = _bag_notes(bags, not same)
        return RunComparison(same=same, left=str(left), right=str(right), messages=found, notes=tuple(notes))
    if not all(graded):
        ungraded = sides[graded.index(False)]
        raise BadInput(
            f"{ungraded} has no {MEASUREMENTS_FILE}: expected the folder of a run that has ended, like the other"
        )
    one, other = (read_measurements(each) for each in sides)
    trajectory = _first_trajectory_difference(left, one, right, other)
    recorded = [(each / bag_folder).is_dir() for each in sides]
    messages, notes = None, _report_notes(left, right)
    if all(recorded):
        bags = [open_bag(each / bag_folder) for each in sides]
        messages = _compare_messages(bags, round(min(one.sim_seconds, other.sim_seconds) * 1e9))
        notes += _bag_notes(bags, messages.difference is not None)
    elif any(recorded):
        notes.append("only one of the runs has a bag: record both with --record to compare their messages")
    hashes = (one.trajectory_hash, other.trajectory_hash)
    if hashes[0] != hashes[1] and trajectory is None:
        notes.append(
            f"the hashes differ, but {TRAJECTORIES_FILE} does not: it has no height, roll and pitch, and not every "
            "sample of a long run"
        )
    same = hashes[0] == hashes[1] and trajectory is None and (messages is None or messages.difference is None)
    return RunComparison(
        same=same,
        left=str(left),
        right=str(right),
        hashes=hashes,
        trajectory=trajectory,
        messages=messages,
        notes=tuple(notes),
    )


def _compare_messages(bags: list[Bag], end: int | None = None) -> BagComparison:
    """Compare two bags; raises BadInput if there is nothing to compare."""
    found = compare_bags(bags[0], bags[1], end)
    if not found.messages and found.difference is None:
        raise BadInput(f"{bags[0].path} and {bags[1].path} hold no messages to compare")
    return found


def _bag_notes(bags: list[Bag], differ: bool) -> list[str]:
    """Return the unreadable parts of the bags, and for differing bags the messages that their recorders lost."""
    if differ:
        for bag in bags:
            deque(bag.entries(), maxlen=0)  # losses are recorded at a file's end, which the comparison did not reach
    notes = [problem for bag in bags for problem in bag.problems]
    for bag in bags if differ else ():
        if lost := lost_messages(bag):
            notes.append(
                f"{bag.path} lacks {sum(lost.values())} messages that were lost on their way to the recorder, "
                f"of {', '.join(list(lost)[:5])}{', …' if len(lost) > 5 else ''}: record the run again"
            )
    return notes


def _first_trajectory_difference(
    left: Path, one: Measurements, right: Path, other: Measurements
) -> TrajectoryDifference | None:
    """Return the earliest difference over all robots; of several at the same time, the first robot's by name."""
    trails = read_trails(left), read_trails(right)
    found = []
    for robot in sorted(one.robots.keys() | other.robots.keys()):
        figures = one.robots.get(robot) or other.robots[robot]
        columns = ARM_TRAIL_COLUMNS if isinstance(figures, ArmFigures) else ROBOT_TRAIL_COLUMNS
        empty = np.empty((0, len(columns)))
        pair = [each.get(f"{robot}.trail", empty) for each in trails]
        if any(each.ndim != 2 or each.shape[1] != len(columns) for each in pair):
            raise BadInput(f"the trajectories of {robot} have other columns: the runs are of different versions")
        if (difference := _first_row(robot, columns, *pair)) is not None:
            found.append(difference)
    return min(found, key=lambda each: each.time_s, default=None)


def _first_row(
    robot: str, columns: tuple[str, ...], left: np.ndarray, right: np.ndarray
) -> TrajectoryDifference | None:
    """Return the first difference of two trails. Long trails are thinned, perhaps differently: only
    common times count.
    """
    times, rows, other_rows = np.intersect1d(left[:, 0], right[:, 0], return_indices=True)
    unequal = ~((left[rows] == right[other_rows]) | (np.isnan(left[rows]) & np.isnan(right[other_rows])))
    if unequal.any():
        first = int(np.argmax(unequal.any(axis=1)))
        column = int(np.argmax(unequal[first]))
        return TrajectoryDifference(
            robot=robot,
            time_s=float(times[first]),
            column=columns[column],
            left=_number(left[rows[first], column]),
            right=_number(right[other_rows[first], column]),
        )
    for side, other, is_left in ((left, right, True), (right, left, False)):
        missing = side[~np.isin(side[:, 0], other[:, 0])]
        beyond = missing[missing[:, 0] > (other[-1, 0] if len(other) else -np.inf)]
        if len(beyond):
            time = float(beyond[0, 0])
            present, absent = (time, None) if is_left else (None, time)
            return TrajectoryDifference(robot=robot, time_s=time, column="", left=present, right=absent)
    return None


def _number(value: float) -> float | None:
    """Return a value of a trail; None for NaN (unknown)."""
    return None if np.isnan(value) else float(value)


def _report_notes(left: Path, right: Path) -> list[str]:
    """Return the differences of the reports' settings: fleet, mode, seed, version and parameters."""
    one, other = read_report(left), read_report(right)
    if one is None or other is None:
        return []
    notes = [
        f"{key}: {getattr(one.run, key)} in {left}, {getattr(other.run, key)} in {right}"
        for key in ("fleet", "mode", "seed", "version")
        if getattr(one.run, key) != getattr(other.run, key)
    ]
    if "real" in (one.run.mode, other.run.mode):
        notes.append("in real time two runs are never the same: repeat them in lockstep")
    for name in sorted(one.parameters.keys() | other.parameters.keys()):
        values = one.parameters.get(name, {}), other.parameters.get(name, {})
        for key in sorted((values[0].keys() | values[1].keys()) - PLACE_PARAMETERS):
            here, there = (each[key].value if key in each else "its default" for each in values)
            if here != there:
                notes.append(f"parameter {name} {key}: {here} in {left}, {there} in {right}")
    return notes
