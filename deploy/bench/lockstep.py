"""Lockstep of the fleet ``lab`` against a loop of its engine alone with the same commands."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from deploy.bench.barrier import raw_barrier
from deploy.bench.figures import Figure, ratios
from deploy.bench.fleet import BenchFleet, watch_fleet
from deploy.fleet import RobotConfig
from deploy.fleet_file import find_fleet, read_fleet
from messages.se3 import Pose3
from messages.topics import CMD_VEL, JOINT_EFFORT
from models import physics_urdf_path
from models.model import read_model
from models.world import read_world
from services.runtime.graph import Entity, token_pattern
from services.runtime.parameters.validation import build
from services.runtime.step import STEP_NS
from services.sim.drive.config import DriveConfig, robot_config
from services.sim.drive.driver import AT_REST, step_drive, wheel_speeds
from services.sim.engines import default_engine, open_world
from services.sim.parameters import BaseParameters
from services.sim.physics.world import Body, Motor

FLEET = "lab"
"""Name or file of the measured fleet; it has a wheeled robot named WATCHED_ROBOT."""


class Span(NamedTuple):
    """The measured span of simulation time [s]."""

    begin: float
    end: float

    @property
    def steps(self) -> range:
        """The span in physics steps."""
        return range(*(round(seconds * 1e9 / STEP_NS) for seconds in self))

    @property
    def length(self) -> float:
        """The length of the span [s]."""
        return self.end - self.begin


class ActuatorSchedule(NamedTuple):
    """Wheel speeds [rad/s] by physics step, and the joint efforts [N m] for every step."""

    speeds: dict[int, list[tuple[str, tuple[float, float]]]]
    efforts: dict[str, list[dict[str, float]]]


def fleet_robots() -> tuple[RobotConfig, ...]:
    """Return the robots of the fleet."""
    return read_fleet(find_fleet(FLEET)).robot


def has_wheels(robot: RobotConfig) -> bool:
    """Return whether a robot has wheels."""
    return read_model(robot.model).has_base


def wheel_motors(robot: RobotConfig) -> tuple[Motor, ...]:
    """Return the motors of a robot's wheels."""
    if not has_wheels(robot):
        return ()
    settings = drive_settings(robot)
    return tuple(Motor(each, settings.torque) for each in (*settings.left_joints, *settings.right_joints))


def drive_settings(robot: RobotConfig) -> DriveConfig:
    """Return the drive settings of a robot."""
    settings = robot_config(robot.model, build(BaseParameters, robot.parameters)).drive_config
    assert settings is not None
    return settings


