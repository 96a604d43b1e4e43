"""The two time modes: real time (the wall clock times a factor), and lockstep with the members."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Protocol

from messages.topics import LOCKSTEP
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.node import Node
from services.sim.robot_topics import CONTROL_STEPS
from services.sim.simulation import Simulation

MAX_LAG_S = 0.1
"""Wall time by which real time may lag; beyond it, the lag is dropped instead of made up for."""
MAX_SLEEP_S = 0.1
"""Longest sleep in one wait: at a low factor, a tick takes seconds of wall time."""


class TimeMode(Protocol):
    """Decides when the simulation takes its next tick."""

    watermarks: Watermarks | None
    factor: float

    def begin(self, absent: Collection[str], meanwhile: Callable[[], None]) -> None:
        """Block until time may start.

        Args:
            absent: Members not to wait for.
            meanwhile: Called repeatedly while waiting for members.
        """
        ...

    @property
    def due(self) -> bool:
        """Whether to wait for this tick and to read inputs at it."""
        ...

    def flush(self) -> None:
        """Send what was published, unless it is to leave in one burst with what ``wait`` sends at this tick."""
        ...

    def wait(self, interrupted: Callable[[], bool]) -> bool:
        """Block until this tick may be taken.

        Returns:
            False if ``interrupted`` became true first, or after MAX_SLEEP_S; the next call continues the wait.
        """
        ...

    def resync(self) -> None:
        """Adapt to a pause, a resume, a reset, or the start of requested steps."""
        ...

    def set_factor(self, factor: float) -> None:
        """Set the simulated seconds per second of wall time, if the mode has such a factor."""
        ...


class RealTime:
    """Follows the wall clock times a factor; time that the machine cannot keep up with is lost, not made up for.

    ``on_lag`` is called with the wall time [s] lost, each time that happens.
    """

    watermarks: Watermarks | None = None

    def __init__(
        self, simulation: Simulation, node: Node, factor: float, on_lag: Callable[[float], None] | None = None
    ) -> None:
        self._simulation, self._node, self.factor, self._on_lag = simulation, node, factor, on_lag
        self.resync()

    def begin(self, absent: Collection[str], meanwhile: Callable[[], None]) -> None:
        self.resync()

    @property
    def due(self) -> bool:
        return self._simulation.tick % self._simulation.input_steps == 0

    def flush(self) -> None:
        self._node.send_buffer.flush()

    def wait(self, interrupted: Callable[[], bool]) -> bool:
        ahead = self._wall_start + (self._simulation.now - self._sim_start) / 1e9 / self.factor - time.monotonic()
        if ahead > MAX_SLEEP_S:
            # The loop answers requests and heartbeats in between.
            time.sleep(MAX_SLEEP_S)
            return False
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
    """Waits at each tick for the members that are due.

    With ``latency`` 1 they compute while the physics steps, until they are due again.
    """

    factor = 1.0

    def __init__(self, simulation: Simulation, node: Node, members: tuple[str, ...], latency: int) -> None:
        self._simulation, self._node, self._latency = simulation, node, latency
        self._barrier = Barrier(
            node.transport,
            node.send_buffer,
            members,
            node.log,
            node.wait,
            self._join_reply,
            simulation.subscriptions,
        )
        node.refusal_counters.append(self._barrier.refusals)
        node.request_server.gate = self._barrier
        self.watermarks: Watermarks | None = self._barrier.watermarks
        self._state_publisher, self._published_version = node.advertise(LOCKSTEP), -1

    def begin(self, absent: Collection[str], meanwhile: Callable[[], None]) -> None:
        self._node.heartbeat.state = "waiting"
        self._node.heartbeat.detail = "time has not begun: waiting for the members of lockstep"
        self._barrier.wait_for_members(absent, meanwhile)
        self._node.heartbeat.detail = ""

    @property
    def due(self) -> bool:
        return self._control or self._barrier.due(self._simulation.now)

    def flush(self) -> None:
        # One burst with the grants of this tick: each member wakes once.
        if not self.due:
            self._node.send_buffer.flush()

    def wait(self, interrupted: Callable[[], bool]) -> bool:
        barrier, now = self._barrier, self._simulation.now
        due = barrier.due(now)
        if self._control:
            barrier.update()
        try:
            return not due or self._step_members(now, interrupted)
        finally:
            self._node.send_buffer.flush()

    def resync(self) -> None:
        # A resume or a reset shows in the next grant; to a member, any grant that is not paused is a step.
        if self._simulation.paused:
            self._barrier.announce(self._step_grant(paused=True))

    def set_factor(self, factor: float) -> None:
        pass

    @property
    def _control(self) -> bool:
        return self._simulation.tick % CONTROL_STEPS == 0

    def _step_members(self, now: int, interrupted: Callable[[], bool]) -> bool:
        # With latency 1, or after an interrupted wait, reports of earlier steps are still outstanding.
        if not self._barrier.collect_reports(now, interrupted):
            return False
        self._grant()
        return bool(self._latency) or self._barrier.collect_reports(now, interrupted)

    def _grant(self) -> None:
        if self._barrier.version != self._published_version:
            self._published_version = self._barrier.version
            self._state_publisher.publish(self._barrier.state)
        # Not paused: to a member, steps requested during a pause are steps like any other.
        self._barrier.grant(self._step_grant(paused=False), self._node.publishers)
        self.resync()

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
