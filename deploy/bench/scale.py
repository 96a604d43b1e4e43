"""The fleet ``swarm`` at several sizes against the engine alone: speed, start-up, memory, and processor time."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import psutil

from deploy.bench.figures import Figure, ratios
from deploy.bench.fleet import BenchFleet, watch_fleet
from deploy.bench.raw_engine import raw_loop_factor
from deploy.fleet_file import find_fleet, read_fleet
from services.runtime.step import STEP_NS
from services.sim.engines import ENGINES, Engine, has_engine

SIZES = (4, 16, 64, 100)
"""Numbers of robots."""
SHARED = {"separate": "1", "shared": "25"}
"""Maximum number of controllers per process."""
FROM_S, LENGTH_S = 2.0, 5.0
"""Start and length of the timed span in simulation time."""
_SPARE_S = 60.0
"""Extra duration [s]: with few robots, simulation time runs far past the span before this process notices."""


class TimedSwarm(NamedTuple):
    """A timed run: simulated per wall-clock second, wall time from ./elea to the first second of simulation [s], memory
    of the whole fleet [MiB], and its processor time [ms] per second of simulation.
    """

    factor: float
    start: float
    memory: float
    cpu: float


def measure_scale(rounds: int, sizes: Sequence[int], port: int, say: Callable[[str], None]) -> list[Figure]:
    """Measure every size on both engines, with controllers in their own processes and shared, besides the raw loop."""
    return [
        figure
        for engine in ENGINES
        if has_engine(engine)
        for size in sizes
        for figure in _measure_size(engine, size, rounds, port, say)
    ]


def _measure_size(engine: Engine, size: int, rounds: int, port: int, say: Callable[[str], None]) -> Iterator[Figure]:
    robots = read_fleet(find_fleet("swarm"), (f"grid.robots={size}",)).robot
    raw: list[float] = []
    runs: dict[str, list[TimedSwarm]] = {name: [] for name in SHARED}
    for number in range(rounds):
        for name, share in SHARED.items():
            say(f"{size} robots on {engine}, {name}, round {number + 1} of {rounds}")
            runs[name].append(time_swarm(engine, size, share, port))
        raw.append(raw_loop_factor(engine, robots, FROM_S, LENGTH_S))
    yield Figure(
        f"swarm_{engine}_{size}_raw_factor", "x", "the engine alone: steps and lasers of as many robots", tuple(raw)
    )
    for name, timed in runs.items():
        stem = f"swarm_{engine}_{size}_{name}"
        factors = [each.factor for each in timed]
        yield Figure(f"{stem}_ratio", "", f"speed of {size} robots / of the engine alone", ratios(factors, raw))
        yield Figure(f"{stem}_factor", "x", "the same, simulated per wall-clock second", tuple(factors))
        yield Figure(f"{stem}_start_s", "s", "from ./elea up until time runs", tuple(each.start for each in timed))
        yield Figure(f"{stem}_memory_mib", "MiB", "of all processes of the fleet", tuple(each.memory for each in timed))
        yield Figure(f"{stem}_cpu_ms", "ms", "CPU for a second of simulation, all", tuple(each.cpu for each in timed))


def time_swarm(engine: Engine, size: int, share: str, port: int) -> TimedSwarm:
    """Time ``swarm`` over the span."""
    end = FROM_S + LENGTH_S
    with tempfile.TemporaryDirectory() as folder:
        fleet_file = Path(folder) / "swarm.toml"
        text = find_fleet("swarm").read_text()
        fleet_file.write_text(text.replace("share = 25", f"share = {share}"))
        options = ("--robots", str(size), "--engine", engine, "--duration", str(end + _SPARE_S))
        with BenchFleet(str(fleet_file), Path(folder) / "run", port, *options) as fleet, watch_fleet(fleet) as watch:
            started = watch.wait_until(STEP_NS / 1e9)
            begun, first = watch.wait_until(FROM_S), watch.now
            processes = list(fleet.services().values())
            before = sum(map(_cpu_time, processes))
            ended, last = watch.wait_until(max(end, first + LENGTH_S)), watch.now
            cpu = 1000 * (sum(map(_cpu_time, processes)) - before) / (last - first)
            memory = sum(each.memory_full_info().pss for each in processes) / 2**20
            return TimedSwarm((last - first) / (ended - begun), started - fleet.started, memory, cpu)


def _cpu_time(process: psutil.Process) -> float:
    return sum(process.cpu_times()[:2])