def build_schedule(commands: dict[str, list[Any]], span: Span) -> ActuatorSchedule:
    """Compute the wheel speeds of the commands in advance, so that the raw loop contains only physics.

    A controller publishes evenly, so its commands up to the end of the span are spread over the steps up to there.
    """
    last = span.steps.stop
    steps: dict[int, list[tuple[str, tuple[float, float]]]] = {}
    efforts: dict[str, list[dict[str, float]]] = {}
    for robot in fleet_robots():
        series = commands[robot.name]
        if not has_wheels(robot):
            jobs = [{each.joint_name: each.effort} for each in series]
            efforts[robot.name] = [jobs[step * len(jobs) // last] for step in range(last)]
            continue
        drive, state = drive_settings(robot).drive, AT_REST
        for step in range(last):
            command, before = series[step * len(series) // last], state
            state = step_drive(drive, state, command.linear.x, command.angular.z, False, STEP_NS / 1e9)
            if state is not before:
                steps.setdefault(step, []).append((robot.name, wheel_speeds(drive, state)))
    return ActuatorSchedule(steps, efforts)


def raw_factor(steps: ActuatorSchedule, span: Span, hold: Callable[[int], None] | None = None) -> float:
    """Return simulated seconds per wall-clock second of the raw loop; ``hold`` is called with the
    number of each step.
    """
    engine = read_fleet(find_fleet(FLEET)).run.engine or default_engine()
    with open_world(engine, read_world("empty"), STEP_NS) as world:
        for robot in fleet_robots():
            place = Pose3.planar(robot.pose.x, robot.pose.y, robot.pose.yaw)
            fixed = read_model(robot.model).fixed_base
            world.spawn(Body(robot.name, physics_urdf_path(robot.model), place, wheel_motors(robot), fixed))
        started = 0.0
        for step in range(span.steps.stop):
            if step == span.steps.start:
                started = time.perf_counter()
            if hold is not None:
                hold(step)
            for name, speeds in steps.speeds.get(step, ()):
                world.body(name).set_speeds(speeds)
            for name, efforts in steps.efforts.items():
                world.body(name).set_efforts(efforts[step])
            world.step()
        return span.length / (time.perf_counter() - started)


SPAN = Span(2.0, 42.0)


class RecordedRun(NamedTuple):
    """Untimed data of a run: the commands by robot, the same in every run, and for each lockstep member the physics
    steps between two of its steps.
    """

    commands: dict[str, list[Any]]
    strides: tuple[int, ...]


class TimedRun(NamedTuple):
    """A timed run: simulated per wall-clock second, seconds to the first motion, and the CPU time [ms] of each service
    per second of simulation.
    """

    factor: float
    start: float
    cpu: dict[str, float]


def record_run(port: int, span: Span) -> RecordedRun:
    """Record a run up to the end of the span."""
    with _started_fleet(port, span) as fleet, watch_fleet(fleet) as watch:
        topics = {each.name: CMD_VEL if has_wheels(each) else JOINT_EFFORT for each in fleet_robots()}
        commands = watch.record_commands(topics, span.end)
        found = (Entity.parse(key) for key in watch.node.transport.tokens(token_pattern("step")))
        return RecordedRun(commands, tuple(int(each.detail) // STEP_NS for each in found if each is not None))


def time_run(port: int, span: Span) -> TimedRun:
    """Time the fleet in lockstep."""
    with _started_fleet(port, span) as fleet, watch_fleet(fleet) as watch:
        moved = watch.wait_for_motion()
        begun, first = watch.wait_until(span.begin), watch.now
        processes = fleet.services()
        before = {name: sum(each.cpu_times()[:2]) for name, each in processes.items()}
        ended, last = watch.wait_until(span.end), watch.now
        cpu: dict[str, float] = {}
        for name, each in processes.items():
            kind, used = name.rpartition("/")[2], sum(each.cpu_times()[:2]) - before[name]
            cpu[kind] = cpu.get(kind, 0.0) + 1000 * used / (last - first)
        return TimedRun((last - first) / (ended - begun), moved - fleet.started, cpu)


@contextmanager
def _started_fleet(port: int, span: Span) -> Iterator[BenchFleet]:
    duration = str(span.end + 2)
    with (
        tempfile.TemporaryDirectory() as folder,
        BenchFleet(FLEET, Path(folder) / "run", port, "--duration", duration) as fleet,
    ):
        yield fleet
        fleet.finish()


def measure_lockstep(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Measure lockstep, the raw loop, and the raw loop behind a bare barrier, in turn."""
    raw: list[float] = []
    behind: list[float] = []
    runs: list[TimedRun] = []
    span = SPAN
    say("lockstep, the commands")
    seen = record_run(port, span)
    steps = build_schedule(seen.commands, span)
    for number in range(rounds):
        say(f"lockstep, round {number + 1} of {rounds}")
        runs.append(time_run(port, span))
        raw.append(raw_factor(steps, span))
        with raw_barrier(seen.strides) as bare:
            behind.append(raw_factor(steps, span, bare.hold))
            bare.finish()
    lockstep = [each.factor for each in runs]
    figures = [
        Figure(
            "lockstep_ratio",
            "",
            "speed of lab in lockstep, recording / loop of its engine with the same commands",
            ratios(lockstep, raw),
            at_least=0.15,
        ),
        Figure("lockstep_factor", "x", "the same, simulated per wall-clock second", tuple(lockstep)),
        Figure(
            "barrier_ratio",
            "",
            "speed of that loop behind a barrier of bare Zenoh, whose members do nothing / without it",
            ratios(behind, raw),
        ),
        Figure("loop_cpu_ms", "ms", "for a second of simulation, the raw loop", tuple(1000 / each for each in raw)),
        Figure("start_s", "s", "from ./elea up to the first robot's motion", tuple(each.start for each in runs)),
    ]
    for kind in sorted(runs[0].cpu, key=lambda kind: -runs[0].cpu[kind]):
        spent = tuple(each.cpu[kind] for each in runs)
        figures.append(
            Figure(f"lockstep_cpu_{kind}_ms", "ms", f"CPU for a second of simulation in lockstep, {kind}", spent)
        )
    return figures
