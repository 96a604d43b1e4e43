"""The requests of the network, and asking one with values that a person types."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from deploy.live.ends import absent
from deploy.live.known import known_record, record_of, request_of
from deploy.live.output import note
from deploy.live.values import Draft, read_yaml, split_type
from messages.base import encode
from messages.names import key as key_of
from messages.plain import plain
from messages.requests import Request
from services.runtime.calls import call
from services.runtime.errors import BadInput
from services.runtime.graph import Entity, pattern
from services.runtime.network.transport import Transport


class Server(NamedTuple):
    """A request, the nodes that serve it, and the ROS types asked and replied; ``?`` for one that nobody tells."""

    name: str
    nodes: tuple[str, ...]
    asks: str
    replies: str
    about: str

    @property
    def types(self) -> str:
        """Both types in one text."""
        return f"{self.asks} -> {self.replies}"

    def told(self) -> dict[str, Any]:
        """All of it, for JSON."""
        return self._asdict()


def servers(transport: Transport) -> dict[str, Server]:
    """All requests that somebody serves, by their names, in order."""
    found: dict[str, Server] = {}
    entities = (Entity.parse(each) for each in transport.tokens(pattern("srv")))
    for each in sorted((each for each in entities if each), key=lambda each: (each.name, each.node)):
        known = request_of(each.name)
        replies = known.replies.ROS_TYPE if known is not None else "?"
        about = known.about if known is not None else ""
        nodes = (*found[each.name].nodes, each.node) if each.name in found else (each.node,)
        found[each.name] = Server(each.name, nodes, each.record, replies, about)
    return found


def find_server(transport: Transport, name: str) -> Server:
    """The request ``name``; raises BadInput with the nearest name when nobody serves it."""
    found = servers(transport)
    if name not in found:
        raise absent("service", name, found, "./elea service list tells them all")
    return found[name]


def ask(transport: Transport, name: str, values: Sequence[str], timeout: float) -> Any:
    """The reply to a request, as plain values; raises BadInput for bad values and CallFailed for a refusal."""
    server = find_server(transport, name)
    given, words = split_type(values)
    if given and server.asks != record_of(given).ROS_TYPE:
        raise BadInput(f"{name} asks {server.asks}, not {given}")
    record, known = known_record(server.asks), request_of(name)
    message: Any
    if record is None:
        note(f"{name} asks {server.asks}, a type that is not known here: what you wrote is sent as it stands")
        message = read_yaml(words[0]) if len(words) == 1 else [read_yaml(each) for each in words] or {}
    else:
        message = Draft(record, words).made(0)
    # A reply of a type that is not known here is shown as it is.
    request: Request[Any, Any] = known or Request(name, type(message), object, "")
    return plain(encode(call(transport, request, key_of(name), message, timeout)))
