"""The register: the router sees every token, and tells a newcomer whose it must see before it has seen everybody.

A newcomer's own token reaches the router ahead of its question. So of two nodes that come at the same moment under one
name, at least one is told of the other.
"""

from __future__ import annotations

import msgspec

from messages.base import FAULTS, decoder, encode
from services.runtime.graph import pattern
from services.runtime.network.transport import KERNEL, Transport

KEY = f"{KERNEL}/register"
WITHIN_S = 0.5
"""Wall time that the router has for its answer."""
LOOK_S = 0.05
"""Wall time that the router looks for tokens beyond those of which it was told; a node that hangs would delay all."""


class Present(msgspec.Struct, frozen=True, array_like=True):
    """The tokens of all nodes."""

    nodes: tuple[str, ...] = ()


_read = decoder(Present)


class Register:
    """The router's side."""

    def __init__(self, transport: Transport) -> None:
        self._transport, self._server = transport, transport.serve(KEY)

    def answer(self) -> None:
        """Answer those who wait, all alike: their tokens are there by now."""
        waiting = list(iter(self._server.take, None))
        if not waiting:
            return
        there = encode(Present(tuple(self._transport.tokens(pattern("node"), LOOK_S))))
        for query in waiting:
            query.reply(there)


def present(transport: Transport) -> frozenset[str] | None:
    """The tokens of all nodes that the router sees; None when there is no router, or none that says."""
    for reply in transport.query(KEY, b"", WITHIN_S):
        try:
            return frozenset(_read(reply.payload).nodes)
        except FAULTS:
            continue
    return None
