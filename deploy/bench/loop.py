"""A raw PyBullet loop in one process that drives the bodies of ``lab`` with the commands that they are given there."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from deploy.bench.span import Span
from deploy.fleet import Robot
from deploy.fleet_file import find_fleet, read_fleet
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


def schedule(commands: dict[str, list[Any]], span: Span) -> Schedule:
    """What the simulation made of the commands, worked out beforehand: the raw loop is to do nothing but physics.

    A controller commands evenly, so its commands up to the end of the span are spread over the steps up to there.
    """
    last = span.steps.stop
    steps: dict[int, list[tuple[str, tuple[float, float]]]] = {}
    efforts: dict[str, list[dict[str, float]]] = {}
    for robot in robots():
        series = commands[robot.name]
        if not drives(robot):
            jobs = [{each.joint_name: each.effort} for each in series]
            efforts[robot.name] = [jobs[step * len(jobs) // last] for step in range(last)]
            continue
        drive, state = settings_of(robot).drive, AT_REST
        for step in range(last):
            command, before = series[step * len(series) // last], state
            state = advance(drive, state, command.linear.x, command.angular.z, False, STEP_NS / 1e9)
            if state is not before:
                steps.setdefault(step, []).append((robot.name, wheel_speeds(drive, state)))
    return Schedule(steps, efforts)


def raw_factor(steps: Schedule, span: Span, hold: Callable[[int], None] | None = None) -> float:
    """Simulated seconds per wall-clock second of the raw loop; ``hold`` is called with the number of each step."""
    with BulletWorld(read_scene("empty"), STEP_NS) as world:
        for robot in robots():
            half = robot.pose.yaw / 2
            place = Placement((robot.pose.x, robot.pose.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
            fixed = read_model(robot.model).fixed_base
            world.spawn(Body(robot.name, model_path(robot.model), place, motors_of(robot), fixed))
        started = 0.0
        for step in range(span.steps.stop):
            if step == span.steps.start:
                started = time.perf_counter()
            if hold is not None:
                hold(step)
            for name, speeds in steps.speeds.get(step, ()):
                world.set_speeds(name, speeds)
            for name, efforts in steps.efforts.items():
                world.set_efforts(name, efforts[step])
            world.step()
        return span.length / (time.perf_counter() - started)
