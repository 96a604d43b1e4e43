"""A real panel server without a fleet, with HTTP and WebSocket clients."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from typing import Any, NamedTuple

from websockets.sync.client import ClientConnection, connect

from services.panel.pages import PageRegistry

TOKEN = "a-token-of-this-run-that-is-long-enough"
WITHIN_S = 30.0
PAGE_HEADERS = {"origin": "http://127.0.0.1:{port}", "cookie": "elea_panel_{port}=" + TOKEN}


class HttpResponse(NamedTuple):
    """A response of the server; the names of ``headers`` are in lower case."""

    status: int
    headers: dict[str, str]
    text: str


class ServerHarness:
    """The server and its page registry. ``{port}`` in a header is replaced with the server's port."""

    def __init__(self, registry: PageRegistry, port: int) -> None:
        self.registry, self.port = registry, port

    @property
    def url(self) -> str:
        """The URL of its page, with the token."""
        return f"http://127.0.0.1:{self.port}/?token={TOKEN}"

    def get(self, path: str, method: str = "GET", **headers: str) -> HttpResponse:
        """Request a path exactly as written, without a client normalising it."""
        link = HTTPConnection("127.0.0.1", self.port, timeout=WITHIN_S)
        link.putrequest(method, path, skip_host="host" in headers)
        for name, value in headers.items():
            link.putheader(name, self._filled(value))
        link.endheaders()
        with link.getresponse() as answer:
            return HttpResponse(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read().decode())

    @contextmanager
    def socket(self, host: str = "127.0.0.1:{port}", **headers: str) -> Iterator[ClientConnection]:
        """Open a WebSocket with these headers, to this server whatever the Host header."""
        raw = socket.create_connection(("127.0.0.1", self.port), WITHIN_S)
        filled = {name: self._filled(value) for name, value in headers.items()}
        address = f"ws://{self._filled(host)}/socket"
        with connect(address, sock=raw, additional_headers=filled, compression=None, close_timeout=1) as made:
            yield made

    def page_socket(self) -> Any:
        """Open a WebSocket as a page of this server does."""
        return self.socket(origin="http://127.0.0.1:{port}", cookie="elea_panel_{port}=" + TOKEN)

    def _filled(self, text: str) -> str:
        return text.replace("{port}", str(self.port)).replace("{next}", str(self.port + 1))


def receive(page: ClientConnection) -> dict[str, Any]:
    told = json.loads(page.recv(timeout=WITHIN_S))
    assert isinstance(told, dict)
    return told
