"""``elea node ping``: how long a node's loop takes to answer."""

from __future__ import annotations

import time
from typing import Any

import click

from deploy.commands.completion import NODE
from deploy.commands.options import json_option, place_options
from deploy.place import Place


@click.command("ping")
@click.argument("node", type=NODE)
@click.option("-n", "--count", type=click.IntRange(1, 10_000), default=4, show_default=True, help="So many pings.")
@click.option(
    "--interval", type=click.FloatRange(0, 60), default=1.0, show_default=True, metavar="S", help="Pause between two."
)
@click.option(
    "--timeout",
    type=click.FloatRange(0, 60, min_open=True),
    default=2.0,
    show_default=True,
    metavar="S",
    help="Patience.",
)
@place_options
@json_option
def command(node: str, count: int, interval: float, timeout: float, place: Place, as_json: bool) -> None:
    """Measure the round trip to the loop of NODE and back [ms]: through the network, and until the loop turns.

    A loop that hangs does not answer, whatever else its process does. The exit status is 1 when no ping was answered.
    """
    from deploy.live.ends import absent, absolute
    from deploy.live.output import say, say_json
    from deploy.live.session import session
    from services.runtime.graph import ping_key, snapshot

    name = absolute(node)
    with session(place, "ping") as live:
        nodes = {each.node: each.session for each in snapshot(live.transport) if each.kind == "node"}
        if name not in nodes or name == live.node:
            raise absent("node", name, nodes.keys() - {live.node}, "./elea node list tells them all")
        took: list[float | None] = []
        for number in range(count):
            if number:
                _rest(live, interval)
            if live.stopping:
                break
            sent = time.monotonic()
            answered = any(each.ok for each in live.transport.query(ping_key(nodes[name], name), b"", timeout))
            took.append((time.monotonic() - sent) * 1e3 if answered else None)
            if not as_json:
                say(f"{name}: {'no answer' if took[-1] is None else f'{took[-1]:.2f} ms'}\n", flush=True)
    told = _told(name, took)
    if as_json:
        say_json(told)
    elif told["answered"]:
        spread = f"min {told['min_ms']:.2f}, mean {told['mean_ms']:.2f}, max {told['max_ms']:.2f} ms"
        say(f"{told['answered']} of {told['sent']} answered: {spread}\n")
    else:
        say(f"0 of {told['sent']} answered: the loop hangs, or the node is a tool, which has none\n")
    raise SystemExit(0 if told["answered"] else 1)


def _rest(live: Any, seconds: float) -> None:
    """Wait for the next ping, or until the verb is stopped."""
    end = time.monotonic() + seconds
    while not live.stopping and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, 0.1))


def _told(name: str, took: list[float | None]) -> dict[str, Any]:
    came = [each for each in took if each is not None]
    return {
        "node": name,
        "sent": len(took),
        "answered": len(came),
        "min_ms": min(came, default=None),
        "mean_ms": sum(came) / len(came) if came else None,
        "max_ms": max(came, default=None),
        "round_trips_ms": took,
    }
