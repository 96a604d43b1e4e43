"""The supervisor's node: heartbeats, requests, and the services' reports about the run."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial

from deploy.fleet import ChangeConfig
from deploy.report.record import ChangeFigures
from deploy.supervisor.supervisor import ActionHandler, ProcessAction
from messages.elea import Check, FleetState, Health
from messages.names import Identity
from messages.parameters import ParameterValues, ScheduledChange, ScheduledChanges
from messages.requests import SUPERVISOR_RESTART, SUPERVISOR_START, SUPERVISOR_STOP, Done, Name
from messages.simulation import SimStatus
from messages.topics import CHECKS, FLEET_STATE, HEALTH, SCHEDULE, SIM_STATUS, UPDATES
from services.runtime.discovery import DIRECTORY_KEY
from services.runtime.errors import TryAgain
from services.runtime.graph import Entity, token_pattern
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.subscriber import QUEUE_SIZE
from services.runtime.transport.api import PendingReplies
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration

END_MARGIN_S = 1.0
"""Simulation time before the end of a run in which a scheduled change may happen without being reported."""


class RunMonitor:
    """Collects the outcome of scheduled changes. One reported as not made stays so until a reset."""

    def __init__(self) -> None:
        self._epoch = 0
        self._changes: dict[int, ScheduledChange] = {}
        self._statuses: dict[bytes, SimStatus] = {}
        self._reported: set[str] = set()

    def on_scheduled_changes(self, report: ScheduledChanges) -> None:
        """Add a report of the parameter service. A restarted one reports only since its start."""
        if report.epoch != self._epoch:
            self._epoch, self._changes = report.epoch, {}
        for each in report.changes:
            known = self._changes.get(each.number)
            if known is None or known.made:
                self._changes[each.number] = each

    def on_sim_status(self, publisher: bytes, status: SimStatus) -> None:
        """Add a report of a simulation; after a restart, the earlier reports still count."""
        self._statuses[publisher] = status

    @property
    def absent_nodes(self) -> tuple[str, ...]:
        """The nodes that were not ready when simulation time began."""
        return tuple(sorted({name for status in self._statuses.values() for name in status.absent}))

    @property
    def lag_s(self) -> float:
        """Wall time [s] by which the simulation fell behind."""
        return sum(status.lag for status in self._statuses.values())

    def change_figures(self, scheduled: Sequence[ChangeConfig], end_s: float) -> tuple[ChangeFigures, ...]:
        """Return the outcome of the scheduled changes in a run that ended at ``end_s`` of simulation time."""
        return tuple(self._figures(*each, end_s) for each in enumerate(_in_order(scheduled)))

    def new_problems(self, scheduled: Sequence[ChangeConfig]) -> Iterator[str]:
        """Return a line for each problem since the last call."""
        lines = [f"time began without {', '.join(self.absent_nodes)}: see ./elea logs"] if self.absent_nodes else []
        for number, change in enumerate(_in_order(scheduled)):
            report = self._changes.get(number)
            if report is not None and not report.made:
                lines.append(f"the change of {change.set} scheduled at {change.at:g} s was not made: {report.reason}")
        for line in lines:
            if line not in self._reported:
                self._reported.add(line)
                yield line

    def _figures(self, number: int, change: ChangeConfig, end_s: float) -> ChangeFigures:
        report = self._changes.get(number)
        made, at, reason = (report.made, report.time.ns / 1e9, report.reason) if report else (None, None, "")
        if report is None and change.at + END_MARGIN_S < end_s:
            made, reason = False, "the parameter service did not report on it: has a node announced its set?"
        elif report is None:
            reason = f"the run ended at {end_s:g} s"
        return ChangeFigures(
            at_s=change.at,
            set=change.set,
            values=change.values,
            made=made,
            made_at_s=at if made else None,
            reason=reason,
        )


def _in_order(scheduled: Sequence[ChangeConfig]) -> list[ChangeConfig]:
    """Return the changes in the order in which the parameter service numbers them."""
    return sorted(scheduled, key=lambda each: each.at)


ROUTER_TIMEOUT_S = 1.0
"""Wall time to wait for the router's answer."""
RECENT_S = 2.5
"""Wall time for which an answer of the router, or a flood, counts as recent."""

_REQUESTS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}

_DRAIN_TIMEOUT_S = 5.0
"""Wall time [s] to wait for the last messages of ended processes; reached only where something is stuck."""

_MAX_UNKNOWN_NODES = 16


