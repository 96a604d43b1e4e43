"""Scripts in threads that step with a minimal simulation, on an in-memory network."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count

from messages.base import encode
from messages.request import Request
from messages.std import Float64
from messages.topics import Quality, Topic
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.step import STEP_NS
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.script.kernel import KernelOptions, ScriptKernel
from tests.harness.memory_node import memory_node

TRUTH = Topic("/truth", Float64, 50, Quality.SENSOR, "what the simulation tells")
COUNT = Request("/count", Float64, Float64, "how many were served before")
WITHIN_S = 60.0

Body = Callable[[ScriptKernel, list[str]], None]
"""A script: a function of its kernel and a list for its observations."""


def run_scripts(
    bodies: dict[str, Body], steps: int, seed: int = 0, resets: tuple[int, ...] = ()
) -> dict[str, list[str]]:
    """Run named scripts for ``steps`` steps of 5 ms; return the observations of each. ``seed`` varies the timing."""
    bus, chance, epoch = MemoryBus(), random.Random(seed), 0
    written: dict[str, list[str]] = {name: [] for name in bodies}
    with ExitStack() as stack:
        transport = stack.enter_context(MemoryTransport(bus))
        node = stack.enter_context(memory_node(MemoryBus(), "sim", transport=transport))
        truth = node.advertise(TRUTH)
        served = count()
        node.serve(COUNT, lambda _: Float64(data=float(next(served))))
        tick = 0

        def grant() -> StepGrant:
            return StepGrant(simulation=transport.session, tick=tick, time=tick * STEP_NS, epoch=epoch)

        roster = tuple(f"/{name}" for name in bodies)
        barrier = Barrier(transport, node.send_buffer, roster, node.log, node.wait, grant)
        node.request_server.gate = barrier
        threads = [_start(bus, name, body, written[name], chance.random()) for name, body in bodies.items()]
        barrier.wait_for_members()
        for step in range(steps):
            if step in resets:
                tick, epoch = 0, epoch + 1
            node.spin_once()
            barrier.update()
            if tick % 4 == 0:
                truth.publish(Float64(data=float(tick)))
            if barrier.due(tick * STEP_NS):
                barrier.grant(grant(), node.publishers)
                barrier.collect_reports(tick * STEP_NS)
            if chance.random() < 0.1:
                time.sleep(chance.random() * 0.002)
            tick += 1
        deadline = time.monotonic() + WITHIN_S
        while any(each.is_alive() for each in threads):  # scripts that haven't ended continue to step
            assert time.monotonic() < deadline, f"scripts do not end: {written}"
            node.spin_once()
            barrier.update()
            barrier.grant(grant(), node.publishers)
            barrier.collect_reports(tick * STEP_NS)
            tick += 1
    return written


def _start(bus: MemoryBus, name: str, body: Body, written: list[str], delay: float) -> threading.Thread:
    def run() -> None:
        time.sleep(delay * 0.02)
        kernel = ScriptKernel(lambda: MemoryTransport(bus), KernelOptions(lockstep=True))
        try:
            kernel.start(f"/{name}", "/", "script")
            body(kernel, written)
        except BaseException as error:
            written.append(f"failed: {error!r}")
            raise
        finally:
            kernel.shut_down("the script has ended")
            kernel.close()

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    return thread


def number(value: float) -> bytes:
    """Return an encoded message with a number."""
    return encode(Float64(data=value))
