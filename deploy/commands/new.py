"""``elea new``: make a folder to start from."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup


@click.command(
    "new", cls=LazyGroup, table={"exercise": LazyCommand("new:exercise_command", "Make the folder of an exercise.")}
)
def command() -> None:
    """Make a folder to start from."""


@click.command("exercise")
@click.argument("name")
@click.option("--kind", default="obstacle_avoidance", show_default=True, help="Which exercise.")
@click.option(
    "--in", "parent", metavar="DIR", default=".", help="Folder to make it in; the working directory by default."
)
def exercise_command(name: str, kind: str, parent: str) -> None:
    """Make the folder NAME with an exercise: a fleet, a world, a controller to complete, and a test that grades it."""
    from deploy.exercises import make_exercise

    folder = make_exercise(name, kind, Path(parent))
    sys.stdout.write(f"{folder} is ready: read its README.md, then ./elea up {folder / 'fleet.toml'}\n")
