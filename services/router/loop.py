"""The router's loop: the session itself routes; the loop beats, and tells newcomers who is there."""

from __future__ import annotations

from services.router import RouterParameters
from services.runtime.context import Context
from services.runtime.register import Register


def run(ctx: Context[RouterParameters]) -> None:
    """Beat until the process is asked to end."""
    ctx.kernel.heart.state = "running"
    ctx.log.info(f"listening on {ctx.params.listen}")
    register = Register(ctx.kernel.transport)
    while True:
        register.answer()
        ctx.idle()
