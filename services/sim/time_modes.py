"""The two modes of time: real time (the wall clock times a factor), and lockstep with the members."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Protocol

from messages.topics import LOCKSTEP
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.node import Node
from services.sim.simulation import CONTROL_STEPS, Simulation

MAX_LAG_S = 0.1
"""Wall time by which real time may lag before it gives up catching up."""


class TimeMode(Protocol):
    """Holds the simulation at a tick until it may go on."""

    watermarks: Watermarks | None
    factor: float

    def begin(self, absent: Collection[str] = ()) -> None:
        """Block until time may start; nobody waits for the nodes that are ``absent``."""
        ...

    def wait(self) -> bool:
        """Send what the stage has told, wait as long as this tick asks for; True when commands are to be taken now."""
        ...

    def resync(self) -> None:
        """Time was paused, stepped or set anew."""
        ...

    def set_factor(self, factor: float) -> None:
        """Let time run at another factor, where there is one."""
        ...


class RealTime:
    """With the wall clock times a factor; what the machine cannot keep up with is lost, not made up for.

    ``on_lag`` is called with the wall time [s] lost, each time that happens.
    """

    watermarks: Watermarks | None = None

    def __init__(
        self, simulation: Simulation, node: Node, factor: float, on_lag: Callable[[float], None] | None = None
    ) -> None:
        self._simulation, self._node, self.factor, self._on_lag = simulation, node, factor, on_lag
        self.resync()

    def begin(self, absent: Collection[str] = ()) -> None:
        self.resync()

    def wait(self) -> bool:
        self._node.send_buffer.flush()
        if self._simulation.tick % self._simulation.input_steps:
            return False
        self._node.spin_once()
        ahead = self._wall_start + (self._simulation.now - self._sim_start) / 1e9 / self.factor - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)
        elif ahead < -MAX_LAG_S:
            self._node.log.warn(f"simulation lags by {-ahead:.1f} s: the machine is too slow or busy", every=10.0)
            if self._on_lag is not None:
                self._on_lag(-ahead)
            self.resync()
        return True

    def resync(self) -> None:
        self._wall_start, self._sim_start = time.monotonic(), self._simulation.now

    def set_factor(self, factor: float) -> None:
        if factor != self.factor:
            self.factor = factor
            self.resync()


class Lockstep:
    """Waits at each tick for the members that are due; with ``latency`` 1 they compute
    while the physics steps, until they are due again."""

    factor = 1.0

    def __init__(self, simulation: Simulation, node: Node, members: tuple[str, ...], latency: int) -> None:
        self._simulation, self._node, self._latency = simulation, node, latency
        self._barrier = Barrier(node.transport, node.send_buffer, members, node.log, node.wait, self._join_reply)
        node.refusal_counters.append(self._barrier.refusals)
        self.watermarks: Watermarks | None = self._barrier.watermarks
        self._state_publisher, self._published_version = node.advertise(LOCKSTEP), -1
        self._step_granted = False
        self._last_granted = -1, -1

    def begin(self, absent: Collection[str] = ()) -> None:
        self._node.heartbeat.state = "waiting"
        self._node.heartbeat.detail = "time has not begun: waiting for the members of lockstep"
        self._barrier.wait_for_members(absent)
        self._node.heartbeat.detail = ""

    def wait(self) -> bool:
        try:
            return self._wait()
        finally:
            self._node.send_buffer.flush()

    def _wait(self) -> bool:
        # While it waits, a request may take single steps, each with a wait of its own; no tick is released twice.
        tick_id = self._tick_id
        due = self._barrier.due(self._simulation.now)
        control = self._simulation.tick % CONTROL_STEPS == 0
        if control:
            self._node.spin_once()
            self._barrier.update()
        if not due:
            return control
        if self._step_granted:
            self._barrier.collect_reports(self._simulation.now)
        if self._tick_id != tick_id:
            return control
        if self._last_granted != tick_id:
            self._last_granted = tick_id
            if self._barrier.version != self._published_version:
                self._published_version = self._barrier.version
                self._state_publisher.publish(self._barrier.state)
            # Also while single steps are taken in a pause.
            self._barrier.grant(self._step_grant(paused=False), self._node.publishers)
            self._step_granted = bool(self._latency)
        if not self._latency:
            self._barrier.collect_reports(self._simulation.now)
        # A pause may have been told before this tick's leave, which a member takes for time that goes on.
        self.resync()
        return True

    def resync(self) -> None:
        # Of all else the next step tells; whatever is not paused, a member takes as one.
        if self._simulation.paused:
            self._barrier.announce(self._step_grant(paused=True))

    def set_factor(self, factor: float) -> None:
        pass

    @property
    def _tick_id(self) -> tuple[int, int]:
        return self._simulation.epoch, self._simulation.tick

    def _join_reply(self) -> StepGrant:
        return self._step_grant(self._simulation.paused)

    def _step_grant(self, paused: bool) -> StepGrant:
        simulation = self._simulation
        return StepGrant(
            simulation=self._node.transport.session,
            tick=simulation.tick,
            time=simulation.now,
            epoch=simulation.epoch,
            paused=paused,
        )
