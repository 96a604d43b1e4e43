"""Lists the network's services, and calls one with typed values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from deploy.interfaces import canonical_type, known_record, known_request, service_interface
from deploy.live.learned_types import learn_types
from deploy.live.message_builder import MessageBuilder, split_type
from deploy.live.output import write_note
from deploy.live.topics import not_found
from messages.base import encode
from messages.names import key as key_of
from messages.plain import plain
from messages.requests import Request
from models.yaml_reader import read_yaml
from services.runtime.errors import BadInput
from services.runtime.graph import Entity, token_pattern
from services.runtime.requests import call
from services.runtime.transport.api import Transport


class ServiceInfo(NamedTuple):
    """A service, the nodes that serve it, and the ROS types of request and reply; ``?`` if unknown."""

    name: str
    nodes: tuple[str, ...]
    asks: str
    replies: str
    about: str

    @property
    def types(self) -> str:
        """Both types as text."""
        return f"{self.asks} -> {self.replies}"

    def as_dict(self) -> dict[str, Any]:
        """Return all fields, for JSON."""
        return self._asdict()


def list_services(transport: Transport) -> dict[str, ServiceInfo]:
    """Return all services with a server, sorted by name."""
    found: dict[str, ServiceInfo] = {}
    entities = (Entity.parse(each) for each in transport.tokens(token_pattern("srv")))
    for each in sorted((each for each in entities if each), key=lambda each: (each.name, each.node)):
        known = known_request(each.name, each.record) or service_interface(each.record)
        replies = known.response_type.ROS_TYPE if known is not None else "?"
        about = known.about if known is not None else ""
        nodes = (*found[each.name].nodes, each.node) if each.name in found else (each.node,)
        found[each.name] = ServiceInfo(each.name, nodes, each.record, replies, about)
    return found


def find_service(transport: Transport, name: str) -> ServiceInfo:
    """Return the service ``name``; raises BadInput with the nearest name if it has no server."""
    found = list_services(transport)
    if name not in found:
        raise not_found("service", name, found, "./elea service list shows them all")
    return found[name]


def call_service(transport: Transport, name: str, values: Sequence[str], timeout: float) -> Any:
    """Call a service and return its reply as plain values; raises BadInput for bad values, CallFailed for a refusal."""
    server = find_service(transport, name)
    given, words = split_type(values)
    known = known_request(name, server.asks) or _service_of_type(transport, server.asks)
    record = known.request_type if known is not None else known_record(server.asks)
    if given and canonical_type(given) not in (server.asks, record.ROS_TYPE if record is not None else ""):
        raise BadInput(f"{name} has the request type {server.asks}, not {given}")
    message: Any
    if record is None:
        write_note(f"{name} has the unknown request type {server.asks}: the values are sent unchecked")
        message = read_yaml(words[0]) if len(words) == 1 else [read_yaml(each) for each in words] or {}
    else:
        message = MessageBuilder(record, words).build(0)
    # A reply whose type is unknown here is shown as decoded.
    request: Request[Any, Any] = known or Request(name, type(message), Any, "")
    return plain(encode(call(transport, request, key_of(name), message, timeout)))


def _service_of_type(transport: Transport, type_name: str) -> Request[Any, Any] | None:
    """Return the records of a service type (``my_pkg/AddTwoInts``), which its server may have announced."""
    known = service_interface(type_name)
    if known is None and known_record(type_name) is None and learn_types(transport):
        known = service_interface(type_name)
    return known
