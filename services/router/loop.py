"""The router's loop: the session itself routes; the loop beats, and tells newcomers who is there."""

from __future__ import annotations

from services.router import RouterParameters
from services.runtime.context import Context
from services.runtime.network.zenoh_config import OPEN_TO_ALL, default_router, endpoint, is_local
from services.runtime.register import Register


def run(ctx: Context[RouterParameters]) -> None:
    """Beat until the process is asked to end."""
    ctx.kernel.heart.state = "running"
    listen = (ctx.params.listen or default_router(), *ctx.params.also)
    ctx.log.info(f"listening on {', '.join(listen)}")
    for each in listen:
        if not is_local(endpoint(each)):
            ctx.log.warn(f"listening on {each}: {OPEN_TO_ALL}")
    register = Register(ctx.kernel.transport)
    while True:
        register.answer()
        ctx.idle()
