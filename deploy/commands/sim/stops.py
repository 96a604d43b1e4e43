"""``elea sim stops`` and ``release``: the emergency stops that hold, and the way out when a holder is gone for good."""

from __future__ import annotations

import click

from deploy.commands.sim.ask import Asker, asks, table


@click.command("stops")
@asks
def stops(asker: Asker) -> None:
    """List the emergency stops: who holds which robot, and since when."""
    from datetime import datetime

    from messages.requests import LIST_STOPS
    from messages.std import Empty

    reply = asker.ask(LIST_STOPS, Empty())
    rows = [("robot", "holder", "since", "reset by its holder with false on")]
    for each in reply.stops:
        since = f"{datetime.fromtimestamp(each.since // 1_000_000_000):%Y-%m-%d %H:%M:%S}"
        rows.append((each.robot or "(all robots)", each.holder, since, each.topic))
    asker.show(reply, table(rows) if reply.stops else "no robot is stopped")


@click.command("release")
@click.argument("name", default="")
@click.option("--all", "every", is_flag=True, help="The stop of all robots (/e_stop), in place of one robot's own.")
@click.option(
    "--holder", default="", help="Only what this node holds, by name or id as `stops` lists it; else everyone."
)
@asks
def release(asker: Asker, name: str, every: bool, holder: str) -> None:
    """Release the emergency stop of the robot NAME for those who hold it.

    For holders that are gone for good; one that is there resets its stop itself, by false on the topic. A publisher
    that still says true stops the robot again when the simulation restarts.
    """
    from messages.requests import RELEASE_STOP
    from messages.simulation import ReleaseStop

    if every == bool(name):
        raise click.UsageError("give the NAME of a robot, or --all for the stop of all robots")
    reply = asker.ask(RELEASE_STOP, ReleaseStop(name=name, holder=holder))
    asker.show(reply, reply.text)
