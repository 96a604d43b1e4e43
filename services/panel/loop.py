"""The loop of the panel: the bus in this thread, the web server in another, and a page registry between them."""

from __future__ import annotations

import os
import time
from pathlib import Path

from services.panel import PanelParameters
from services.panel.address import Address, read_address, token_for, write_address
from services.panel.auth import Authenticator
from services.panel.hub import Hub
from services.panel.pages import PageRegistry
from services.panel.server import Server, create_app, listen
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.transport.api import idle_subscriber


def run(ctx: Context[PanelParameters]) -> None:
    """Serve the page until asked to stop. The loop sends its heartbeat whatever pages and requests do."""
    p, node = ctx.params, ctx.node
    path = Path(p.address).absolute() if p.address else None
    known = read_address(path) if path is not None else None
    earlier = None if known is None else known.port
    listening = listen(p.port, earlier)
    port = listening.getsockname()[1]
    if p.port not in (0, port) and port != earlier:
        ctx.log.warn(f"port {p.port} is taken: the page is on {port}")
    auth = Authenticator(token := token_for(path, port), port)
    pages = PageRegistry(node.transport.wake, p.pages)
    hub = Hub(node, pages, p)
    with Server(create_app(auth, pages), auth, listening, node.transport.wake, lambda: hub.period):
        if path is not None:
            _write_address(path, Address(port=port, token=token, pid=os.getpid()))
        ctx.log.info(f"the page is on http://127.0.0.1:{port}; ./elea panel opens it")
        node.heartbeat.state, node.heartbeat.detail = "running", f"http://127.0.0.1:{port}"
        node.heartbeat.request_now()
        rest = idle_subscriber(node.transport)
        try:
            while True:
                node.wait(rest)
                rest.recv()
                hub.update(time.monotonic())
                if ctx.update_params(admitted=True):
                    hub.drive_controller.params = ctx.params
                ctx.now, node.heartbeat.ticks = hub.time.now, node.heartbeat.ticks + 1
        finally:
            hub.drive_controller.close()


def _write_address(path: Path, address: Address) -> None:
    try:
        write_address(path, address)
    except OSError as error:
        raise BadInput(f"panel: the address cannot be written to {path}: {error.strerror}") from None
