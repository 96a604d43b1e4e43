"""Message types known only to nodes of the network: learned from their announcements when first needed."""

from __future__ import annotations

import time

from deploy.interfaces import known_record
from deploy.live.output import write_note
from messages.base import Message, WrongPayload, decoder
from messages.topics import INTERFACES
from services.runtime.graph import Entity, token_pattern
from services.runtime.interfaces import learn_interfaces
from services.runtime.subscriber import UntypedSubscriber
from services.runtime.transport.api import Transport

_TIMEOUT_S = 1.0
"""Wall time [s] to wait for latched type definitions."""


def record_on_network(transport: Transport, type_name: str) -> type[Message] | None:
    """Return the record of a ROS type, which a node of the network may have announced; None if it is unknown."""
    record = known_record(type_name)
    if record is None and type_name and learn_types(transport):
        record = known_record(type_name)
    return record


def learn_types(transport: Transport) -> bool:
    """Learn the types that nodes announce; return False if there are no such nodes."""
    entities = [Entity.parse(each) for each in transport.tokens(token_pattern("pub"))]
    announcing = {each.node for each in entities if each is not None and each.name == INTERFACES.name}
    if not announcing:
        return False
    deadline, read, senders = time.monotonic() + _TIMEOUT_S, decoder(INTERFACES.record), set[bytes]()
    listener = UntypedSubscriber(transport, INTERFACES.name, latched=True)
    while len(senders) < len(announcing) and time.monotonic() < deadline:
        transport.wait(listener.raw)
        for sample in listener.drain():
            senders.add(sample.origin.publisher if sample.origin is not None else b"")
            try:
                learn_interfaces([read(sample.payload)], write_note)
            except WrongPayload as error:
                write_note(f"{INTERFACES.name}: {error}")
    listener.close()
    return True
