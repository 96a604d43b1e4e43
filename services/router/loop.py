"""The router's loop: sends heartbeats and answers new nodes with the node list; Zenoh's session does the routing."""

from __future__ import annotations

from services.router import RouterParameters
from services.runtime.context import Context
from services.runtime.discovery import NodeDirectory
from services.runtime.transport.zenoh_config import OPEN_TO_ALL, default_router, endpoint, is_local


def run(ctx: Context[RouterParameters]) -> None:
    """Serve the node list until the process is asked to end."""
    ctx.node.heartbeat.state = "running"
    listen = (ctx.params.listen or default_router(), *ctx.params.also)
    ctx.log.info(f"listening on {', '.join(listen)}")
    for each in listen:
        if not is_local(endpoint(each)):
            ctx.log.warn(f"listening on {each}: {OPEN_TO_ALL}")
    directory = NodeDirectory(ctx.node.transport)
    while True:
        directory.answer()
        ctx.idle()
