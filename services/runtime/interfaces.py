"""Definitions of message types on the network: a node announces its own, and others learn them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from messages.base import MOST_ITEMS
from messages.elea import InterfaceDefinition, InterfaceDefinitions
from messages.interfaces.records import definition_text, learn
from messages.topics import INTERFACES
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.publisher import Publisher

_ROOM = INTERFACES.largest - (1 << 17)
"""Bytes of definitions that one node announces at most; what is beyond is recorded as MessagePack."""


class InterfaceAnnouncer:
    """Announces the types that a node uses, all that belong to no standard package; it is used where the node is."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._definitions: dict[str, InterfaceDefinition] = {}
        self._publisher: Publisher[InterfaceDefinitions] | None = None

    def add(self, *types: str) -> None:
        """Announce these types as well, before the node uses them."""
        new = {name: text for name in types if name not in self._definitions and (text := definition_text(name))}
        room = _ROOM - sum(len(each.text) for each in self._definitions.values())
        if not new or sum(map(len, new.values())) > room or len(self._definitions) + len(new) > MOST_ITEMS:
            return
        self._definitions |= {name: InterfaceDefinition(type=name, text=text) for name, text in new.items()}
        if self._publisher is None:
            self._publisher = self._node.advertise(INTERFACES)
        self._publisher.publish(InterfaceDefinitions(definitions=tuple(self._definitions.values())))


def learn_interfaces(messages: Iterable[InterfaceDefinitions], note: Callable[[str], object]) -> None:
    """Know the types that others have announced; ``note`` is called with what is wrong about one."""
    for message in messages:
        for each in message.definitions:
            try:
                learn(each.type, each.text)
            except BadInput as error:
                note(f"{INTERFACES.name}: {error}")
