"""A controller that logs resets of time."""

from __future__ import annotations

from typing import Any

from messages.topics import ODOM
from services.runtime import Service, main
from services.runtime.context import Context


def run(ctx: Context[Any]) -> None:
    odom = ctx.latest(ODOM.of("tb3_0"))
    before = 0
    for tick in ctx.ticks():
        if tick.reset:
            ctx.log.info(f"reset: epoch {tick.epoch}, {before} to {tick.time}, odometry {odom.value is not None}")
        elif tick.dt <= 0 and before:
            ctx.log.error(f"twice at {tick.time}")
        before = tick.time


main(Service(name="reset_monitor", about="Tells of resets.", run=run, rate=25))
