"""Test a service: its loop runs in a thread, on a network in memory; the test provides sensor data and the clock.

    with run_service("my_controller.py", "/tb3_0") as service:
        service.publish(ODOM, Odometry())
        service.set_time(0.04)
        assert service.next(CMD_VEL).linear.x > 0

A tick sees all messages published before the ``set_time`` that causes it, and is finished when that returns.
"""

from __future__ import annotations

import io
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeVar

from messages.base import Message, decoder
from messages.names import Identity
from messages.requests import Request
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, Topic
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.graph import Entity
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.validation import build
from services.runtime.publisher import Publisher
from services.runtime.requests import call
from services.runtime.service import Run, Service, load_user_service
from services.runtime.transport.api import Token
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import unpack_attachment

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

WITHIN_S = 30.0
"""Wall time [s] that the harness waits for the service before it fails."""
_QUEUE_SIZE = 1 << 16


class ServiceHarness:
    """The test's connection to a running service. Topics are resolved in the service's namespace: ODOM is its robot's
    odometry, ``ODOM.of("tb3_1")`` that of another robot."""

    def __init__(self, bus: MemoryBus, service: MemoryTransport, identity: Identity, log: io.StringIO) -> None:
        self._transport, self._service, self._identity, self._log = MemoryTransport(bus), service, identity, log
        self._publishers: dict[str, Publisher[Any]] = {}
        self._own: set[bytes] = set()
        self._everything = self._transport.subscribe("**", _QUEUE_SIZE)
        self._received: dict[str, deque[bytes]] = {}
        self._loop: threading.Thread | None = None

    @property
    def log(self) -> str:
        """The service's log, including debug lines."""
        return self._log.getvalue()

    def publish(self, topic: Topic[M], message: M) -> None:
        """Publish a message to the service."""
        key = self._identity.key(topic.name)
        if key not in self._publishers:
            made = Publisher(topic, f"/{key}", key, topic.only or "/test", self._transport)
            self._publishers[key] = made
            self._own.add(made.publisher)
        self._publishers[key].publish(message)
        self._receive()

    def set_time(self, seconds: float, epoch: int = 0, paused: bool = False) -> None:
        """Set simulation time to ``seconds`` and wait for the tick, if it is due. A new epoch is a reset.

        A loop ticks when time reaches a multiple of its period. Raises AssertionError if it takes longer than WITHIN_S.
        """
        self.publish(CLOCK, Clock(clock=Time.of(round(seconds * 1e9)), epoch=epoch, paused=paused))
        self._settle()

    def next(self, topic: Topic[M], within: float = WITHIN_S) -> M:
        """Return the service's oldest message on a topic that was not returned yet.

        Args:
            topic: the topic on which the service publishes it.
            within: wall time to wait for it [s].

        Raises:
            AssertionError: none was published in time; the text has the service's log.
        """
        key, deadline = self._identity.key(topic.name), time.monotonic() + within
        while True:
            running = self.running
            self._receive()
            if waiting := self._received.get(key):
                return decoder(topic.record)(waiting.popleft())
            assert running, f"the service has ended, and there is nothing on /{key}\n{self.log}"
            assert time.monotonic() < deadline, f"nothing on /{key} for {within:g} s\n{self.log}"
            self._transport.wait(self._everything)

    def drain(self, topic: Topic[M]) -> list[M]:
        """Return all messages of the service on a topic that were not returned yet, oldest first."""
        self._settle()
        self._receive()
        taken = self._received.pop(self._identity.key(topic.name), ())
        return [decoder(topic.record)(payload) for payload in taken]

    def call(self, request: Request[Q, R], message: Q, name: str | None = None) -> R:
        """Call a request of the service, by another name if one is given; raises CallFailed."""
        return call(self._transport, request, self._identity.key(name or request.name), message, WITHIN_S)

    def join(self, topic: Topic[Any], kind: Literal["sub", "pub"] = "sub") -> Token:
        """Declare a subscriber or publisher of a topic that the service can see, until the token is closed."""
        name = self._identity.resolve(topic.name)
        entity = Entity(self._transport.session, kind, "/test", name, topic.record.ROS_TYPE, topic.quality.name)
        return self._transport.declare_token(entity.key)

    def reads(self, topic: Topic[Any]) -> bool:
        """Return whether the service subscribes to a topic."""
        return self._identity.key(topic.name) in self._transport.subscribed()

    @property
    def running(self) -> bool:
        """Whether the loop is running."""
        return self._loop is not None and self._loop.is_alive()

    def wait_end(self, within: float = WITHIN_S) -> None:
        """Wait for a loop that ends on its own; raises AssertionError if it does not ``within`` that wall time [s]."""
        assert self._loop is not None
        self._loop.join(within)
        assert not self._loop.is_alive(), f"the loop has not ended within {within:g} s\n{self.log}"

    def start(self, loop: threading.Thread, ticks: bool) -> None:
        """Start the loop, and wait until it has ended or is waiting: for its first tick, if it ``ticks``."""
        self._loop = loop
        loop.start()
        self._settle()
        deadline = time.monotonic() + WITHIN_S
        while ticks and self.running and not self.reads(CLOCK):
            assert time.monotonic() < deadline, f"the loop has not called ctx.ticks()\n{self.log}"
            time.sleep(0.001)

    def _settle(self) -> None:
        """Wait until the loop has nothing left to do, or has ended."""
        deadline = time.monotonic() + WITHIN_S
        while self.running and not self._service.wait_idle(0.02):
            assert time.monotonic() < deadline, f"the loop is busy for {WITHIN_S:g} s\n{self.log}"

    def _receive(self) -> None:
        for payload, attachment, source in iter(self._everything.recv, None):
            origin = unpack_attachment(attachment)
            if origin is None or origin.publisher not in self._own:
                self._received.setdefault(self._everything.key(source), deque()).append(payload)


