"""The thread that runs a script's node: heartbeat, requests, tokens and time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, Protocol

from messages.base import WrongPayload, decoder, encode
from messages.gazebo import WorldProperties
from messages.names import key as key_of
from messages.requests import WORLD_PROPERTIES
from messages.std import Empty
from services.runtime.node import Node
from services.runtime.pacing import ClockWatchdog, Instant, LockstepPacer
from services.runtime.step import period_of
from services.runtime.transport.api import PendingReplies, idle_subscriber
from services.script.clock import ClockReader, ScriptClock
from services.script.turns import TurnThreads

_read_properties = decoder(WorldProperties)
READY_S = 5.0
"""Run time [s] of a script after which it counts as ready even if it has not waited for anything.

Excludes the time in which other processes keep it from running, as if the machine were idle.
"""
STOP_S = 2.0
"""Wall time [s] to wait for the end of the loop."""
PEERS_S = 20.0
"""Wall time [s] to wait for the tokens of the other members at the first tick; only a member that has died has none."""
_ENDING_POLL_S = 0.005
_ASK_AGAIN_S = 1.0
"""Wall time [s] between two queries for the speed of time that nobody has answered: a replayed bag has no answer."""


class NodeOwner(Protocol):
    """The loop's interface to the kernel that owns it."""

    clock: ScriptClock
    lock_node: AbstractContextManager[Any]
    simulated: bool
    rate: float

    def spin(self) -> None:
        """Answer requests and follow the network; called with the node locked."""
        ...


class SteppingOwner(NodeOwner, Protocol):
    """The lockstep loop's interface to the kernel."""

    turns: TurnThreads

    def roster_seen(self, roster: tuple[str, ...]) -> bool:
        """Return whether everything that these nodes declared before they were ready is known."""
        ...

    def admit(self, reset: bool) -> None:
        """Pass the messages, calls and changes of this tick to their threads."""
        ...

    def send_early(self) -> None:
        """Send the messages published before the first tick."""
        ...

    def idle_until(self) -> int:
        """Return the time [ns] before which nothing is due unless a message arrives; 0 if something may be due at any
        tick.
        """
        ...

    def announce(self, final: bool = False) -> None:
        """Announce this script's publications, subscriptions and services to the other scripts, if
        they have changed.
        """
        ...


class NodeLoop(Protocol):
    """The thread of a script's node."""

    def start(self) -> None:
        """Start it."""
        ...

    def declare_ready(self) -> None:
        """Declare that the script's initial declarations are complete."""
        ...

    def stop(self) -> None:
        """Stop the thread, and send what is still held back."""
        ...


class RealTimeLoop:
    """Follows ``/clock``, or nothing with wall time; messages go directly to the threads of their topics."""

    def __init__(self, kernel: NodeOwner, node: Node) -> None:
        self._kernel, self._node = kernel, node
        self._clock = ClockReader(node, kernel.clock) if kernel.simulated else None
        self._raw = self._clock.raw if self._clock else idle_subscriber(node.transport)
        self._watchdog = ClockWatchdog(node, node.log, "--wall-time runs a script without one")
        self._properties: PendingReplies | None = None
        self._thread = threading.Thread(target=self._run, name="node", daemon=True)
        self._ready = self._stopping = self._factor_known = False
        self._factor_due = 0.0
        self._script_time = OwnTime(threading.main_thread())

    def start(self) -> None:
        self._thread.start()

    def declare_ready(self) -> None:
        if not self._ready:
            self._ready = True
            with self._kernel.lock_node:
                if self._kernel.simulated:
                    self._node.declare_stepping(period_of(self._kernel.rate, False))
                else:
                    self._node.declare_ready()

    def stop(self) -> None:
        self._stopping = True
        self._node.transport.wake()
        self._thread.join(STOP_S)

    def _run(self) -> None:
        while not self._stopping:
            with self._kernel.lock_node:
                self._spin()
            self._node.transport.wait(self._raw)
            if self._clock is None:
                self._raw.recv()
                self._node.heartbeat.state = "running"
            elif self._clock.update():
                self._follow_factor()
                self._node.heartbeat.ticks += 1
                self._watchdog.note_sample(self._kernel.clock.paused)
            else:
                self._watchdog.check()

    def _follow_factor(self) -> None:
        """Query the speed of simulation time from the simulation, until it has answered."""
        if self._factor_known:
            return
        if self._properties is None:
            if time.monotonic() < self._factor_due:
                return
            self._factor_due = time.monotonic() + _ASK_AGAIN_S
            key = key_of(WORLD_PROPERTIES.name)
            self._properties = self._node.transport.query_async(key, encode(Empty()), STOP_S)
        elif (replies := self._properties.poll()) is not None:
            self._properties = None
            for each in replies:
                if each.ok:
                    self._factor_known = True
                    with suppress(WrongPayload):
                        self._kernel.clock.factor = _read_properties(each.payload).factor

    def _spin(self) -> None:
        self._node.spin_once()
        self._kernel.spin()
        if not self._ready and self._script_time.exceeds(READY_S):
            self.declare_ready()


