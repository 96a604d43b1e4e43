"""The loop of a script in real time: the processor time by which it counts as ready, and the speed of time."""

from __future__ import annotations

import threading
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import pytest

from messages.gazebo import WorldProperties
from messages.requests import WORLD_PROPERTIES
from services.runtime.transport.memory import MemoryBus
from services.script import node_loop
from services.script.clock import ScriptClock
from services.script.node_loop import OwnTime, RealTimeLoop, run_delay
from tests.harness.memory_node import ManualClock, memory_node, spinning
from tests.harness.waiting import wait_until


def test_time_in_which_others_had_the_processor_does_not_count() -> None:
    wall, waited = [100.0], [7.0]
    own = OwnTime(threading.main_thread(), lambda: wall[0], lambda _: waited[0])
    wall[0], waited[0] = 160.0, 62.5
    assert not own.exceeds(5.0), "4.5 s are left of 60"
    wall[0] = 161.0
    assert own.exceeds(5.0), "it slept, or ran, for more"
    idle = OwnTime(threading.main_thread(), lambda: wall[0], lambda _: 0.0)
    wall[0] = 166.5
    assert idle.exceeds(5.0)


def test_the_system_tells_how_long_a_thread_has_waited() -> None:
    first = run_delay(threading.main_thread())
    assert 0.0 <= first <= run_delay(threading.main_thread())
    never_started = threading.Thread()
    assert run_delay(never_started) == 0.0


class Owner:
    """A kernel without threads."""

    def __init__(self) -> None:
        self.clock, self.simulated, self.rate = ScriptClock(simulated=True), True, 100.0
        self.lock_node: AbstractContextManager[Any] = nullcontext()

    def spin(self) -> None:
        pass


def test_the_speed_of_time_is_asked_for_until_the_simulation_has_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_loop, "_ASK_AGAIN_S", 0.0)
    bus, owner = MemoryBus(), Owner()
    clock = ManualClock(bus)
    with memory_node(bus, "script") as node, memory_node(bus, "sim") as sim:
        loop = RealTimeLoop(owner, node)
        loop.start()
        try:
            for time_ns in (0, 1, 2):
                clock.publish(time_ns)
                wait_until(lambda each=time_ns: owner.clock.started and owner.clock.now() >= each, what="a time")  # type: ignore[misc]
            assert owner.clock.factor == 1.0
            sim.serve(WORLD_PROPERTIES, lambda _: WorldProperties(factor=4.0))

            def known() -> bool:
                nonlocal time_ns
                time_ns += 1
                clock.publish(time_ns)
                return owner.clock.factor == 4.0

            with spinning(sim):
                wait_until(known, what="the speed")
        finally:
            loop.stop()
