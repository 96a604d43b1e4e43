"""Common parts of the faulty services: they drive at full speed until they are told to fail."""

from __future__ import annotations

from collections.abc import Callable

from messages.geometry import Twist
from messages.std import String
from messages.topics import CMD_VEL, Quality, Topic
from services.runtime import Parameters, Service
from services.runtime.context import Context

FAULT = Topic("~fault", String, 0, Quality.EVENT, "makes a faulty service fail")
FULL_SPEED = Twist.planar(0.22, 0.0)
"""m/s; a burger's top speed, see models/burger."""


def faulty_controller(name: str, fail: Callable[[], None]) -> Service:
    """A controller that calls ``fail`` in its loop, right after a command, when it is told to."""

    def run(ctx: Context[Parameters]) -> None:
        told = ctx.stream(FAULT)
        for _ in ctx.ticks():
            ctx.publish(CMD_VEL, FULL_SPEED)
            if told.drain():
                fail()

    return Service(name=name, about=f"fails: {name}", run=run, rate=25)
