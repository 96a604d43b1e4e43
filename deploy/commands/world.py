"""``elea world``: list the worlds, check a world's file, and write a world as a map."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option
from deploy.live.output import write_json, write_listing, write_text

COMMANDS = {
    "list": LazyCommand("world:list_command", "List the worlds that come with Elea."),
    "check": LazyCommand("world:check_command", "Check a world's file and show what it contains."),
    "map": LazyCommand("world:map_command", "Write a world as map.yaml and PGM."),
}


@click.command("world", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Worlds: those that come with Elea, and files of your own. Needs no network.

    A world file is TOML in Elea's format, an SDF (.sdf, .world) or a map.yaml.
    """


@click.command("list")
@json_option
def list_command(as_json: bool) -> None:
    """List the worlds that come with Elea."""
    from models import WORLDS
    from models.world import read_world

    write_listing({name: read_world(name).about for name in WORLDS}, as_json)


@click.command("check")
@click.argument("world")
@click.option("--packages", multiple=True, type=click.Path(path_type=Path), help="Folder to look for model:// in.")
@json_option
def check_command(world: str, packages: tuple[Path, ...], as_json: bool) -> None:
    """Read WORLD, a name or the path of a file, and show what it contains and which parts are not supported.

    Exit status 2 if it cannot be read.
    """
    from models.world import read_world

    found = read_world(world, packages=packages)
    kinds: Counter[str] = Counter(body.kind for body in found.all_bodies)
    parts = [part for body in found.all_bodies for part in body.parts]
    shapes = Counter(type(part.shape).__name__.removesuffix("Shape") for part in parts)
    if as_json:
        write_json({"about": found.about, "bodies": kinds, "shapes": shapes, "notes": found.notes})
        return
    total = sum(kinds.values())
    lines = [f"{found.about or world}: {total} {'body' if total == 1 else 'bodies'} ({_counts(kinds)})"]
    lines += [f"shapes: {_counts(shapes)}"] if shapes else []
    lines += [f"not understood: {len(found.notes)}", *(f"  {note}" for note in found.notes)] if found.notes else []
    write_text("\n".join(lines) + "\n")


@click.command("map")
@click.argument("world")
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("map.yaml"), help="The file to write.")
@click.option(
    "--resolution", type=click.FloatRange(0.001, 10), default=0.05, show_default=True, help="Cell size, in m."
)
@click.option(
    "--height",
    type=click.FloatRange(0.06, 100),
    default=0.5,
    show_default=True,
    help="Only what lies between 0.05 m and this height, in m, counts as an obstacle.",
)
@click.option("--packages", multiple=True, type=click.Path(path_type=Path), help="Folder to look for model:// in.")
def map_command(world: str, output: Path, resolution: float, height: float, packages: tuple[Path, ...]) -> None:
    """Write WORLD, a name or the path of a file, as a map for ROS: map.yaml, and beside it a picture, map.pgm.

    A cell is occupied where something solid stands, else free. Bodies that move by themselves are left out.
    """
    from deploy.world_map import world_map
    from models.floor_plan import write_map
    from models.world import read_world
    from services.runtime.errors import BadInput

    if output.suffix not in (".yaml", ".yml"):
        raise BadInput(f"{output}: the name of a map must end with .yaml or .yml")
    drawn = world_map(read_world(world, packages=packages), resolution, height)
    try:
        write_map(output, drawn.occupied, ~drawn.occupied, resolution, (*drawn.origin, 0.0))
    except OSError as error:
        raise BadInput(f"{output} cannot be written: {error.strerror}") from None
    rows, columns = drawn.occupied.shape
    write_text(f"{output}: {columns} x {rows} cells of {resolution:g} m, {int(drawn.occupied.sum())} occupied\n")


def _counts(counts: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(counts.items())) or "none"
