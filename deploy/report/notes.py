"""What the figures of a run mean where they are off by design, in words."""

from __future__ import annotations

import math

from deploy.fleet import Fleet, Robot
from services.motion.planar import Motion
from services.runtime.errors import BadInput
from services.runtime.parameters.record import build
from services.sim import BaseParameters
from services.sim.base.settings import Settings, configured
from services.sim.diffdrive.driver import AT_REST, Drive, advance, commanded
from services.square import SquareParameters
from services.square.expected import STEP_S, Base, expected, runs_on
from services.square.seed import ANGLE_THRESHOLD


def notes(fleet: Fleet) -> tuple[str, ...]:
    """What the base driver warns of in its configuration, and one text for each square driven by the seed's law."""
    found = []
    for robot in fleet.robot:
        found += _warnings(robot)
        for member in (*robot.services, *(each for _, each in fleet.shared(robot))):
            if member.kind == "square" and member.parameters.get("law") == "seed":
                found.append(_seed(robot, build(SquareParameters, member.parameters)))
    return tuple(found)


def _warnings(robot: Robot) -> list[str]:
    try:
        settings = _settings(robot)
    except BadInput:
        return []  # the simulation has refused it, with the reason
    return [f"{robot.name}: {warning}" for warning in settings.warnings] if settings else []


def _seed(robot: Robot, p: SquareParameters) -> str:
    settings = _settings(robot)
    if settings is None:
        return f"{robot.name} has no wheels: it drives no square."
    drive = settings.drive
    ends = expected(p, _base(drive))
    told = "it would not end"
    if ends is not None:
        told = f"it would end {ends.closure:.3f} m and {abs(math.degrees(ends.turned)):.1f} deg from its start"
    return (
        f"{robot.name} drives the seed's law, which is off by design. Ten times a second it acts on a pose that is up "
        f"to 0.1 s old; it takes a turn for done {math.degrees(ANGLE_THRESHOLD):.1f} deg before its end, but its base "
        f"turns on by {math.degrees(runs_on(_base(drive), p.angular_speed)):.1f} deg and what the delay adds; the next "
        "side counts from the place, and the next turn from the heading, at which it happens to be: the errors add up. "
        f"On a base without any slip {told}."
    )


def _settings(robot: Robot) -> Settings | None:
    return configured(robot.model, build(BaseParameters, robot.parameters)).settings


def _base(drive: Drive) -> Base:
    """The base driver of the simulation on wheels that follow exactly."""
    state = AT_REST

    def move(command: Motion) -> Motion:
        nonlocal state
        state = advance(drive, state, command.v, command.w, False, STEP_S)
        return Motion(*commanded(drive, state))

    return move
