"""Message definitions on the network: a node announces its types, and others learn them."""

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
"""Maximum bytes of definitions that one node announces; messages of further types are recorded as MessagePack."""


class InterfaceAnnouncer:
    """Announces a node's message types that belong to no standard package; used in the node's thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._definitions: dict[str, InterfaceDefinition] = {}
        self._publisher: Publisher[InterfaceDefinitions] | None = None

    def add(self, *types: str) -> None:
        """Announce further types, before the node uses them."""
        new = {name: text for name in types if name not in self._definitions and (text := definition_text(name))}
        room = _ROOM - sum(len(each.text) for each in self._definitions.values())
        if not new or sum(map(len, new.values())) > room or len(self._definitions) + len(new) > MOST_ITEMS:
            return
        self._definitions |= {name: InterfaceDefinition(type=name, text=text) for name, text in new.items()}
        if self._publisher is None:
            self._publisher = self._node.advertise(INTERFACES)
        self._publisher.publish(InterfaceDefinitions(definitions=tuple(self._definitions.values())))


def learn_interfaces(messages: Iterable[InterfaceDefinitions], note: Callable[[str], object]) -> None:
    """Learn the types that others have announced; ``note`` is called with the error of each bad definition."""
    for message in messages:
        for each in message.definitions:
            try:
                learn(each.type, each.text)
            except BadInput as error:
                note(f"{INTERFACES.name}: {error}")
