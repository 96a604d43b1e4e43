"""The supervisor as a node of the network."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from deploy.supervisor.bus import CarryOut, Verb
from messages.elea import FleetState, Health
from messages.requests import SUPERVISOR_RESTART, SUPERVISOR_START, SUPERVISOR_STOP, Done, Name
from messages.topics import FLEET_STATE, HEALTH
from services.runtime.identity import Identity
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.zenoh_config import configuration
from services.runtime.zenoh_transport import ZenohTransport

_REQUESTS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}


class NodeBus:
    """The bus on a node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._health = node.read(HEALTH)
        self._state = node.write(FLEET_STATE)
        self._carry_out: CarryOut | None = None
        verbs: tuple[Verb, ...] = ("start", "stop", "restart")
        for verb in verbs:
            node.serve(_REQUESTS[verb], partial(self._order, verb))
        node.heart.state = "running"

    def beats(self) -> Sequence[Health]:
        self._health.admit()
        return [health for health, _ in self._health.batch]

    def publish(self, state: FleetState) -> None:
        self._state.publish(state)

    def answer(self, carry_out: CarryOut) -> None:
        self._carry_out = carry_out
        self._node.turn()

    def _order(self, verb: Verb, name: Name) -> Done:
        assert self._carry_out is not None
        return Done(text=self._carry_out(verb, name.name))


@contextmanager
def node_bus(router: str, domain: str = "") -> Iterator[NodeBus]:
    """The bus that meets the others at the endpoint ``router``; the router may come later."""
    identity = Identity.of("supervisor")
    with (
        ZenohTransport(configuration("direct", (router,), domain=domain)) as transport,
        Node(transport, identity, "supervisor", Log(identity.node)) as node,
    ):
        yield NodeBus(node)