class LockstepLoop:
    """Steps with the simulation: at each of its ticks the script's threads take their turns.

    It joins when the script first waits, or ends: by then the script has declared its subscriptions.
    """

    def __init__(self, kernel: SteppingOwner, node: Node) -> None:
        self._kernel, self._node, self._turns = kernel, node, kernel.turns
        self._thread = threading.Thread(target=self._run, name="node", daemon=True)
        self._last: Instant | None = None
        self._epoch = 0
        self._stopping = self._awaits_no_ticks = self._left = False
        self._pacer: LockstepPacer | None = None

    def start(self) -> None:
        self._thread.start()

    def declare_ready(self) -> None:
        pass

    def stop(self) -> None:
        self._stopping = True
        self._turns.retire_main()
        self._node.transport.wake()
        while self._thread.is_alive():
            self._thread.join(0.1)

    def stop_awaiting_ticks(self) -> None:
        """Wait for no further tick: the process was asked to end."""
        self._awaits_no_ticks = True
        self._node.transport.wake()

    def _run(self) -> None:
        self._turns.adopt()
        self._turns.wait_for_turn(self._spin)
        with self._kernel.lock_node:
            self._kernel.announce()
            pacer = LockstepPacer(self._node, period_of(self._kernel.rate, True), reports_reads=True)
            pacer.start()
        self._pacer = pacer  # kept: closing it removes the token that makes this node a member
        try:
            while not self._done():
                self._spin()
                if (instant := pacer.next()) is not None:
                    self._tick(pacer, instant)
                elif self._awaits_no_ticks:
                    self._turns.run(self._spin)
                    time.sleep(_ENDING_POLL_S)
                else:
                    self._node.transport.wait(pacer.raw)
        finally:
            with self._kernel.lock_node:
                self._kernel.send_early()
                self._kernel.announce(final=True)
                self._node.send_buffer.flush()
                if not self._left:
                    pacer.close()

    def _done(self) -> bool:
        """Return whether the script has ended; its messages count once a tick has reported them."""
        return self._left or (self._stopping and self._awaits_no_ticks)

    def _tick(self, pacer: LockstepPacer, instant: Instant) -> None:
        last = self._last
        reset = last is not None and (instant.epoch, instant.simulation) != (last.epoch, last.simulation)
        if last is None:
            self._await_peers(pacer.roster)
        self._last = instant
        self._epoch += reset
        with self._kernel.lock_node:
            self._kernel.clock.set(instant.time, self._epoch)
            self._node.update_subscribers(pacer.watermarks)
            self._kernel.admit(reset)
        self._turns.run(self._spin)
        with self._kernel.lock_node:
            self._node.heartbeat.ticks += 1
            self._left = self._stopping
            self._kernel.announce(final=self._left)
            pacer.finish(leaving=self._left, idle_until=0 if self._stopping else self._kernel.idle_until())

    def _await_peers(self, roster: tuple[str, ...]) -> None:
        """Wait for everything that the other members declared before they were ready, which may
        arrive slightly later.
        """
        deadline = time.monotonic() + PEERS_S
        while not self._kernel.roster_seen(roster) and time.monotonic() < deadline:
            self._spin()
            time.sleep(0.005)

    def _spin(self) -> None:
        with self._kernel.lock_node:
            self._node.spin_once()
            self._kernel.spin()


class OwnTime:
    """Wall time since creation, without the time in which ``thread`` was ready to run and waited for a processor.

    Args:
        thread: A thread of this process.
        now: The wall clock [s].
        delay: Returns how long the thread has waited for a processor so far [s].
    """

    def __init__(
        self,
        thread: threading.Thread,
        now: Callable[[], float] = time.monotonic,
        delay: Callable[[threading.Thread], float] | None = None,
    ) -> None:
        self._thread, self._now, self._delay = thread, now, delay or run_delay
        self._began, self._delayed = self._now(), self._delay(thread)

    def exceeds(self, seconds: float) -> bool:
        """Return whether more than ``seconds`` have passed."""
        elapsed = self._now() - self._began
        return elapsed > seconds and elapsed - (self._delay(self._thread) - self._delayed) > seconds


def run_delay(thread: threading.Thread) -> float:
    """Return how long a thread has waited for a processor [s]; 0 on systems that, unlike Linux, do not report it."""
    try:
        return int(Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0
