"""The supervisor as a node of the network."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial

from deploy.supervisor.bus import CarryOut, Verb
from deploy.supervisor.conduct import Conduct
from messages.elea import Check, FleetState, Health
from messages.parameters import ParameterValues
from messages.requests import SUPERVISOR_RESTART, SUPERVISOR_START, SUPERVISOR_STOP, Done, Name
from messages.topics import CHECKS, FLEET_STATE, HEALTH, SCHEDULE, SIM_STATUS, UPDATES
from services.runtime.graph import Entity, pattern
from services.runtime.identity import Identity
from services.runtime.inputs import CAPACITY
from services.runtime.log import Log
from services.runtime.network.transport import Pending
from services.runtime.network.zenoh_config import configuration
from services.runtime.network.zenoh_transport import ZenohTransport
from services.runtime.node import Node
from services.runtime.register import KEY

ANSWER_S = 1.0
"""Wall time that the router has to answer."""
RECENT_S = 2.5
"""Wall time for which its answer, or a flood, counts."""

_REQUESTS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}

_LAST_WORDS_S = 0.5
"""Wall time in which what was sent by processes that have ended must have come."""

_MOST_STRANGERS = 16


class NodeBus:
    """The bus on a node."""

    def __init__(self, node: Node, sets: Iterable[str] = (), members: Iterable[str] = ()) -> None:
        self._node, self._members = node, frozenset(members)
        self._own: dict[str, tuple[Check, ...]] = {}
        self._strangers: set[str] = set()
        self._checks = node.read(CHECKS)
        self._sets = {name: node.read(UPDATES, f"{name}/parameter_updates") for name in sets}
        self._told: dict[str, ParameterValues] = {}
        self._schedule, self._status = node.read(SCHEDULE), node.read(SIM_STATUS)
        self._conduct = Conduct()
        self._health = node.read(HEALTH)
        self._state = node.write(FLEET_STATE)
        self._carry_out: CarryOut | None = None
        self._asked: Pending | None = None
        self._answered = self._flood = -RECENT_S
        verbs: tuple[Verb, ...] = ("start", "stop", "restart")
        for verb in verbs:
            node.serve(_REQUESTS[verb], partial(self._order, verb))
        node.heart.state = "running"

    def beats(self) -> Sequence[Health]:
        self.checks()
        health = self._health
        before = health.received + health.refused + health.repeated
        health.admit()
        if health.received + health.refused + health.repeated - before >= CAPACITY:
            self._flood = time.monotonic()
        return [beat for beat, _ in health.batch]

    @property
    def flooded(self) -> bool:
        return time.monotonic() - self._flood < RECENT_S

    def carries(self) -> bool:
        if self._asked is None:
            self._asked = self._node.transport.ask(KEY, b"", ANSWER_S)
        elif (replies := self._asked.take()) is not None:
            self._asked = None
            if any(each.ok for each in replies):
                self._answered = time.monotonic()
        return time.monotonic() - self._answered < RECENT_S

    def parameters(self) -> Mapping[str, ParameterValues]:
        """The values of the parameters of each set, as far as they were told."""
        for name, updates in self._sets.items():
            updates.admit()
            for values, _ in updates.batch:
                self._told[name] = values
        return self._told

    def conduct(self) -> Conduct:
        """What simulation and parameter service have told of the run."""
        self._schedule.admit()
        for changes, _ in self._schedule.batch:
            self._conduct.schedule(changes)
        self._status.admit()
        for status, origin in self._status.batch:
            self._conduct.status(b"" if origin is None else origin.publisher, status)
        return self._conduct

    def checks(self) -> Mapping[str, tuple[Check, ...]]:
        """What the fleet's nodes have stated last of their own checks, by node."""
        self._checks.admit()
        for told, _ in self._checks.batch:
            if told.node in self._members:
                self._own[told.node] = told.checks
            elif len(self._strangers) < _MOST_STRANGERS:
                self._strangers.add(told.node)
        return self._own

    @property
    def strangers(self) -> frozenset[str]:
        """Nodes that have stated checks and are no process of the fleet."""
        return frozenset(self._strangers)

    def hear_out(self) -> None:
        """Wait for what those that have just ended said last: their tokens go behind it, on the same links."""
        deadline, own = time.monotonic() + _LAST_WORDS_S, self._node.identity.node
        while time.monotonic() < deadline:
            found = map(Entity.parse, self._node.transport.tokens(pattern("pub", name=CHECKS.name), 0.1))
            if not any(each is not None and each.node != own for each in found):
                return
            time.sleep(0.02)

    def publish(self, state: FleetState) -> None:
        self._state.publish(state)

    def answer(self, carry_out: CarryOut) -> None:
        self._carry_out = carry_out
        self._node.turn()

    def _order(self, verb: Verb, name: Name) -> Done:
        assert self._carry_out is not None
        return Done(text=self._carry_out(verb, name.name))


@contextmanager
def node_bus(router: str, domain: str = "", sets: Iterable[str] = (), members: Iterable[str] = ()) -> Iterator[NodeBus]:
    """The bus that meets the others at the endpoint ``router``, which the supervisor starts. It hears these sets, and
    the checks of these nodes.
    """
    identity = Identity.of("supervisor")
    with (
        ZenohTransport(configuration("direct", (router,), domain=domain, first=True), settle_s=0.0) as transport,
        Node(transport, identity, "supervisor", Log(identity.node)) as node,
    ):
        yield NodeBus(node, sets, members)
