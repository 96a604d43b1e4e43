"""Runs teleop's loops in a thread on the in-memory transport; the test plays keyboard, base and simulation."""

from __future__ import annotations

import io
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Self

from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped
from messages.names import Identity
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, ODOM, Topic
from services.runtime.context import Context
from services.runtime.errors import EleaError, Stopped
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.teleop import SERVICE, TeleopParameters
from services.teleop.keys import KeyEvent
from services.teleop.screen import View
from tests.harness.waiting import wait_until

Loop = Callable[[Context[TeleopParameters]], None]


class FakeKeyboard:
    """A keyboard operated by the test."""

    def __init__(self) -> None:
        self._struck: deque[str] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        pass

    def press(self, key: str) -> None:
        self._struck.append(key)

    def read_events(self, within: float) -> list[KeyEvent]:
        deadline = time.monotonic() + within
        while not self._struck and time.monotonic() < deadline:
            time.sleep(0.001)
        now = time.monotonic()
        return [KeyEvent(self._struck.popleft(), now) for _ in range(len(self._struck))]


class FakeDisplay:
    """A display that keeps the last view."""

    def __init__(self) -> None:
        self.view: View | None = None

    def print_header(self, topic: str) -> None:
        pass

    def update(self, view: View, wall: float) -> None:
        self.view = view


class LoopHarness:
    """A base in ``/p3dx`` and the clock, played by the test."""

    def __init__(self, bus: MemoryBus, stamped: bool) -> None:
        identity = Identity.of("sim")
        self._node = Node(MemoryTransport(bus), identity, "sim", Log(identity.node, out=io.StringIO()))
        self._topic: Topic[Any] = CMD_VEL if not stamped else Topic("cmd_vel", TwistStamped, 25, CMD_VEL.quality, "")
        self.log = io.StringIO()
        self.ended = False
        self.driver: Node | None = None

    def __enter__(self) -> Self:
        node = self._node.__enter__()
        self._clock = node.advertise(CLOCK)
        self._status = node.advertise(BASE_STATUS, "/p3dx/base_status")
        node.advertise(ODOM, "/p3dx/odom")
        self._commands = node.subscribe(self._topic, "/p3dx/cmd_vel")
        return self

    def __exit__(self, *exception: object) -> None:
        self._node.__exit__()

    def publish_clock(self, seconds: float, epoch: int = 0, paused: bool = False) -> None:
        """Publish the simulation time ``seconds``."""
        self._clock.publish(Clock(clock=Time.of(round(seconds * 1e9)), epoch=epoch, paused=paused))

    def tick(self, seconds: float, epoch: int = 0) -> None:
        """Publish the simulation time ``seconds`` and wait until the loop has run the tick."""
        assert self.driver is not None
        before = self.driver.heartbeat.ticks
        self.publish_clock(seconds, epoch)
        wait_until(lambda: self.ended or self.driver.heartbeat.ticks > before, 20.0, f"the tick at {seconds} s")  # type: ignore[union-attr]

    def publish_status(self, status: BaseStatus) -> None:
        """Publish the base's status."""
        self._status.publish(status)

    def received_commands(self) -> list[Any]:
        """Return the commands received since the last call."""
        self._commands.update()
        return [message for message, _ in self._commands.messages]

    def wait_for_command(self, wanted: Twist, what: str = "") -> None:
        """Wait until this command arrives."""
        wait_until(lambda: wanted in self.received_commands(), 20.0, what or str(wanted))


@contextmanager
def run_loop(loop: Loop, params: TeleopParameters, stamped: bool = False) -> Iterator[LoopHarness]:
    """Run a loop in a thread, on a network that already has the base; stop it at the end and raise its EleaError."""
    bus = MemoryBus()
    failures: list[EleaError] = []
    with LoopHarness(bus, stamped) as rig, MemoryTransport(bus) as transport:
        identity = Identity.of("teleop", "/p3dx")
        node = rig.driver = Node(transport, identity, "teleop", Log(identity.node, out=rig.log))

        def live() -> None:
            try:
                with node:
                    loop(Context(node, params, SERVICE.rate))
            except Stopped:
                pass
            except EleaError as error:
                failures.append(error)
            finally:
                rig.ended = True

        thread = threading.Thread(target=live)
        thread.start()
        try:
            wait_until(lambda: failures or _reads_clock(bus), 20.0, "a loop that reads the clock")
            yield rig
        finally:
            node.stopping = True
            transport.wake()
            thread.join(20.0)
    assert not thread.is_alive()
    for error in failures:
        raise error


def _reads_clock(bus: MemoryBus) -> bool:
    with bus.changed:
        return any(inlet.pattern == "clock" for inlet in bus.subscribers)
