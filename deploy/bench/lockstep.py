"""Lockstep of the fleet ``lab`` against a raw PyBullet loop, and where its time goes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from deploy.bench.barrier import barrier
from deploy.bench.figures import Figure, ratios
from deploy.bench.lab import Fleet, watched
from deploy.bench.loop import drives, raw_factor, robots, schedule
from deploy.bench.span import Span
from messages.topics import CMD_VEL, JOINT_EFFORT
from services.runtime.graph import Entity, pattern
from services.runtime.service import STEP_NS

SPAN = Span(2.0, 42.0)


class Course(NamedTuple):
    """What one run of ``lab`` shows that is not timed: the commands by robot, the same in every run, and by member of
    its lockstep the physics steps between two of its own.
    """

    commands: dict[str, list[Any]]
    strides: tuple[int, ...]


class Timed(NamedTuple):
    """A timed run: simulated per wall-clock second, seconds to the first motion, and the CPU time [ms] that each
    service takes for a second of simulation.
    """

    factor: float
    start: float
    cpu: dict[str, float]


def course(port: int, span: Span) -> Course:
    """Watch a run up to the end of the span."""
    with _lab(port, span) as fleet, watched(fleet) as watch:
        wanted = {each.name: CMD_VEL if drives(each) else JOINT_EFFORT for each in robots()}
        commands = watch.commands(wanted, span.end)
        found = (Entity.parse(key) for key in watch.node.transport.tokens(pattern("step")))
        return Course(commands, tuple(int(each.detail) // STEP_NS for each in found if each is not None))


def timed(port: int, span: Span) -> Timed:
    """``lab`` with its logger, in lockstep."""
    with _lab(port, span) as fleet, watched(fleet) as watch:
        moved = watch.until_motion()
        begun, first = watch.until(span.begin), watch.now
        processes = fleet.services()
        before = {name: sum(each.cpu_times()[:2]) for name, each in processes.items()}
        ended, last = watch.until(span.end), watch.now
        cpu: dict[str, float] = {}
        for name, each in processes.items():
            kind, used = name.rpartition("/")[2], sum(each.cpu_times()[:2]) - before[name]
            cpu[kind] = cpu.get(kind, 0.0) + 1000 * used / (last - first)
        return Timed((last - first) / (ended - begun), moved - fleet.started, cpu)


@contextmanager
def _lab(port: int, span: Span) -> Iterator[Fleet]:
    duration = str(span.end + 2)
    with (
        tempfile.TemporaryDirectory() as folder,
        Fleet("lab", Path(folder) / "run", port, "--duration", duration) as fleet,
    ):
        yield fleet
        fleet.finish()


def measure(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """Lockstep, the raw loop, and the raw loop behind a bare barrier, in turn."""
    raw: list[float] = []
    behind: list[float] = []
    runs: list[Timed] = []
    span = SPAN
    say("lockstep, the commands")
    seen = course(port, span)
    steps = schedule(seen.commands, span)
    for number in range(rounds):
        say(f"lockstep, round {number + 1} of {rounds}")
        runs.append(timed(port, span))
        raw.append(raw_factor(steps, span))
        with barrier(seen.strides) as bare:
            behind.append(raw_factor(steps, span, bare.hold))
            bare.finish()
    lockstep = [each.factor for each in runs]
    figures = [
        Figure(
            "lockstep_ratio",
            "",
            "speed of lab in lockstep, recording / raw PyBullet loop with the same commands",
            ratios(lockstep, raw),
            at_least=0.5,
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
