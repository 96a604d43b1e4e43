"""Connections that have not shown the token yet: few, and for a few seconds, so that nobody keeps others out."""

from __future__ import annotations

import asyncio

from starlette.datastructures import Headers
from uvicorn.protocols.http.h11_impl import H11Protocol

from services.panel.guard import Pass

WITHIN_S = 5.0
"""Wall time in which a connection must have sent a request that shows the token."""
MOST = 32
"""Connections that have not; one more takes the place of the oldest. A browser opens six."""


class Door:
    """Closes those that wait too long or are too many. All in the thread of the web server."""

    def __init__(self, gate: Pass) -> None:
        self._gate = gate
        self._waiting: dict[asyncio.Transport, asyncio.TimerHandle] = {}

    def arrive(self, transport: asyncio.Transport) -> None:
        """Somebody has connected."""
        if len(self._waiting) >= MOST:
            self._turn_away(next(iter(self._waiting)))
        timer = asyncio.get_running_loop().call_later(WITHIN_S, self._turn_away, transport)
        self._waiting[transport] = timer

    def look(self, transport: asyncio.Transport, protocol: H11Protocol) -> None:
        """Let in whose last request shows the token."""
        if transport not in self._waiting or protocol.scope is None:
            return
        if self._gate.by_cookie(Headers(raw=protocol.headers)) or self._gate.by_query(dict(protocol.scope)):
            self.leave(transport)

    def leave(self, transport: asyncio.Transport) -> None:
        """It waits no longer."""
        if (timer := self._waiting.pop(transport, None)) is not None:
            timer.cancel()

    def _turn_away(self, transport: asyncio.Transport) -> None:
        self.leave(transport)
        transport.abort()


def behind(gate: Pass) -> type[H11Protocol]:
    """uvicorn's HTTP for connections that come through a door of their own."""
    door = Door(gate)

    class Watched(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            door.arrive(transport)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            door.look(self.transport, self)

        def connection_lost(self, exc: Exception | None) -> None:
            door.leave(self.transport)
            super().connection_lost(exc)

    return Watched
