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
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.publisher import Publisher
from services.runtime.service import Service
from services.runtime.transport.memory import MemoryBus, MemoryTransport

M = TypeVar("M", bound=Message)
WITHIN_S = 30.0


class ServiceHarness:
    """The test's side of the bus."""

    def __init__(self, bus: MemoryBus, log: io.StringIO) -> None:
        self._transport = MemoryTransport(bus)
        self._outputs: dict[str, Publisher[Any]] = {}
        self._inlets: dict[str, Any] = {}
        self._log = log
        self.thread: threading.Thread | None = None

    @property
    def log(self) -> str:
        """What the service has logged."""
        return self._log.getvalue()

    def publish(self, topic: Topic[M], key: str, message: M) -> None:
        """Publish on a key."""
        if key not in self._outputs:
            self._outputs[key] = Publisher(topic, f"/{key}", key, "/test", self._transport)
        self._outputs[key].publish(message)

    def publish_clock(self, seconds: float, epoch: int = 0) -> None:
        """Let simulation time be ``seconds``."""
        self.publish(CLOCK, "clock", Clock(clock=Time.of(round(seconds * 1e9)), epoch=epoch))

    def has_subscriber(self, key: str) -> bool:
        """Whether the service listens to a key on which something was sent."""
        return self._outputs[key].has_subscribers

    def subscribe(self, topic: Topic[M], key: str) -> None:
        """Listen to a key from now on."""
        self._inlets[key] = self._transport.subscribe(key, 4096)

    def wait_message(self, topic: Topic[M], key: str) -> M:
        """The next message of a key; fails when none comes."""
        deadline = time.monotonic() + WITHIN_S
        while time.monotonic() < deadline:
            sample = self._inlets[key].recv()
            if sample is not None:
                return decoder(topic.record)(sample[0])
            self._transport.wait(self._inlets[key])
        raise AssertionError(f"nothing on {key} for {WITHIN_S} s\n{self.log}")

    def received(self, topic: Topic[M], key: str) -> list[M]:
        """All messages of a key that came since the last look."""
        return [decoder(topic.record)(sample[0]) for sample in iter(self._inlets[key].recv, None)]


def _wait_for_clock_subscriber(bus: MemoryBus) -> None:
    """The clock is what a loop subscribes to last, so nothing that is sent from then on is missed."""
    deadline = time.monotonic() + WITHIN_S
    while time.monotonic() < deadline:
        with bus.changed:
            if any(inlet.pattern == "clock" for inlet in bus.subscribers):
                return
        time.sleep(0.001)
    raise AssertionError("the loop does not read the clock")


@contextmanager
def run_service(service: Service, namespace: str, params: Parameters) -> Iterator[ServiceHarness]:
    """Run the service's loop beside the test; on leaving, ask it to end and wait for it."""
    bus, log = MemoryBus(), io.StringIO()
    bench = ServiceHarness(bus, log)
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

        bench.thread = threading.Thread(target=loop)
        bench.thread.start()
        try:
            _wait_for_clock_subscriber(bus)
            yield bench
        finally:
            node.stopping = True
            transport.wake()
            bench.thread.join(WITHIN_S)
    assert not failures
    assert not bench.thread.is_alive()
