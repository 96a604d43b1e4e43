"""The supervisor as a node of the network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial

from deploy.supervisor.bus import CarryOut, Verb
from messages.elea import FleetState, Health
from messages.parameters import ParameterValues
from messages.requests import SUPERVISOR_RESTART, SUPERVISOR_START, SUPERVISOR_STOP, Done, Name
from messages.topics import FLEET_STATE, HEALTH, UPDATES
from services.runtime.identity import Identity
from services.runtime.log import Log
from services.runtime.network.zenoh_config import configuration
from services.runtime.network.zenoh_transport import ZenohTransport
from services.runtime.node import Node

_REQUESTS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}


class NodeBus:
    """The bus on a node."""

    def __init__(self, node: Node, sets: Iterable[str] = ()) -> None:
        self._node = node
        self._sets = {name: node.read(UPDATES, f"{name}/parameter_updates") for name in sets}
        self._told: dict[str, ParameterValues] = {}
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

    def parameters(self) -> Mapping[str, ParameterValues]:
        """The values of the parameters of each set, as far as they were told."""
        for name, updates in self._sets.items():
            updates.admit()
            for values, _ in updates.batch:
                self._told[name] = values
        return self._told

    def publish(self, state: FleetState) -> None:
        self._state.publish(state)

    def answer(self, carry_out: CarryOut) -> None:
        self._carry_out = carry_out
        self._node.turn()

    def _order(self, verb: Verb, name: Name) -> Done:
        assert self._carry_out is not None
        return Done(text=self._carry_out(verb, name.name))


@contextmanager
def node_bus(router: str, domain: str = "", sets: Iterable[str] = ()) -> Iterator[NodeBus]:
    """The bus that meets the others at the endpoint ``router``, which the supervisor starts, and hears these sets."""
    identity = Identity.of("supervisor")
    with (
        ZenohTransport(configuration("direct", (router,), domain=domain, first=True), settle_s=0.0) as transport,
        Node(transport, identity, "supervisor", Log(identity.node)) as node,
    ):
        yield NodeBus(node, sets)
