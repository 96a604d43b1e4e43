"""A panel page without a browser: only the WebSocket."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from websockets.sync.client import ClientConnection, connect

from services.panel.address import Address
from tests.harness.waiting import wait_until


@contextmanager
def page_client(address: Address, origin: str = "", token: str = "", queue: int = 16) -> Iterator[ClientConnection]:
    """Connect a WebSocket to the panel, with its token and origin unless others are given."""
    cookie = f"elea_panel_{address.port}={token or address.token}"
    here = f"127.0.0.1:{address.port}"
    with connect(
        f"ws://{here}/socket",
        origin=origin or f"http://{here}",  # type: ignore[arg-type]
        additional_headers={"Cookie": cookie},
        max_queue=queue,
        compression=None,
        close_timeout=1,
    ) as made:
        yield made


def send(at: ClientConnection, **word: Any) -> None:
    at.send(json.dumps(word))


def wait_message(at: ClientConnection, kind: str, within: float = 20.0) -> dict[str, Any]:
    """Wait for the next message of a kind and return it."""

    def one() -> dict[str, Any] | None:
        text = at.recv(timeout=within)
        message = json.loads(text) if isinstance(text, str) else {"k": "frame", "frame": text}
        return message if message["k"] == kind else None

    return wait_until(one, within, f"a message {kind}")
