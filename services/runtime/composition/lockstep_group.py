"""Lockstep of a container: its nodes form one member, which answers once for all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from services.runtime.errors import BadInput
from services.runtime.heartbeat import Heartbeat, State
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.node import Node
from services.runtime.pacing import Instant, LockstepPacer
from services.runtime.publisher import Publisher, SendBuffer
from services.runtime.subscriber import Subscriber
from services.runtime.transport.api import RawSubscriber, Transport, idle_subscriber


class LockstepGroup:
    """The nodes of a container that step together.

    At the simulation's Go, all of them take their step, in the container's order; the Done is sent after the last. So
    what one publishes in a step, the others receive in the next, as if each were a process of its own.
    """

    def __init__(self, transport: Transport, nodes: Sequence[Node]) -> None:
        self._transport, self._nodes = transport, list(nodes)
        self.send_buffer = SendBuffer()
        self.command_buffer = SendBuffer()
        """The commands of all nodes, which act in the same tick: they are sent together, before the Done."""
        self._pacers: dict[str, GroupedPacer] = {}
        self._period_ns = 0
        self._pacer: LockstepPacer | None = None
        self._idle = idle_subscriber(transport)
        self._busy: set[str] = set()
        """The nodes that have not finished the current step."""
        self._left: list[str] = []
        """The nodes that have ended since the last report."""

    @property
    def raw(self) -> RawSubscriber | None:
        """The subscription of the simulation's Go; None while a node is not ready or has not finished its step."""
        return None if self._pacer is None or self._busy else self._pacer.raw

    def pacer(self, node: Node, period_ns: int, reports_reads: bool) -> GroupedPacer:
        """Create the pacer of a node; raises BadInput if its period differs from that of the others."""
        name = node.identity.node
        if reports_reads:
            raise BadInput(f"{name} subscribes to topics between its ticks: in lockstep it needs a process of its own")
        if self._pacers and period_ns != self._period_ns:
            other = next(iter(self._pacers))
            raise BadInput(
                f"{name} ticks at {1e9 / period_ns:g} Hz and {other} at {1e9 / self._period_ns:g} Hz: nodes that share "
                "a process in lockstep have one rate"
            )
        self._period_ns = period_ns
        made = self._pacers[name] = GroupedPacer(self, name, self._idle)
        return made

    def poll(self) -> None:
        """Begin the step of all nodes if the simulation has granted one."""
        if self._pacer is None or self._busy or (instant := self._pacer.next()) is None:
            return
        watermarks = self._pacer.watermarks
        assert watermarks is not None
        self.command_buffer.begin()
        for name, pacer in self._pacers.items():
            self._busy.add(name)
            pacer.begin(instant, watermarks)
        watermarks.clear_required()

    def start(self, name: str) -> None:
        """Note that a node's inputs are declared, and join lockstep once all are."""
        self._pacers[name].started = True
        self._join()

    def finish(self, name: str) -> None:
        """Note that a node has finished its step; after the last, report Done."""
        self._busy.discard(name)
        if not self._busy and self._pacer is not None:
            self.command_buffer.flush()
            self._pacer.finish(left=tuple(self._left))
            self._left.clear()

    def leave(self, node: Node) -> None:
        """Remove a node whose loop has ended."""
        name = node.identity.node
        self.command_buffer.flush()
        self._nodes = [each for each in self._nodes if each is not node]
        pacer = self._pacers.pop(name, None)
        if self._pacer is None:
            self._join()
        elif not self._pacers:
            self._pacer.close()
        elif pacer is not None:
            self._left.append(name)
            if name in self._busy:
                self.finish(name)

    def _join(self) -> None:
        """Join lockstep as one member once all nodes are ready."""
        if (
            self._pacer is None
            and self._nodes
            and all(
                (pacer := self._pacers.get(each.identity.node)) is not None and pacer.started for each in self._nodes
            )
        ):
            self._pacer = LockstepPacer(_GroupNode(self._transport, self._nodes, self.send_buffer), self._period_ns)
            self._pacer.start()


class GroupedPacer:
    """The pacer of one node of a group."""

    def __init__(self, group: LockstepGroup, name: str, idle: RawSubscriber) -> None:
        self.raw = idle
        self.watermarks: Watermarks | None = Watermarks()
        self.started = False
        self._group, self._name = group, name
        self._instant: Instant | None = None

    def start(self) -> None:
        self._group.start(self._name)

    def begin(self, instant: Instant, watermarks: Watermarks) -> None:
        """Begin a step with the group's watermarks; each node waits for its required samples itself."""
        self._instant = instant
        own = self.watermarks
        assert own is not None
        own.members, own.admitted_upto, own.skipped = watermarks.members, watermarks.admitted_upto, watermarks.skipped
        own.required, own.epoch_changed = watermarks.required, watermarks.epoch_changed

    def next(self) -> Instant | None:
        instant, self._instant = self._instant, None
        return instant

    def finish(self) -> None:
        self._group.finish(self._name)

    def close(self) -> None:
        """Do nothing: the container removes the node from the group when its loop has ended."""


class _GroupNode:
    """The nodes of a group as one member of lockstep."""

    def __init__(self, transport: Transport, nodes: Sequence[Node], send_buffer: SendBuffer) -> None:
        self.transport, self.send_buffer = transport, send_buffer
        self.names = tuple(each.identity.node for each in nodes)
        self.log, self.refusal_counters = nodes[0].log, nodes[0].refusal_counters
        self.clock_patience_s = min(each.clock_patience_s for each in nodes)
        self.heartbeat = _Heartbeats([each.heartbeat for each in nodes])
        self._nodes = tuple(nodes)

    @property
    def subscribers(self) -> list[Subscriber[Any]]:
        return [each for node in self._nodes for each in node.subscribers]

    @property
    def publishers(self) -> list[Publisher[Any]]:
        return [each for node in self._nodes for each in node.publishers]

    @property
    def version(self) -> int:
        return sum(node.version for node in self._nodes)


class _Heartbeats:
    """The heartbeats of several nodes, which share state and detail."""

    def __init__(self, heartbeats: Sequence[Heartbeat]) -> None:
        self._heartbeats = heartbeats

    @property
    def state(self) -> State:
        return self._heartbeats[0].state

    @state.setter
    def state(self, state: State) -> None:
        for each in self._heartbeats:
            each.state = state

    @property
    def detail(self) -> str:
        return self._heartbeats[0].detail

    @detail.setter
    def detail(self, detail: str) -> None:
        for each in self._heartbeats:
            each.detail = detail