class SupervisorNode:
    """Implements FleetBus on a node."""

    def __init__(self, node: Node, sets: Iterable[str] = (), members: Iterable[str] = ()) -> None:
        self._node, self._members = node, frozenset(members)
        self._own: dict[str, tuple[Check, ...]] = {}
        self._unknown_nodes: set[str] = set()
        self._checks = node.subscribe(CHECKS)
        self._sets = {name: node.subscribe(UPDATES, f"{name}/parameter_updates") for name in sets}
        self._parameters: dict[str, ParameterValues] = {}
        self._schedule, self._status = node.subscribe(SCHEDULE), node.subscribe(SIM_STATUS)
        self._monitor = RunMonitor()
        self._health = node.subscribe(HEALTH)
        self._state = node.advertise(FLEET_STATE)
        self._action_handler: ActionHandler | None = None
        self._pending_query: PendingReplies | None = None
        self._answered = self._flood = -RECENT_S
        self.delay_s = 0.0
        actions: tuple[ProcessAction, ...] = ("start", "stop", "restart")
        for action in actions:
            node.serve(_REQUESTS[action], partial(self._handle_action, action))
        node.heartbeat.state = "running"

    def heartbeats(self) -> Sequence[Health]:
        self.checks()
        health = self._health
        before = health.received + health.refused + health.repeated
        health.update()
        if health.received + health.refused + health.repeated - before >= QUEUE_SIZE:
            self._flood = time.monotonic()
        wall = time.time_ns()
        known = [origin for beat, origin in health.messages if origin is not None and beat.node in self._members]
        self.delay_s = max((wall - each.source_ns for each in known), default=0) / 1e9
        return [beat for beat, _ in health.messages]

    @property
    def flooded(self) -> bool:
        return time.monotonic() - self._flood < RECENT_S

    def router_answers(self) -> bool:
        if self._pending_query is None:
            self._pending_query = self._node.transport.query_async(DIRECTORY_KEY, b"", ROUTER_TIMEOUT_S)
        elif (replies := self._pending_query.poll()) is not None:
            self._pending_query = None
            if any(each.ok for each in replies):
                self._answered = time.monotonic()
        return time.monotonic() - self._answered < RECENT_S

    def parameters(self) -> Mapping[str, ParameterValues]:
        """Return the last received values of each parameter set."""
        for name, updates in self._sets.items():
            updates.update()
            for values, _ in updates.messages:
                self._parameters[name] = values
        return self._parameters

    def run_monitor(self) -> RunMonitor:
        """Return the reports of the simulation and the parameter service about the run."""
        self._schedule.update()
        for changes, _ in self._schedule.messages:
            self._monitor.on_scheduled_changes(changes)
        self._status.update()
        for status, origin in self._status.messages:
            self._monitor.on_sim_status(b"" if origin is None else origin.publisher, status)
        return self._monitor

    def checks(self) -> Mapping[str, tuple[Check, ...]]:
        """Return the last checks that the fleet's nodes have published, by node."""
        self._checks.update()
        for report, _ in self._checks.messages:
            if report.node in self._members:
                self._own[report.node] = report.checks
            elif len(self._unknown_nodes) < _MAX_UNKNOWN_NODES:
                self._unknown_nodes.add(report.node)
        return self._own

    @property
    def unknown_nodes(self) -> frozenset[str]:
        """Nodes that have published checks but belong to no process of the fleet."""
        return frozenset(self._unknown_nodes)

    def drain(self) -> None:
        """Wait for the last messages of the fleet's nodes, which have just ended: their tokens vanish after them,
        on the same links.
        """
        deadline, pattern = time.monotonic() + _DRAIN_TIMEOUT_S, token_pattern("pub", name=CHECKS.name)
        while time.monotonic() < deadline:
            with suppress(TryAgain):  # an incomplete list says nothing about those that are not in it
                found = map(Entity.parse, self._node.transport.all_tokens(pattern))
                if not any(each is not None and each.node in self._members for each in found):
                    return
            time.sleep(0.02)

    def publish(self, state: FleetState) -> None:
        self._state.publish(state)

    def answer_requests(self, handle_action: ActionHandler) -> bool:
        self._action_handler = handle_action
        self._node.spin_once()
        return any(each.waiting for each in self._node.request_server.served)

    def _handle_action(self, action: ProcessAction, name: Name) -> Done:
        assert self._action_handler is not None
        return Done(text=self._action_handler(action, name.name))


@contextmanager
def supervisor_node(
    router: str, domain: str = "", sets: Iterable[str] = (), members: Iterable[str] = (), lockstep: bool = False
) -> Iterator[SupervisorNode]:
    """Open the supervisor's node at the endpoint ``router``, which the supervisor starts.

    It subscribes to the parameter sets ``sets`` and to the checks of the nodes ``members``. In ``lockstep``, the fleet
    waits for a process that stands still, and its links to the supervisor last as long.
    """
    identity = Identity.of("supervisor")
    tree = configuration("direct", (router,), domain=domain, reliable=lockstep, first=True)
    with (
        ZenohTransport(tree, settle_s=0.0) as transport,
        Node(transport, identity, "supervisor", Log(identity.node)) as node,
    ):
        yield SupervisorNode(node, sets, members)
