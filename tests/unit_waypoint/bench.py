"""A bench for loops: a service's real loop in a thread, on the transport in memory; the test plays the simulation."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from messages.base import Message, decoder
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, Topic
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.identity import Identity
from services.runtime.log import Log
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.service import Parameters, Service

M = TypeVar("M", bound=Message)
PATIENCE_S = 30.0


class Bench:
    """The test's side of the bus."""

    def __init__(self, bus: MemoryBus, log: io.StringIO) -> None:
        self._transport = MemoryTransport(bus)
        self._outputs: dict[str, Output[Any]] = {}
        self._inlets: dict[str, Any] = {}
        self._log = log
        self.loop: threading.Thread | None = None

    @property
    def log(self) -> str:
        """What the service has logged."""
        return self._log.getvalue()

    def send(self, topic: Topic[M], key: str, message: M) -> None:
        """Publish on a key."""
        if key not in self._outputs:
            self._outputs[key] = Output(topic, f"/{key}", key, "/test", self._transport)
        self._outputs[key].publish(message)

    def clock(self, seconds: float, epoch: int = 0) -> None:
        """Let simulation time be ``seconds``."""
        self.send(CLOCK, "clock", Clock(clock=Time.of(round(seconds * 1e9)), epoch=epoch))

    def wanted(self, key: str) -> bool:
        """Whether the service listens to a key on which something was sent."""
        return self._outputs[key].wanted

    def hear(self, topic: Topic[M], key: str) -> None:
        """Listen to a key from now on."""
        self._inlets[key] = self._transport.subscribe(key, 4096)

    def next(self, topic: Topic[M], key: str) -> M:
        """The next message of a key; fails when none comes."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            sample = self._inlets[key].take()
            if sample is not None:
                return decoder(topic.record)(sample[0])
            self._transport.wait(self._inlets[key])
        raise AssertionError(f"nothing on {key} for {PATIENCE_S} s\n{self.log}")

    def heard(self, topic: Topic[M], key: str) -> list[M]:
        """All messages of a key that came since the last look."""
        return [decoder(topic.record)(sample[0]) for sample in iter(self._inlets[key].take, None)]


def _await_clock_reader(bus: MemoryBus) -> None:
    """The clock is what a loop subscribes to last, so nothing that is sent from then on is missed."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        with bus.changed:
            if any(inlet.pattern == "clock" for inlet in bus.inlets):
                return
        time.sleep(0.001)
    raise AssertionError("the loop does not read the clock")


@contextmanager
def running(service: Service, namespace: str, params: Parameters) -> Iterator[Bench]:
    """Run the service's loop beside the test; on leaving, ask it to end and wait for it."""
    bus, log = MemoryBus(), io.StringIO()
    bench = Bench(bus, log)
    identity = Identity.of(service.name, namespace, ())
    failures: list[BaseException] = []

    with MemoryTransport(bus) as transport:
        node = Node(transport, identity, service.name, Log(identity.node, out=log))

        def loop() -> None:
            try:
                with node:
                    context: Context[Any] = Context(node, params, service.rate)
                    service.entry()(context)
            except Stopped:
                pass
            except BaseException as error:
                failures.append(error)
                raise

        bench.loop = threading.Thread(target=loop)
        bench.loop.start()
        try:
            _await_clock_reader(bus)
            yield bench
        finally:
            node.stopping = True
            transport.nudge()
            bench.loop.join(PATIENCE_S)
    assert not failures
    assert not bench.loop.is_alive()
