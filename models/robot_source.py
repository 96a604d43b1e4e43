"""Imported robots: converts a path to a URDF, a xacro or a folder to a folder of files that every process reads.

The files of a robot are in ``robots_folder()``, in a folder named after the robot and the hash of all its inputs: a
robot whose file has changed gets a new one, and running processes keep theirs. ``RobotSource.model`` is its name
wherever a model is expected: in a fleet, in a spawn request, in a service's parameters.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from messages.errors import BadInput, unknown_name
from models import MODELS, UnknownModel, urdf_path
from models.model import read_model
from models.packages import OWNER, FileAccess, PackagePath
from models.robot_cache import IMPORTED, robots_folder
from models.robot_facts import read_facts
from models.urdf import read_urdf
from models.xacro_file import XacroValue, expand_xacro

_FILES = ("robot.urdf", "robot.urdf.xacro", "robot.xacro")


@dataclass(frozen=True)
class RobotSource:
    """A robot's files: its ``urdf`` with absolute mesh paths.

    ``model`` identifies the robot in fleets, requests and parameters, ``name`` is its display name. ``notes`` list
    assumptions.
    """

    model: str
    name: str
    urdf: Path
    notes: tuple[str, ...] = ()


def names_file(model: str) -> bool:
    """Whether a model is given by a path rather than by the name of a built-in one."""
    return "/" in model or model.endswith((".urdf", ".xacro")) or model in (".", "..", "~")


def resolve_robot(
    model: str,
    base: Path,
    packages: Sequence[Path] = (),
    xacro_args: Mapping[str, XacroValue] | None = None,
    access: FileAccess = OWNER,
    faults: list[str] | None = None,
) -> RobotSource:
    """Return the files of a robot; raises BadInput, with file and line.

    Args:
        model: A name of ``models/``; the value of a ``RobotSource.model``; or a path to a URDF, a xacro, or a folder
            with one of them and perhaps a ``model.toml``.
        base: The folder that a relative path is relative to.
        packages: Folders in which ``package://`` is searched for, in addition to ROS's; each is a package or contains
            some.
        xacro_args: Values of a xacro's arguments.
        access: What may be read.
        faults: Collects errors of unreadable meshes, which are then left out; without a list they are raised.
    """
    if xacro_args and not names_file(model):
        raise BadInput(f"xacro_args are only for a xacro: {model[:100]!r} is not the path of one")
    if model in MODELS:
        return RobotSource(model, model, urdf_path(model))
    if (found := find_imported(model)) is not None:
        return found
    if not names_file(model):
        error = unknown_name("model", model, MODELS)
        own = model if (base / model).is_dir() else f"{model[:80]}.urdf"
        raise UnknownModel(f"{error}; give a robot of your own by its path, e.g. ./{own}")
    path = _robot_file(base / os.path.expanduser(model) if access.folders is None else base / model, access)
    if path.suffix.lower() == ".xacro":
        if not access.run_xacro:
            raise BadInput(
                f"{path}: a xacro is code, and a request may not run code: spawn it with ./elea sim spawn, which "
                "expands it on your side, or send the URDF"
            )
        urdf, label = expand_xacro(path, xacro_args or {}, packages), f"{path} (expanded)"
    else:
        urdf, label = read_urdf(path), str(path)
        if "<xacro:" in urdf and access.run_xacro:
            urdf, label = expand_xacro(path, xacro_args or {}, packages), f"{path} (expanded)"
        elif xacro_args:
            raise BadInput(f"{path}: xacro_args are only for a xacro: this is a plain URDF")
    toml = path.with_name("model.toml")
    config = toml if path.name in _FILES and toml.exists() else None
    if config is not None:
        access.check(config, str(config))
    return _make(_name_of(path), urdf, path, label, config, packages, access, faults=faults)


def resolve_urdf_text(
    urdf: str, packages: Sequence[Path] = (), access: FileAccess = OWNER, name: str = "", base: Path | None = None
) -> RobotSource:
    """Return the files of a robot whose URDF is given as text; raises BadInput, with the line.

    With ``base``, its packages are also searched for above that folder.
    """
    if "<xacro:" in urdf:
        raise BadInput(
            "this text is a xacro, which is code and is not run: send the URDF that the command xacro prints"
        )
    return _make(name, urdf, None, name or "the URDF", None, packages, access, base)


def find_imported(model: str) -> RobotSource | None:
    """Return the robot with this ``RobotSource.model``; None if it was never imported, or removed as unused."""
    folder = Path(model) if "/" in model else robots_folder() / model
    if not IMPORTED.fullmatch(folder.name) or folder.parent != robots_folder() or not (folder / "facts.json").is_file():
        return None
    return _source(folder)


def _make(
    name: str,
    urdf: str,
    path: Path | None,
    label: str,
    config: Path | None,
    packages: Sequence[Path],
    access: FileAccess,
    base: Path | None = None,
    faults: list[str] | None = None,
) -> RobotSource:
    from models.robot_files import make_robot  # numpy and mesh decoders, which the command line alone never needs

    found = _source(make_robot(name, urdf, path, label, config, PackagePath(tuple(packages)), access, base, faults))
    read_model(found.model)
    return found


def _source(folder: Path) -> RobotSource:
    os.utime(folder)
    facts = read_facts(str(folder))
    return RobotSource(str(folder), facts.name, folder / "robot.urdf", facts.notes)


def _robot_file(path: Path, access: FileAccess) -> Path:
    """Return the URDF or xacro that a path refers to."""
    path = Path(os.path.abspath(path))
    access.check(path, str(path))
    if not path.is_dir():
        if not path.exists():
            near = _siblings(path)
            raise BadInput(f"there is no file {path}{near}")
        return path
    for name in _FILES:
        if (path / name).is_file():
            access.check(path / name, str(path / name))
            return path / name
    found = [each for folder in (path, path / "urdf") for each in sorted(folder.glob("*")) if _is_robot_file(each)]
    if len(found) == 1:
        access.check(found[0], str(found[0]))
        return found[0]
    if not found:
        raise BadInput(f"{path} contains no robot: a robot's folder has a robot.urdf, or exactly one URDF or xacro")
    names = ", ".join(str(each.relative_to(path)) for each in found[:20])
    raise BadInput(f"{path} contains {len(found)} robots, choose one of them: {names}")


def _is_robot_file(path: Path) -> bool:
    return path.suffix.lower() in (".urdf", ".xacro")


def _siblings(path: Path) -> str:
    try:
        names = [each.name for each in path.parent.iterdir() if _is_robot_file(each) or each.is_dir()]
    except OSError:
        return ""
    return f" (in its folder: {', '.join(sorted(names)[:20])})" if names else ""


def _name_of(path: Path) -> str:
    """Return ``my_robot`` for ``my_robot.urdf.xacro``; for ``robot.urdf``, the folder's name."""
    stem = path.name.split(".")[0]
    return path.parent.name if path.name in _FILES else stem
