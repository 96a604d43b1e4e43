"""``elea bench``: the middleware against raw floors."""

from __future__ import annotations

import click

from deploy.commands.options import json_option


@click.command("bench")
@click.option("--rounds", type=click.IntRange(1, 1000), default=5, show_default=True, help="Rounds; medians are shown.")
@json_option
def command(rounds: int, as_json: bool) -> None:
    """Measure round trip, throughput, lockstep and start against raw Zenoh and raw PyBullet, interleaved."""
    from deploy.bench import bench

    raise SystemExit(bench(rounds, as_json))