@contextmanager
def run_service(
    service: Service | Run | str | Path,
    namespace: str = "/",
    params: Parameters | Mapping[str, Any] | None = None,
    rate: float | None = None,
) -> Iterator[ServiceHarness]:
    """Run a service in a thread; on exit, ask it to end and wait for it.

    Args:
        service: the declaration, a bare loop, or the Python file that calls ``main``; the file is loaded again each
            time, as in a new process.
        namespace: the namespace of its relative names, such as "/tb3_0".
        params: its parameters, or the values of those that differ from their defaults.
        rate: the rate [Hz] of a bare loop.

    Raises:
        Exception: an error of the loop, raised again on exit.
        BadInput: a parameter is out of bounds.
    """
    if isinstance(service, str | Path):
        folder = str(Path(service).resolve().parent)
        if folder not in sys.path:
            sys.path.append(folder)  # its loop may import more from there
        service = load_user_service.__wrapped__(str(service))
    elif not isinstance(service, Service):
        service = Service(name="controller", about="", run=service, rate=rate)
    given = params if isinstance(params, Parameters) else build(service.parameters, params or {})
    entry, declared_rate = service.entry(), service.rate
    bus, log, failures = MemoryBus(), io.StringIO(), list[BaseException]()
    identity = Identity.of(service.name, namespace)
    with MemoryTransport(bus) as transport:
        harness = ServiceHarness(bus, transport, identity, log)
        node = Node(transport, identity, service.name, Log(identity.node, "debug", log))

        def loop() -> None:
            try:
                with node:
                    entry(Context(node, given, declared_rate))
            except Stopped:
                pass
            except BaseException as error:  # noqa: BLE001 - whatever it is, the test raises it
                failures.append(error)

        try:
            harness.start(threading.Thread(target=loop, daemon=True), declared_rate is not None)
            yield harness
        finally:
            node.stopping = True
            transport.wake()
            if not failures:
                harness.wait_end()
            if failures:
                raise failures[0]
