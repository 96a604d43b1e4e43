"""The loop of the panel: the bus here, the web server in a thread beside it, and a board between the two."""

from __future__ import annotations

import os
import time
from pathlib import Path

from services.panel import PanelParameters
from services.panel.address import Address, token_for, write
from services.panel.board import Board
from services.panel.guard import Pass
from services.panel.hub import Hub
from services.panel.server import Server, listen
from services.panel.web import application
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.network.transport import resting


def run(ctx: Context[PanelParameters]) -> None:
    """Serve the page until told to stop. The loop beats whatever pages and requests do."""
    p, node = ctx.params, ctx.kernel
    path = Path(p.address).absolute() if p.address else None
    listening = listen(p.port)
    port = listening.getsockname()[1]
    if p.port not in (0, port):
        ctx.log.warn(f"port {p.port} is taken: the page is on {port}")
    gate = Pass(token := token_for(path, port), port)
    board = Board(node.transport.nudge, p.pages)
    hub = Hub(node, board, p)
    with Server(application(gate, board), gate, listening, node.transport.nudge, lambda: hub.period):
        if path is not None:
            _tell(path, Address(port=port, token=token, pid=os.getpid()))
        ctx.log.info(f"the page is on http://127.0.0.1:{port}; ./elea panel opens it")
        node.heart.state, node.heart.note = "running", f"http://127.0.0.1:{port}"
        node.heart.hurry()
        rest = resting(node.transport)
        try:
            while True:
                node.wait(rest)
                rest.take()
                hub.turn(time.monotonic())
                if ctx.follow(admitted=True):
                    hub.driver.params = ctx.params
                ctx.now, node.heart.ticks = hub.time.now, node.heart.ticks + 1
        finally:
            hub.driver.close()


def _tell(path: Path, address: Address) -> None:
    try:
        write(path, address)
    except OSError as error:
        raise BadInput(f"panel: the address cannot be written to {path}: {error.strerror}") from None
