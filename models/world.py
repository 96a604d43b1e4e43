"""Worlds without robots, by name or path: the ground, and the fixed, movable and moving bodies on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from messages.errors import did_you_mean
from models import is_world_file, world_path
from models.bodies import BadWorld as BadWorld
from models.bodies import Box as Box
from models.bodies import Start as Start
from models.bodies import WorldBody as WorldBody
from models.bodies import WorldDescription as WorldDescription


def read_world(name: str, base: Path | None = None, packages: Sequence[Path] = ()) -> WorldDescription:
    """Read a world by its name or the path of its file.

    Args:
        name: One of ``models.WORLDS``; or a path, which has a slash or one of the extensions ``.toml``, ``.sdf``,
            ``.world``, ``.yaml`` or ``.yml``, of a world, an SDF, or the ``map.yaml`` of a floor plan.
        base: The folder that relative paths are relative to; the working directory by default.
        packages: Folders in which ``package://`` and ``model://`` are searched for.

    Raises:
        models.UnknownModel: No world has this name.
        BadWorld: The file, or one that it refers to, cannot be read.
    """
    from models.world_file import read_world_file  # with numpy and Pillow, which most commands do not need

    return read_world_file(find_world(name, base), packages)


def find_world(name: str, base: Path | None = None) -> Path:
    """Return the file of a world; raises ``models.UnknownModel``, or BadWorld if the path does not exist."""
    if not is_world_file(name):
        return world_path(name)
    path = (base or Path()) / Path(name).expanduser()
    if not path.is_file():
        files = [each.name for each in path.parent.glob("*") if is_world_file(each.name)]
        raise BadWorld(f"there is no world file {path}{did_you_mean(path.name, files)}")
    return path.resolve()
