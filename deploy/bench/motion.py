"""Lockstep against a raw PyBullet loop in one process that drives the same bodies with the same commands."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from deploy.bench.figures import Figure, ratios
from deploy.bench.lab import Fleet, watched
from deploy.fleet import Robot
from deploy.fleet_file import find_fleet, read_fleet
from messages.topics import CMD_VEL, JOINT_EFFORT
from models import model_path
from models.figures import read_model
from models.scene import read_scene
from services.runtime.parameters.record import build
from services.runtime.service import STEP_NS
from services.sim.base.parameters import BaseParameters
from services.sim.base.settings import Settings, configured
from services.sim.diffdrive.driver import AT_REST, advance, wheel_speeds
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Body, Motor, Placement

FROM_S, TO_S = 2.0, 42.0
"""The span of simulation time that is timed."""
FIRST, LAST = (round(seconds * 1e9 / STEP_NS) for seconds in (FROM_S, TO_S))
"""The same in physics steps."""


class Schedule(NamedTuple):
    """Wheel speeds [rad/s] to set, by physics step, and the efforts [N m] on joints at every step, one for each."""

    speeds: dict[int, list[tuple[str, tuple[float, float]]]]
    efforts: dict[str, list[dict[str, float]]]


def robots() -> tuple[Robot, ...]:
    """The robots of ``lab``."""
    return read_fleet(find_fleet("lab")).robot


def drives(robot: Robot) -> bool:
    """Whether a robot has wheels."""
    return read_model(robot.model).wheels is not None


def motors_of(robot: Robot) -> tuple[Motor, ...]:
    """The motors of a robot's wheels."""
    if not drives(robot):
        return ()
    settings = settings_of(robot)
    return tuple(Motor(each, settings.torque) for each in (settings.left_joint, settings.right_joint))


def settings_of(robot: Robot) -> Settings:
    """How a robot of ``lab`` is driven."""
    settings = configured(robot.model, build(BaseParameters, robot.parameters)).settings
    assert settings is not None
    return settings


def schedule(commands: dict[str, list[Any]]) -> Schedule:
    """What the simulation made of the commands, worked out beforehand: the raw loop is to do nothing but physics.

    A controller commands evenly, so its commands up to TO_S are spread over the steps up to LAST.
    """
    steps: dict[int, list[tuple[str, tuple[float, float]]]] = {}
    efforts: dict[str, list[dict[str, float]]] = {}
    for robot in robots():
        series = commands[robot.name]
        if not drives(robot):
            jobs = [{each.joint_name: each.effort} for each in series]
            efforts[robot.name] = [jobs[step * len(jobs) // LAST] for step in range(LAST)]
            continue
        drive, state = settings_of(robot).drive, AT_REST
        for step in range(LAST):
            command, before = series[step * len(series) // LAST], state
            state = advance(drive, state, command.linear.x, command.angular.z, False, STEP_NS / 1e9)
            if state is not before:
                steps.setdefault(step, []).append((robot.name, wheel_speeds(drive, state)))
    return Schedule(steps, efforts)


def raw_factor(steps: Schedule) -> float:
    """Simulated seconds per wall-clock second of the raw loop."""
    with BulletWorld(read_scene("empty"), STEP_NS) as world:
        for robot in robots():
            half = robot.pose.yaw / 2
            place = Placement((robot.pose.x, robot.pose.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
            fixed = read_model(robot.model).fixed_base
            world.spawn(Body(robot.name, model_path(robot.model), place, motors_of(robot), fixed))
        started = 0.0
        for step in range(LAST):
            if step == FIRST:
                started = time.perf_counter()
            for name, speeds in steps.speeds.get(step, ()):
                world.set_speeds(name, speeds)
            for name, efforts in steps.efforts.items():
                world.set_efforts(name, efforts[step])
            world.step()
        return (TO_S - FROM_S) / (time.perf_counter() - started)


def lab_commands(port: int) -> dict[str, list[Any]]:
    """The commands of ``lab``, which are the same in every run, from one that is not timed."""
    with _lab(port) as fleet, watched(fleet) as watch:
        return watch.commands({each.name: CMD_VEL if drives(each) else JOINT_EFFORT for each in robots()}, TO_S)


def lockstep_factor(port: int) -> tuple[float, float]:
    """Simulated per wall-clock second of ``lab`` with its logger, and the seconds to the first motion."""
    with _lab(port) as fleet, watched(fleet) as watch:
        moved = watch.until_motion()
        begun, first = watch.until(FROM_S), watch.now
        ended, last = watch.until(TO_S), watch.now
        return (last - first) / (ended - begun), moved - fleet.started


@contextmanager
def _lab(port: int) -> Iterator[Fleet]:
    duration = str(TO_S + 2)
    with (
        tempfile.TemporaryDirectory() as folder,
        Fleet("lab", Path(folder) / "run", port, "--duration", duration) as fleet,
    ):
        yield fleet
        fleet.finish()


def measure(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Lockstep and the raw loop in turn."""
    raw: list[float] = []
    lockstep: list[float] = []
    starts: list[float] = []
    say("lockstep, the commands")
    steps = schedule(lab_commands(port))
    for number in range(rounds):
        say(f"lockstep, round {number + 1} of {rounds}")
        factor, start = lockstep_factor(port)
        lockstep.append(factor)
        starts.append(start)
        raw.append(raw_factor(steps))
    return [
        Figure(
            "lockstep_ratio",
            "",
            "speed of lab in lockstep, recording / raw PyBullet loop with the same commands",
            ratios(lockstep, raw),
            at_least=0.5,
        ),
        Figure("lockstep_factor", "x", "the same, simulated per wall-clock second", tuple(lockstep)),
        Figure("start_s", "s", "from ./elea up to the first robot's motion", tuple(starts)),
    ]
