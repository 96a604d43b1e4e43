"""``elea sim pause`` and its like: simulation time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from deploy.commands.sim.ask import Asker, asks

if TYPE_CHECKING:
    from messages.requests import Request


@click.command("pause")
@asks
def pause(asker: Asker) -> None:
    """Stop simulation time."""
    from messages.requests import PAUSE

    _tell(asker, PAUSE, "paused")


@click.command("resume")
@asks
def resume(asker: Asker) -> None:
    """Let simulation time go on."""
    from messages.requests import RESUME

    _tell(asker, RESUME, "running")


@click.command("step")
@click.argument("count", type=click.IntRange(1, 1_000_000), default=1)
@asks
def step(asker: Asker, count: int) -> None:
    """Run COUNT physics steps (1) of 5 ms while time is paused."""
    from messages.requests import STEP
    from messages.simulation import Steps

    reply = asker.ask(STEP, Steps(count=count))
    asker.show(reply, f"{count} steps taken: t = {reply.time / 1e9:.3f} s")


@click.command("reset")
@asks
def reset(asker: Asker) -> None:
    """Time to zero, all models to where they were spawned, all efforts and wrenches dropped."""
    from messages.requests import RESET

    _tell(asker, RESET, "reset")


@click.command("reset-world")
@asks
def reset_world(asker: Asker) -> None:
    """As reset, but time goes on."""
    from messages.requests import RESET_WORLD

    _tell(asker, RESET_WORLD, "models are where they were spawned")


def _tell(asker: Asker, request: Request[Any, Any], done: str) -> None:
    from messages.std import Empty

    reply = asker.ask(request, Empty())
    asker.show(reply, f"{done}: t = {reply.time / 1e9:.3f} s")
