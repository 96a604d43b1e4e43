"""Common parts of the faulty controllers, which drive at full speed until a message makes them fail."""

from __future__ import annotations

from collections.abc import Callable

from messages.geometry import Twist
from messages.std import String
from messages.topics import CMD_VEL, Quality, Topic
from services.runtime import Parameters, Service
from services.runtime.context import Context

FAULT = Topic("~fault", String, 0, Quality.EVENT, "makes a faulty service fail")
FULL_SPEED = Twist.planar(0.22, 0.0)
"""A burger's top speed [m/s], see models/burger."""


def faulty_controller(name: str, fail: Callable[[], None]) -> Service:
    """Return a controller that calls ``fail`` in its loop, right after a command, on request."""

    def run(ctx: Context[Parameters]) -> None:
        told = ctx.stream(FAULT)
        for _ in ctx.ticks():
            ctx.publish(CMD_VEL, FULL_SPEED)
            if told.drain():
                fail()

    return Service(name=name, about=f"fails: {name}", run=run, rate=25)
