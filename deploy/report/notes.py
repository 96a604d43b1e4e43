"""Notes of a report: errors by design, and whether the machine kept up with real time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from deploy.fleet import Fleet, RobotConfig
from deploy.report.record import RunFigures
from messages.se2 import Twist2
from models.model import read_model
from services.runtime.errors import BadInput, list_names
from services.runtime.parameters.validation import build
from services.runtime.step import STEP_S
from services.sim.drive.config import NO_TIMEOUT, DriveConfig, odometry_config, robot_config
from services.sim.drive.driver import AT_REST, Drive, commanded_velocity, step_drive
from services.sim.drive.odometry_error import NO_ERROR, draw_errors, odometry_error
from services.sim.parameters import BaseParameters
from services.square import SquareParameters
from services.square.tutorial import ANGLE_THRESHOLD, BaseStep, overrun, predict


def fleet_notes(fleet: Fleet) -> tuple[str, ...]:
    """Return the base drivers' configuration warnings, a note for each square driven by the tutorial's law, and one on
    the errors of wheel odometry.
    """
    found, tutorial = list[str](), list[str]()
    found += _base_warnings(fleet.robot)
    for robot in fleet.robot:
        for member in (*robot.services, *(each for _, each in fleet.shared_services(robot))):
            if member.kind == "square" and member.parameters.get("law") == "tutorial":
                tutorial.append(_tutorial_note(robot, build(SquareParameters, member.parameters)))
    rest = len(tutorial) - MAX_NAMED_ROBOTS
    more = [f"The same holds for {rest} more robots."] if rest > 0 else []
    return (*found, *tutorial[:MAX_NAMED_ROBOTS], *more, *_odometry_notes(fleet))


def _odometry_notes(fleet: Fleet) -> list[str]:
    """Return a note on the robots' wheel odometry errors; empty if all odometry is exact."""
    parts = []
    for robot in fleet.robot:
        model = read_model(robot.model)
        if model.wheels is None:
            continue
        config = odometry_config(model, build(BaseParameters, robot.parameters))
        error = odometry_error(config.error, config.error_multiple, draw_errors(fleet.run.seed, robot.name))
        if config.source == "encoder" and error != NO_ERROR:
            parts.append(f"{robot.name}: {error.describe()}")
    if not parts:
        return []
    rest = len(parts) - MAX_NAMED_ROBOTS
    listed = "; ".join(parts[:MAX_NAMED_ROBOTS]) + (f"; and {rest} more" if rest > 0 else "")
    return [
        "Odometry drifts as on a real robot, because the wheels differ from what it assumes "
        f"(seed {fleet.run.seed}): {listed}. odometry_error = 0 turns this off."
    ]


def start_lines(fleet: Fleet, overrides: Sequence[str]) -> tuple[str, ...]:
    """Return notes for the start of a run: overridden keys of the fleet file, and robots without a command timeout."""
    lines = [f"changed on the command line: {', '.join(overrides)}"] if overrides else []
    return (*lines, *(each for each in _base_warnings(fleet.robot) if each.endswith(NO_TIMEOUT)))


def overrides_note(overrides: Sequence[str]) -> tuple[str, ...]:
    """Return one note with the overridden keys of the fleet file, or none."""
    return (f"Changed on the command line: {', '.join(overrides)}.",) if overrides else ()


def _base_warnings(robots: Iterable[RobotConfig]) -> list[str]:
    """Return the warnings of the robots' base drivers; one that several robots share is listed once."""
    names_by_warning: dict[str, list[str]] = {}
    for robot in robots:
        try:
            settings = _settings(robot)
        except BadInput:
            continue  # the simulation rejected it and reported the reason
        for warning in settings.warnings if settings else ():
            names_by_warning.setdefault(warning, []).append(robot.name)
    lines = []
    for warning, names in names_by_warning.items():
        if len(names) > MAX_NAMED_ROBOTS:
            lines.append(f"{list_names(names, MAX_NAMED_NODES)}: {warning}")
        else:
            lines += [f"{name}: {warning}" for name in names]
    return lines


def _tutorial_note(robot: RobotConfig, p: SquareParameters) -> str:
    settings = _settings(robot)
    if settings is None:
        return f"{robot.name} has no wheels: it drives no square."
    drive = settings.drive
    ends = predict(p, _ideal_base(drive))
    outcome = "it would not end"
    if ends is not None:
        outcome = f"it would end {ends.closure:.3f} m and {abs(math.degrees(ends.excess_turn)):.1f} deg from its start"
    return (
        f"{robot.name} drives by the tutorial's law, which is inaccurate by design. Ten times a second it acts on a "
        f"pose up to 0.1 s old; it ends a turn {math.degrees(ANGLE_THRESHOLD):.1f} deg early, but the base "
        f"overshoots by {math.degrees(overrun(_ideal_base(drive), p.angular_speed)):.1f} deg plus what the delay adds; "
        "the next side starts from the position, and the next turn from the heading, that this leaves: "
        "the errors add up. "
        f"On a base without any slip {outcome}."
    )


def _settings(robot: RobotConfig) -> DriveConfig | None:
    return robot_config(robot.model, build(BaseParameters, robot.parameters)).drive_config


def _ideal_base(drive: Drive) -> BaseStep:
    """Return the simulation's base driver on wheels that follow their commands exactly."""
    state = AT_REST

    def move(command: Twist2) -> Twist2:
        nonlocal state
        state = step_drive(drive, state, command.v, command.w, False, STEP_S)
        return Twist2(*commanded_velocity(drive, state))

    return move


MAX_NAMED_NODES = 3
MAX_NAMED_ROBOTS = 6
"""Maximum number of nodes and robots named in a note."""


def real_time_notes(run: RunFigures, ok: bool) -> tuple[str, ...]:
    """Return a note if a run in real time fell behind; of missed ticks of services only if a check was missed, too.

    Most machines miss a tick now and then, without harm.
    """
    if run.mode != "real" or not (run.lag_s or (run.ticks_missed and not ok)):
        return ()
    parts = []
    if run.lag_s:
        parts.append(f"the simulation fell behind by {run.lag_s:.1f} s in all")
    if run.ticks_missed:
        worst = sorted(run.ticks_missed.items(), key=lambda each: -each[1])
        missed = list_names([f"{node} {count}" for node, count in worst], MAX_NAMED_NODES)
        parts.append(f"ticks were missed by {missed}")
    return (
        f"This machine did not keep up with real time at factor {run.factor:g}: {'; '.join(parts)}. Missed bounds may "
        "be due to that: stop other programs, use a lower --factor, or --mode lockstep, which waits.",
    )
