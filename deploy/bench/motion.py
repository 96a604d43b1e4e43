"""Lockstep against a raw PyBullet loop in one process that drives the same bodies with the same commands."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from deploy.bench.figures import Figure, ratios
from deploy.bench.lab import ROBOTS, Fleet, watched
from messages.geometry import Twist
from models import model_path
from models.figures import read_model
from models.scene import read_scene
from services.runtime.service import STEP_NS
from services.sim.bullet import BulletWorld
from services.sim.diffdrive.driver import AT_REST, Drive, advance, wheel_speeds
from services.sim.world import Body, Motor, Placement

FROM_S, TO_S = 2.0, 42.0
"""The span of simulation time that is timed."""
PERIOD = 8
"""Physics steps between two commands of a controller: 25 Hz."""

Schedule = dict[int, list[tuple[str, tuple[float, float]]]]
"""Wheel speeds [rad/s] to set, by physics step."""


def schedule(commands: dict[str, list[Twist]]) -> Schedule:
    """What the base drivers made of the commands, worked out beforehand: the raw loop is to do nothing but physics."""
    wheels = read_model("burger").wheels
    assert wheels is not None
    drive = Drive.of(wheels)
    steps: Schedule = {}
    for name, series in commands.items():
        state = AT_REST
        for number, command in enumerate(series):
            for step in range(number * PERIOD, (number + 1) * PERIOD):
                before = state
                state = advance(drive, state, command.linear.x, command.angular.z, False, STEP_NS / 1e9)
                if state is not before:
                    steps.setdefault(step, []).append((name, wheel_speeds(drive, state)))
    return steps


def raw_factor(steps: Schedule) -> float:
    """Simulated seconds per wall-clock second of the raw loop."""
    wheels = read_model("burger").wheels
    assert wheels is not None
    motors = (Motor(wheels.left_joint, wheels.torque), Motor(wheels.right_joint, wheels.torque))
    first, last = round(FROM_S * 1e9 / STEP_NS), round(TO_S * 1e9 / STEP_NS)
    with BulletWorld(read_scene("empty"), STEP_NS) as world:
        for number, name in enumerate(ROBOTS):
            world.spawn(Body(name, model_path("burger"), Placement((0.0, 0.5 * number, 0.0)), motors))
        started = 0.0
        for step in range(last):
            if step == first:
                started = time.perf_counter()
            for name, speeds in steps.get(step, ()):
                world.set_speeds(name, speeds)
            world.step()
        return (TO_S - FROM_S) / (time.perf_counter() - started)


def lockstep_factor(port: int) -> tuple[float, float, dict[str, list[Twist]]]:
    """Simulated per wall-clock second of ``lab`` with its logger, seconds to the first motion, and the commands."""
    with tempfile.TemporaryDirectory() as folder:
        with Fleet("lab", Path(folder) / "run", port, "--duration", str(TO_S + 2)) as fleet:
            with watched(fleet, commands=True) as watch:
                moved = watch.until_motion()
                begun = watch.until(FROM_S)
                ended = watch.until(TO_S)
            fleet.finish()
        return (TO_S - FROM_S) / (ended - begun), moved - fleet.started, watch.heard


def measure(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Lockstep and the raw loop in turn."""
    raw: list[float] = []
    lockstep: list[float] = []
    starts: list[float] = []
    for number in range(rounds):
        say(f"lockstep, round {number + 1} of {rounds}")
        factor, start, commands = lockstep_factor(port)
        lockstep.append(factor)
        starts.append(start)
        raw.append(raw_factor(schedule(commands)))
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
