"""Sees what robots do as a member of their lockstep: every sample, however busy the machine is."""

from __future__ import annotations

from pathlib import Path

from messages.base import Message, decoder, encode
from messages.elea import BaseStatus
from messages.nav import Odometry
from messages.topics import BASE_STATUS, GROUND_TRUTH
from services.runtime import Parameters, Service, main
from services.runtime.context import Context


class SpectatorParameters(Parameters, frozen=True, kw_only=True):
    """What it looks at, the simulation time [s] at which it has seen enough, and where it writes that."""

    robots: tuple[str, ...] = ()
    until: float = 1.0
    output: str = "seen"


class Seen(Message, frozen=True, kw_only=True):
    """Ground truth by robot, oldest first, and the last word on its base."""

    truth: dict[str, list[Odometry]]
    status: dict[str, BaseStatus]


read_seen = decoder(Seen)


def run(ctx: Context[SpectatorParameters]) -> None:
    p = ctx.params
    truth = {name: ctx.stream(GROUND_TRUTH, f"/{name}/ground_truth") for name in p.robots}
    bases = {name: ctx.latest(BASE_STATUS, f"/{name}/base_status") for name in p.robots}
    samples: dict[str, list[Odometry]] = {name: [] for name in p.robots}
    for tick in ctx.ticks():
        for name, stream in truth.items():
            samples[name] += stream.take()
        if tick.time >= round(p.until * 1e9):
            break
    status = {name: base.value for name, base in bases.items() if base.value is not None}
    unfinished = Path(p.output).with_suffix(".part")
    unfinished.write_bytes(encode(Seen(truth=samples, status=status)))
    unfinished.rename(p.output)


if __name__ == "__main__":
    main(
        Service(
            name="spectator",
            about="Sees what robots do.",
            run=run,
            rate=50,
            parameters=SpectatorParameters,
        )
    )
