"""A controller that drives three Pioneers, each at its own speed, and ends when and how its parameters say."""

from __future__ import annotations

import signal
from typing import Literal

from messages.geometry import Twist
from messages.std import Bool
from messages.topics import CMD_VEL, E_STOP
from services.runtime import Parameters, Service, main
from services.runtime.context import Context

SPEEDS = {"slow": 0.2, "middle": 0.5, "fast": 0.75}
"""Commanded speed [m/s] by robot."""
RATE = 25
"""Rate [Hz] of the commands to each robot."""
HANGS = "waits for its end in the middle of a tick"

End = Literal["hangs", "falls silent", "stops"]


class CommanderParameters(Parameters):
    """How it ends at ``at`` [s]: it hangs until a signal, goes silent, or drives on after an emergency stop of all."""

    end: End = "hangs"
    at: float = 1.0


def run(ctx: Context[CommanderParameters]) -> None:
    stop = ctx.advertise(E_STOP.of("/"))
    commands = {name: ctx.advertise(CMD_VEL.of(name)) for name in SPEEDS}
    for tick in ctx.ticks():
        if over := tick.time >= round(ctx.params.at * 1e9):
            if ctx.params.end == "hangs":
                print(HANGS, flush=True)
                signal.pause()
            elif ctx.params.end == "stops" and tick.time == round(ctx.params.at * 1e9):
                stop.publish(Bool(data=True))
        if not (over and ctx.params.end == "falls silent"):
            for name, v in SPEEDS.items():
                commands[name].publish(Twist.planar(v, 0.0))


if __name__ == "__main__":
    main(
        Service(
            name="commander",
            about="Drives straight ahead, then ends.",
            run=run,
            rate=RATE,
            parameters=CommanderParameters,
        )
    )
