"""What a fleet costs while nothing moves: CPU and memory of each service."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from deploy.bench.figures import Figure
from deploy.bench.lab import Fleet, watched

FROM_S, TO_S = 3.0, 8.0
"""The span of simulation time, here also of wall time, over which CPU is counted."""


def measure(rounds: int, port: int, say: Callable[[str], None]) -> list[Figure]:
    """The fleet ``bare`` in real time, standing still."""
    cpu: dict[str, list[float]] = {}
    memory: dict[str, list[float]] = {}
    for number in range(rounds):
        say(f"idle, round {number + 1} of {rounds}")
        with (
            tempfile.TemporaryDirectory() as folder,
            Fleet("bare", Path(folder) / "run", port, "--mode", "real") as fleet,
            watched(fleet) as watch,
        ):
            watch.until(FROM_S)
            services = fleet.services()
            before = {name: sum(process.cpu_times()[:2]) for name, process in services.items()}
            begun = time.perf_counter()
            watch.until(TO_S)
            wall = time.perf_counter() - begun
            for name, process in services.items():
                used = sum(process.cpu_times()[:2]) - before[name]
                cpu.setdefault(name, []).append(100 * used / wall)
                memory.setdefault(name, []).append(process.memory_info().rss / 2**20)
    figures = []
    for name in cpu:
        figures.append(Figure(f"idle_cpu_{name}_percent", "%", f"of a core, {name} in real time", tuple(cpu[name])))
        figures.append(Figure(f"memory_{name}_mib", "MiB", f"resident, {name}", tuple(memory[name])))
    return figures
