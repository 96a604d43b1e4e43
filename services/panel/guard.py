"""Who may come in: only this machine's own pages, by Host, Origin and a token; and the headers of every answer."""

from __future__ import annotations

import secrets
import time
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
"""Wall time in which a browser that was started must have asked for its page."""


class Pass:
    """What must be shown to come in. A browser sends cookies of all ports of a host: the port is in the name."""

    def __init__(self, token: str, port: int) -> None:
        self.token = token
        self._tickets: dict[str, float] = {}
        self.cookie = f"elea_panel_{port}"
        self.hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    def knows(self, token: str) -> bool:
        """Whether this is the token; the time it takes tells nothing."""
        return secrets.compare_digest(token.encode(), self.token.encode())

    def by_query(self, scope: Scope) -> bool:
        """Whether the address holds the token."""
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        return self.knows(query.get("token", [""])[-1])

    def ticket(self) -> str:
        """Words that let one browser in, once and within TICKET_S; its command line may show them to other users."""
        made = secrets.token_urlsafe(24)
        self._tickets = {**self._valid(), made: time.monotonic() + TICKET_S}
        return made

    def redeem(self, ticket: str) -> bool:
        """Whether this is such a ticket, which now counts no more."""
        self._tickets = self._valid()
        return self._tickets.pop(ticket, None) is not None

    def _valid(self) -> dict[str, float]:
        now = time.monotonic()
        return {ticket: until for ticket, until in self._tickets.items() if until > now}

    def by_cookie(self, headers: Headers) -> bool:
        """Whether the cookie does."""
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return morsel is not None and self.knows(morsel.value)

    def from_here(self, headers: Headers) -> bool:
        """Whether a page of this server asks: its Origin is the host that it was sent to."""
        return headers.get("origin", "") in {f"http://{host}" for host in self.hosts}


class Guard:
    """Refuses foreign hosts, and sockets of foreign pages or without the token; puts the headers on every answer."""

    def __init__(self, app: ASGIApp, gate: Pass) -> None:
        self._app, self._gate = app, gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def dressed(message: Message) -> None:
            if message["type"] in ("http.response.start", "websocket.http.response.start"):
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        refusal = self._refusal(scope)
        if refusal:
            await PlainTextResponse(refusal, 403)(scope, receive, dressed)
        else:
            await self._app(scope, receive, dressed)

    def _refusal(self, scope: Scope) -> str:
        """Why it may not come in; empty when it may."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._gate.hosts:
            return "this host is not mine: open the page as 127.0.0.1"
        if scope["type"] == "websocket":
            if not self._gate.from_here(headers):
                return "a page from elsewhere may not speak to this one"
            if not self._gate.by_cookie(headers):
                return "the token is missing or old: open the address that ./elea panel prints"
        elif headers.get("origin") is not None and not self._gate.from_here(headers):
            return "a page from elsewhere may not read this one"
        return ""
