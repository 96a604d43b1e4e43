"""A node's subscription to one parameter set; every change is checked on the whole record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import msgspec

from messages.names import key as key_of
from messages.parameters import Origin, ParameterDescription, ParameterValues, SetParameters
from messages.requests import PARAMS_SET
from messages.topics import UPDATES
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.client import AUTHORITY, ParameterClient, assignments
from services.runtime.parameters.schema import changed_names, fields_of, flatten, nest
from services.runtime.parameters.validation import build, describe_parameters
from services.runtime.requests import call
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import MEMBER_BYTES

P = TypeVar("P", bound=Parameters)

CHANGE_S = 0.5
"""Wall time [s] that ``change`` waits for the parameter service."""
LOG_PERIOD_S = 1.0
"""Wall time [s] between two log lines about refused updates."""


class ParameterSubscription(Generic[P]):
    """The current ``params``, replaced as a whole by ``refresh``; ``origins`` has the source of each value.

    ``error`` is the error of the last announcement, empty once answered; ``refused`` means that the set was refused.

    Args:
        node: The node that uses the set.
        name: The absolute name of the set.
        params: The values until the parameter service answers.
        fleet: The values of the fleet file, by dotted names.
        command_line: The values of the command line, by dotted names.
        described: Descriptions in place of those of the record.
        validate: Raises BadInput for contradicting values; such a change is refused, and undone in the parameter
            service.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        params: P,
        *,
        fleet: Mapping[str, Any] | None = None,
        command_line: Mapping[str, Any] | None = None,
        described: Sequence[ParameterDescription] = (),
        validate: Callable[[P], object] | None = None,
    ) -> None:
        self.set, self.params = name, params
        self.fleet, self.command_line = dict(fleet or {}), dict(command_line or {})
        self.described = tuple(described or describe_parameters(type(params)))
        self.origins: dict[str, Origin] = {each.name: "default" for each in self.described}
        self.origins.update(dict.fromkeys(self.fleet, "fleet"))
        self.origins.update(dict.fromkeys(self.command_line, "command line"))
        self.error, self.refused = "", False
        self._node, self._validate = node, validate
        self._flat = flatten(params)
        self._live = {each.name: each.level for each in self.described if each.live}
        self._kept = {leaf.name.partition(".")[0] for leaf in fields_of(type(params)) if leaf.structured}
        self._subscriber: Subscriber[ParameterValues] = node.subscribe(
            UPDATES, f"{name}/{UPDATES.name.removeprefix('~')}", rare=True
        )
        self._queued: list[tuple[ParameterValues, bytes]] = []
        self._revision, self._source = -1, b""
        self._undo_requested = False
        self.client = ParameterClient.of(node)

    def start(self, wait: bool = True) -> None:
        """Announce the set; with ``wait``, ``params`` are the parameter service's values on return."""
        if wait and self.client.expected:
            self.client.expect(lambda: self._node.stopping)
        self.client.attach(self, wait)

    def close(self) -> None:
        """Unsubscribe from the set."""
        self.client.detach(self)
        self._node.unregister(self._subscriber)

    @property
    def run_values(self) -> dict[str, Any]:
        """The values set for this run only, sent to a parameter service that was restarted."""
        return {name: self._flat[name] for name, origin in self.origins.items() if origin == "run"}

    def apply_initial(self, values: ParameterValues, source: bytes) -> None:
        """Apply the parameter service's values at the start of the node, unless they contradict each other."""
        before = self._flat
        self._apply(values, source, undo=False)
        if news := changed_names(self._flat, before):
            listed = ", ".join(f"{name} = {self._flat[name]} ({self.origins[name]})" for name in news)
            self._node.log.info(f"parameters {self.set}: {listed}")

    def enqueue(self, values: ParameterValues, source: bytes) -> None:
        """Keep the parameter service's values until the next ``refresh``."""
        self._queued.append((values, source))

    def update(self) -> None:
        """Read new updates; for loops that do not update all subscribers of the node."""
        self._subscriber.update()

    @property
    def pending(self) -> bool:
        """Whether there are received values that ``refresh`` will apply or refuse."""
        return bool(self._subscriber.messages or self._queued)

    def refresh(self) -> int:
        """Apply the received values; returns the levels of the parameters that changed, 0 for none."""
        if not self.pending:
            return 0
        self.client.spin_once()
        levels = 0
        for values, origin in self._subscriber.messages:
            if origin is None or not self.client.trusts(origin.publisher, self._subscriber.key):
                self._refuse(f"not from the visible node {AUTHORITY}")
            else:
                self._queued.append((values, origin.publisher[:MEMBER_BYTES]))
        received, self._queued, self._subscriber.messages = self._queued, [], []
        for values, source in received:
            levels |= self._apply(values, source, undo=True)
        return levels

    def change(self, values: Mapping[str, Any]) -> None:
        """Set parameters for this run only, by dotted names, from the next step on.

        Raises:
            BadInput: Values are out of bounds or contradict each other.
            CallFailed: The parameter service refused them, or did not answer.
        """
        if not values:
            return
        params = self._checked({**self._flat, **values})
        if not self.client.available:
            self._replace(params, {**self.origins, **dict.fromkeys(values, "run")})
            return
        asked = SetParameters(
            set=self.set,
            values=tuple(assignments(dict(values))),
            run=True,
            id=self.client.next_id(),
            who=self._node.identity.node,
        )
        answer = call(self._node.transport, PARAMS_SET, key_of(PARAMS_SET.name), asked, CHANGE_S)
        self._apply(answer, self._source, undo=True)

    def _apply(self, values: ParameterValues, source: bytes, undo: bool) -> int:
        if source == self._source and values.revision < self._revision:
            return 0  # the reply to a request was faster
        self._source, self._revision = source, values.revision
        self.error, self.refused = "", False
        live = {each.name: each for each in values.values if each.name in self._live}
        flat = {**self._flat, **{name: each.value for name, each in live.items()}}
        origins: dict[str, Origin] = {**self.origins, **{name: each.origin for name, each in live.items()}}
        if not changed_names(flat, self._flat):
            self.origins, self._undo_requested = origins, False
            return 0
        try:
            params = self._checked(flat)
        except BadInput as error:
            if not undo:
                self._refuse(
                    f"{error}; this node keeps its own values. ./elea param reset {self.set} forgets the saved ones"
                )
            else:
                self._refuse(str(error))
                if not self._undo_requested:
                    self.client.request_undo(self, values.revision, str(error))
            self._undo_requested = True  # only once, until a valid update arrives
            return 0
        self._undo_requested = False
        return self._replace(params, origins)

    def _checked(self, flat: Mapping[str, Any]) -> P:
        """Build the record with these values; raises BadInput."""
        record = type(self.params)
        built = build(record, nest(record, flat), self.set)
        params = msgspec.structs.replace(built, **{name: getattr(self.params, name) for name in self._kept})
        if self._validate is not None:
            self._validate(params)
        return params

    def _replace(self, params: P, origins: dict[str, Origin]) -> int:
        flat = flatten(params)
        changed = changed_names(flat, self._flat)
        self.params, self.origins, self._flat = params, origins, flat
        levels = 0
        for name in changed:
            levels |= self._live.get(name, 0)
        return levels

    def _refuse(self, reason: str) -> None:
        self._subscriber.reject(reason)
        self._node.log.warn(f"a change of the parameters {self.set} is refused: {reason}", every=LOG_PERIOD_S)
