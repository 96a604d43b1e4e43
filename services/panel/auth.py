"""Authentication of pages: token, tickets, Host and Origin, and a limit on connections without a token."""

from __future__ import annotations

import asyncio
import secrets
import time
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
    "cache-control": "no-store",
}

TICKET_S = 60.0
"""Wall time [s] within which a started browser must request its page."""


class Authenticator:
    """Checks tokens, tickets and cookies. The cookie's name has the port: browsers share cookies of a host's ports."""

    def __init__(self, token: str, port: int) -> None:
        self.token = token
        self._tickets: dict[str, float] = {}
        self.cookie = f"elea_panel_{port}"
        self.hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    def is_valid(self, token: str) -> bool:
        """Return whether this is the token; compares in constant time."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def query_is_valid(self, scope: Scope) -> bool:
        """Return whether the URL contains the token."""
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        return self.is_valid(query.get("token", [""])[-1])

    def issue_ticket(self) -> str:
        """Return a ticket that admits one browser, once and within TICKET_S: other users may see its command line."""
        made = secrets.token_urlsafe(24)
        self._tickets = {**self._valid_tickets(), made: time.monotonic() + TICKET_S}
        return made

    def redeem_ticket(self, ticket: str) -> bool:
        """Return whether a ticket is valid, and invalidate it."""
        self._tickets = self._valid_tickets()
        return self._tickets.pop(ticket, None) is not None

    def _valid_tickets(self) -> dict[str, float]:
        now = time.monotonic()
        return {ticket: until for ticket, until in self._tickets.items() if until > now}

    def cookie_is_valid(self, headers: Headers) -> bool:
        """Return whether the cookie contains the token."""
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return morsel is not None and self.is_valid(morsel.value)

    def is_same_origin(self, headers: Headers) -> bool:
        """Return whether a request comes from a page of this server, by its Origin."""
        return headers.get("origin", "") in {f"http://{host}" for host in self.hosts}


class AuthMiddleware:
    """Refuses foreign hosts, pages of other origins, and sockets without the token; adds HEADERS to every response."""

    def __init__(self, app: ASGIApp, auth: Authenticator) -> None:
        self._app, self._auth = app, auth

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        reason = self._reject_reason(scope)
        if reason:
            await PlainTextResponse(reason, 403)(scope, receive, send_with_headers)
        else:
            await self._app(scope, receive, send_with_headers)

    def _reject_reason(self, scope: Scope) -> str:
        """Return why a request is refused; empty if it is accepted."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._auth.hosts:
            return "this host name is not accepted: open the page as 127.0.0.1"
        if scope["type"] == "websocket":
            if not self._auth.is_same_origin(headers):
                return "a page of another origin may not connect to this one"
            if not self._auth.cookie_is_valid(headers):
                return "the token is missing or old: open the address that ./elea panel prints"
        elif headers.get("origin") is not None and not self._auth.is_same_origin(headers):
            return "a page of another origin may not read this one"
        return ""


AUTH_TIMEOUT_S = 5.0
"""Wall time [s] within which a connection must send a request with the token."""
MAX_UNAUTHENTICATED = 32
"""Maximum connections without the token; a further one replaces the oldest. A browser opens six."""


class UnauthenticatedConnections:
    """Closes connections without the token that wait too long or are too many. Used in the web server's thread."""

    def __init__(self, auth: Authenticator) -> None:
        self._auth = auth
        self._waiting: dict[asyncio.Transport, asyncio.TimerHandle] = {}

    def add(self, transport: asyncio.Transport) -> None:
        """Add a new connection."""
        if len(self._waiting) >= MAX_UNAUTHENTICATED:
            self._abort(next(iter(self._waiting)))
        timer = asyncio.get_running_loop().call_later(AUTH_TIMEOUT_S, self._abort, transport)
        self._waiting[transport] = timer

    def on_data(self, transport: asyncio.Transport, protocol: H11Protocol) -> None:
        """Stop watching a connection whose last request has the token."""
        if transport not in self._waiting or protocol.scope is None:
            return
        if self._auth.cookie_is_valid(Headers(raw=protocol.headers)) or self._auth.query_is_valid(dict(protocol.scope)):
            self.remove(transport)

    def remove(self, transport: asyncio.Transport) -> None:
        """Stop watching a connection."""
        if (timer := self._waiting.pop(transport, None)) is not None:
            timer.cancel()

    def _abort(self, transport: asyncio.Transport) -> None:
        self.remove(transport)
        transport.abort()


def guarded_protocol(auth: Authenticator) -> type[H11Protocol]:
    """Return uvicorn's HTTP protocol with the limits of UnauthenticatedConnections."""
    connections = UnauthenticatedConnections(auth)

    class Watched(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            connections.add(transport)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            connections.on_data(self.transport, self)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.remove(self.transport)
            super().connection_lost(exc)

    return Watched
