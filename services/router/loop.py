"""The router's loop: the session itself routes; the loop only beats."""

from __future__ import annotations

from services.router import RouterParameters
from services.runtime.context import Context


def run(ctx: Context[RouterParameters]) -> None:
    """Beat until the process is asked to end."""
    ctx.kernel.heart.state = "running"
    ctx.log.info(f"listening on {ctx.params.listen}")
    while True:
        ctx.idle()
