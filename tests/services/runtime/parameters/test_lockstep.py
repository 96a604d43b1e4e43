"""In lockstep a parameter change takes effect at the same tick in every run, whatever the timing."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any

from msgspec import Meta

from messages.parameters import Announcement, Parameter, ParameterValues
from messages.requests import PARAMS_ANNOUNCE
from messages.std import Float64
from messages.topics import UPDATES
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.client import ParameterClient
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node
from tests.services.runtime.lockstep.test_lockstep import EFFORT, TRUTH, Simulation

RATES = {"a": 50.0, "b": 25.0}
CHANGES = {200_000_000: 2.0, 300_000_000: 3.0, 400_000_000: 0.5}
"""Values of ``gain`` by the simulation time [ns] at which the parameter service publishes them."""


class Gain(Parameters):
    gain: Annotated[float, Meta(ge=0, le=5)] = 1.0


class ControllerLoop:
    """A node whose loop runs in a thread of its own."""

    def __init__(self, transport: Transport, name: str, run: Callable[[Node], None]) -> None:
        self._transport, self._name, self._run = transport, name, run
        self.node: Node | None = None
        self.thread = threading.Thread(target=self._body)
        self.thread.start()

    def _body(self) -> None:
        with (
            self._transport,
            memory_node(MemoryBus(), self._name, transport=self._transport) as made,
            suppress(Stopped),
        ):
            self.node = made
            self._run(made)

    def stop(self) -> None:
        assert self.node is not None
        self.node.stopping = True
        self.node.transport.wake()
        self.thread.join(60)
        assert not self.thread.is_alive()


def _authority(dawdle: random.Random) -> Callable[[Node], None]:
    def run(made: Node) -> None:
        def values(name: str, revision: int, gain: float) -> ParameterValues:
            return ParameterValues(set=name, revision=revision, values=(Parameter(name="gain", value=gain),))

        def announce(asked: Announcement) -> ParameterValues:
            made.advertise(UPDATES, f"{asked.set}/parameter_updates").publish(values(asked.set, 1, 1.5))
            return values(asked.set, 1, 1.5)

        made.serve(PARAMS_ANNOUNCE, announce)
        ctx: Context[Any] = Context(made, Parameters(), 10, lockstep=True)
        revision = 1
        for tick in ctx.ticks():
            time.sleep(dawdle.random() * 0.01)
            if (gain := CHANGES.get(tick.time)) is not None:
                revision += 1
                for name in ("a", "b", "sim"):
                    made.advertise(UPDATES, f"/{name}/parameter_updates").publish(values(f"/{name}", revision, gain))

    return run


def _member(rate: float, dawdle: random.Random, seen: list[Any]) -> Callable[[Node], None]:
    def run(made: Node) -> None:
        # As in every process of a fleet, whose link to the service may not be up yet.
        ParameterClient.of(made).expected = True
        followed = ParameterSubscription(made, made.identity.node, Gain())
        followed.start()
        ctx: Context[Gain] = Context(made, followed.params, rate, lockstep=True, subscription=followed)
        truth = ctx.stream(TRUTH)
        for tick in ctx.ticks():
            heard = sum(m.data for m in truth.drain())
            seen.append((tick.time, ctx.params.gain, ctx.params_changed, heard))
            time.sleep(dawdle.random() * 0.003)
            ctx.publish(EFFORT, Float64(data=ctx.params.gain * heard))

    return run


def _run(connected: Callable[[], Transport], seed: int, order: tuple[str, ...]) -> tuple[float, Any, Any]:
    dawdle, seen = random.Random(seed), {name: [] for name in RATES}
    own: list[tuple[int, float]] = []
    params = ControllerLoop(connected(), "params", _authority(dawdle))
    with connected() as transport, memory_node(MemoryBus(), "sim", transport=transport) as made:
        ParameterClient.of(made).expected = True
        followed = ParameterSubscription(made, "/sim", Gain())
        followed.start()
        simulation = Simulation(made, ("/params", *(f"/{name}" for name in RATES)))
        ParameterClient.of(made).watermarks = simulation.barrier.watermarks
        members = [ControllerLoop(connected(), name, _member(RATES[name], dawdle, seen[name])) for name in order]
        try:
            simulation.barrier.wait_for_members()
            for _ in range(30):
                simulation.step(4)
                if followed.refresh():
                    own.append(((simulation.tick - 4) * 5, followed.params.gain))
        finally:
            for each in (*members, params):
                each.stop()
        return simulation.state, seen, own


def test_a_change_counts_at_one_tick_for_everybody(connect: Callable[[], Transport]) -> None:
    first = _run(connect, 1, ("a", "b"))
    assert first == _run(connect, 2, ("b", "a"))
    _, seen, own = first
    gains = {name: {time_ns // 1_000_000: gain for time_ns, gain, _, _ in rows} for name, rows in seen.items()}
    assert [gains["a"][at] for at in (0, 200, 220, 300, 320, 400, 420)] == [1.5, 1.5, 2.0, 2.0, 3.0, 3.0, 0.5]
    assert [gains["b"][at] for at in (200, 240, 320, 440)] == [1.5, 2.0, 3.0, 0.5]
    assert [changed for time_ns, _, changed, _ in seen["a"] if changed] == [2**32 - 1, 1, 1, 1]
    assert all(rows[0][1] == 1.5 for rows in seen.values())
    # The simulation applies them at their sender's tick, before its next step.
    assert own == [(200, 2.0), (300, 3.0), (400, 0.5)]
