"""The robots and worlds of this project: their names and the paths of their files."""

from __future__ import annotations

from pathlib import Path

from messages.errors import BadInput, did_you_mean
from models.robot_cache import display_name as display_name
from models.robot_cache import is_imported

WHEELED = ("burger", "waffle", "waffle_pi", "p3dx")
"""The robots with a differential drive."""

ARMS = ("arm", "arm_corrected")
"""The robots without wheels, whose joints are commanded by effort."""

MODELS = (*WHEELED, *ARMS)
"""Every robot of this folder; each has a ``robot.urdf``, a ``model.toml`` and a ``README.md``."""

WORLDS = ("arena", "empty", "house")
"""Every world of ``worlds/``."""

_HERE = Path(__file__).resolve().parent


class UnknownModel(BadInput):
    """No model or world has this name; the text lists the known ones."""


def not_in_cache(model: str) -> UnknownModel:
    """Return the error for an imported robot whose files were removed or damaged."""
    return UnknownModel(
        f"the imported robot {model} is no longer in the cache: start the fleet, or spawn the robot, from its URDF "
        "again"
    )


def urdf_path(model: str) -> Path:
    """Return the URDF of a robot, built-in or imported; raises UnknownModel with the nearest name and the list."""
    return _model_folder(model) / "robot.urdf"


def physics_urdf_path(model: str) -> Path:
    """Return the URDF for the physics engine; raises UnknownModel."""
    return _model_folder(model) / ("physics.urdf" if is_imported(model) else "robot.urdf")


def viewer_urdf_path(model: str) -> Path:
    """Return the URDF for the viewer; raises UnknownModel."""
    return _model_folder(model) / ("viewer.urdf" if is_imported(model) else "robot.urdf")


def model_config_path(model: str) -> Path:
    """Return the configuration of a robot's drive and sensors, see ``models.model``; an imported robot may have none.
    Raises UnknownModel."""
    return _model_folder(model) / "model.toml"


WORLD_ENDINGS = (".toml", ".sdf", ".world", ".yaml", ".yml")
"""File extensions of worlds."""


def is_world_file(name: str) -> bool:
    """Whether a world is given by the path of its file rather than as one of WORLDS."""
    return "/" in name or name.endswith(WORLD_ENDINGS)


def world_path(name: str) -> Path:
    """Return the file of a built-in world, see ``models.world``; raises UnknownModel."""
    try:
        return _HERE / "worlds" / f"{_checked_name('world', name, WORLDS)}.toml"
    except UnknownModel as error:
        raise UnknownModel(f"{error}; give a world of your own by its path, e.g. ./{name[:80]}.toml") from None


def _model_folder(model: str) -> Path:
    if not is_imported(model):
        return _HERE / _checked_name("model", model, MODELS)
    if not (Path(model) / "robot.urdf").is_file():
        raise not_in_cache(model)
    return Path(model)


def _checked_name(kind: str, name: str, names: tuple[str, ...]) -> str:
    if name in names:
        return name
    raise UnknownModel(f"unknown {kind} {name[:255]!r}{did_you_mean(name, names)} (known: {', '.join(names)})")
