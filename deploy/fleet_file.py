"""Reads a fleet file; errors name file, line and the nearest valid name."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import inspect
from msgspec.structs import replace

from deploy.composition import check_sharing
from deploy.controller_files import with_file_found
from deploy.fleet import (
    MODES,
    REMOVED_MODES,
    ChangeConfig,
    Fleet,
    GridConfig,
    ReferenceConfig,
    RobotConfig,
    RunConfig,
    ServiceConfig,
    StartPose,
)
from deploy.fleet_overrides import apply_overrides
from deploy.fleet_validation import validate_fleet
from deploy.grid import expand_grids, grid_key
from deploy.parameter_sets import check_changes
from deploy.report.checks import KEYS, Bound
from deploy.restart_policy import RestartPolicy
from models import is_world_file
from models.angles import angle_fault
from models.robot_source import resolve_robot
from models.toml_source import TomlKey, TomlSource, key_path
from models.world import find_world, read_world
from services.catalog import is_user_file
from services.runtime.errors import BadInput, did_you_mean, nearest, unknown_name
from services.runtime.user_folders import parameters_folder
from services.sim import SimParameters

FLEETS = Path(__file__).resolve().parent / "fleets"

RENAMED_FLEETS = {"square_seed": "square_tutorial", "arm_seed": "arm_tutorial"}
"""Former names of fleets of the project."""

_BY_MODE = "mode_bounds"
_NO_KEYS = (_BY_MODE, "folder")
"""Fields of ``Fleet`` that are not keys of a file."""
_TABLE_TYPES: dict[str, type[msgspec.Struct]] = {
    "": Fleet,
    "run": RunConfig,
    "robot": RobotConfig,
    "pose": StartPose,
    "services": ServiceConfig,
    "grid": GridConfig,
    "every_robot": ServiceConfig,
    "service": ServiceConfig,
    "reference": ReferenceConfig,
    "restart": RestartPolicy,
    "change": ChangeConfig,
    "bounds": Bound,
}
"""The record of each table, by the last part of the table's name."""


def fleet_names() -> tuple[str, ...]:
    """Return the names of the fleets that come with the project."""
    return tuple(sorted(each.stem for each in FLEETS.glob("*.toml")))


def find_fleet(name: str) -> Path:
    """Return the file of a fleet; ``name`` is one of ``fleet_names`` or the path of a TOML file. Raises BadInput."""
    if name in fleet_names():
        return FLEETS / f"{name}.toml"
    path = Path(name)
    if path.is_file():
        return path
    if path.suffix == ".toml" or "/" in name:
        near = did_you_mean(path.name, (each.name for each in path.parent.glob("*.toml")))
        raise BadInput(f"there is no fleet file {name}{near}")
    if name in RENAMED_FLEETS:
        raise BadInput(f"the fleet {name} is called {RENAMED_FLEETS[name]} now")
    near = did_you_mean(name, (each.name for each in Path().glob("*.toml")))
    if near and not nearest(name, fleet_names()):
        raise BadInput(f"there is no fleet {name[:80]!r}{near}")
    error = unknown_name("fleet", name, fleet_names())
    raise BadInput(f"{error}; give a fleet of your own by its path, e.g. ./{Path(name[:80]).stem}.toml")


def saved_parameters_file(fleet: str) -> Path:
    """Return the file of a fleet's saved parameters; that of its former name if only that exists."""
    file = parameters_folder() / f"{fleet}.db"
    if not file.exists():
        for old, new in RENAMED_FLEETS.items():
            if new == fleet and (before := file.with_stem(old)).exists():
                return before
    return file


def read_fleet(path: Path, overrides: Sequence[str] = (), robots: int | None = None) -> Fleet:
    """Read a fleet file and check it as far as possible without starting anything; raises BadInput.

    ``overrides`` are assignments to keys of the file, e.g. ``model=waffle``; ``robots`` sets the number of robots of
    its grid.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"the fleet file {path} cannot be read: {error}") from None
    return parse_fleet(path, text, overrides, robots)


def parse_fleet(path: Path, text: str, overrides: Sequence[str] = (), robots: int | None = None) -> Fleet:
    """Parse and check the fleet in ``text``; ``path`` is named in errors. Raises BadInput."""
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        place = f"{path}:{found[1]}" if found else f"{path}:{text.count(chr(10)) + 1}"
        raise BadInput(f"{place}: this is not TOML: {error}") from None
    except ValueError as error:  # a number of thousands of digits, whose line is unknown
        raise BadInput(f"{path}: this is not TOML: {error}") from None
    tree, changed = apply_overrides(tree, overrides, robots)
    source = TomlSource(path, text, [(each.path, each.option) for each in changed])
    _check_mode(tree, source)
    for name in _NO_KEYS:
        if name in tree:
            keys = [each.name for each in msgspec.structs.fields(Fleet) if each.name not in _NO_KEYS]
            raise unknown_name("key", name, keys, source.location(name))
    try:
        fleet = msgspec.convert(_place_in_world(_split_bounds(tree, source), source, path.parent), Fleet)
    except msgspec.ValidationError as error:
        raise _locate_error(source, tree, str(error)) from None
    source = source.with_written(grid_key(fleet))
    fleet = _resolve_user_files(expand_grids(fleet), path.parent)
    fleet = _resolve_robots(replace(fleet, folder=str(path.parent.absolute())), source)
    validate_fleet(fleet, source)
    check_sharing(fleet, source)
    check_changes(fleet, source)
    return fleet


def _check_mode(tree: dict[str, Any], source: TomlSource) -> None:
    """Raise BadInput for a removed mode."""
    run = tree.get("run")
    mode = run.get("mode") if isinstance(run, dict) else None
    if isinstance(mode, str) and mode in REMOVED_MODES:
        raise BadInput(f"{source.location('run', 'mode')}: {REMOVED_MODES[mode]}")


def _split_bounds(tree: dict[str, Any], source: TomlSource) -> dict[str, Any]:
    """Move the bounds of single modes, e.g. ``[bounds.real]``, out of the general ones, as ``Fleet`` has them."""
    bounds = tree.get("bounds")
    if not isinstance(bounds, dict):
        return tree
    for name, each in bounds.items():
        if isinstance(each, dict) and name not in (*KEYS, *MODES):
            raise unknown_name("figure or mode", name, (*KEYS, *MODES), source.location("bounds", name))
    by_mode = {name: each for name, each in bounds.items() if name in MODES}
    rest = {name: each for name, each in bounds.items() if name not in MODES}
    return {**tree, "bounds": rest, _BY_MODE: by_mode}


def _place_in_world(tree: dict[str, Any], source: TomlSource, folder: Path) -> dict[str, Any]:
    """Return the content with the path of its world resolved relative to ``folder``, and with the world's start as pose
    of each robot with ``pose = "world"``; raises BadInput.
    """
    name, where, of_sim = tree.get("world", SimParameters().world), source.location("world"), None
    services, robots = tree.get("service", []), tree.get("robot")
    for index, each in enumerate(services if isinstance(services, list) else ()):
        of_each = each.get("parameters") if isinstance(each, dict) and each.get("kind") == "sim" else None
        if isinstance(of_each, dict) and "world" in of_each:
            name, of_sim = of_each["world"], index
            where = source.location("service", index, "parameters", "world")
    if not isinstance(name, str):
        return tree  # msgspec rejects it
    try:
        name = str(find_world(name, folder)) if is_world_file(name) else name
        start = read_world(name, packages=_packages(tree, folder)).start
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    tree = {**tree, "world": name}
    if of_sim is not None:
        sim = {**services[of_sim], "parameters": {**services[of_sim]["parameters"], "world": name}}
        tree["service"] = [sim if index == of_sim else each for index, each in enumerate(services)]
    placed = [
        isinstance(each, dict) and each.get("pose") == "world" for each in (robots if isinstance(robots, list) else ())
    ]
    if not any(placed):
        return tree
    if start is None:
        raise BadInput(f"{where}: the world {name} has no start for a robot: give the robots a pose")
    pose = msgspec.to_builtins(start)
    rows = [{**each, "pose": pose} if own else each for each, own in zip(tree["robot"], placed, strict=True)]
    return {**tree, "robot": rows}


def _packages(tree: dict[str, Any], folder: Path) -> tuple[Path, ...]:
    """Return the package folders stated in a fleet file, without malformed entries."""
    run = tree.get("run")
    stated = run.get("packages") if isinstance(run, dict) else None
    return tuple(
        folder / Path(each).expanduser()
        for each in (stated if isinstance(stated, list) else ())
        if isinstance(each, str)
    )


def _resolve_user_files(fleet: Fleet, folder: Path) -> Fleet:
    """Resolve the files that the fleet names: Python services and controller files.

    A relative path is relative to the fleet file's folder.
    """

    def found(members: tuple[ServiceConfig, ...]) -> tuple[ServiceConfig, ...]:
        return tuple(
            replace(
                each,
                kind=str((folder / os.path.expanduser(each.kind)).resolve()),
                cwd=os.path.abspath(folder / os.path.expanduser(each.cwd)) if each.cwd else "",
            )
            if is_user_file(each.kind)
            else with_file_found(each, folder)
            for each in members
        )

    robots = tuple(replace(each, services=found(each.services)) for each in fleet.robot)
    return replace(fleet, robot=robots, every_robot=found(fleet.every_robot), service=found(fleet.service))


def _resolve_robots(fleet: Fleet, source: TomlSource) -> Fleet:
    """Import the fleet's robot files, and resolve its package folders; raises BadInput."""
    folder = Path(fleet.folder)
    packages = tuple((folder / os.path.expanduser(each)).resolve() for each in fleet.run.packages)
    for given, found in zip(fleet.run.packages, packages, strict=True):
        if not found.is_dir():
            raise BadInput(f"{source.location('run', 'packages')}: packages: there is no folder {given!r} ({found})")
    robots = []
    for index, robot in enumerate(fleet.robot):
        try:
            made = resolve_robot(robot.model, folder, packages, robot.xacro_args)
        except BadInput as error:
            raise BadInput(f"{source.location('robot', index, 'model')}: {error}") from None
        robots.append(replace(robot, model=made.model))
    return replace(fleet, robot=tuple(robots), run=replace(fleet.run, packages=tuple(map(str, packages))))


def _locate_error(source: TomlSource, tree: dict[str, Any], error: str) -> BadInput:
    """Return msgspec's error with the line of its path, and the alternatives if a key is unknown."""
    text, _, where = error.partition(" - at `$")
    path = key_path(where.rstrip("`"))
    if path[:1] == (_BY_MODE,):
        path = ("bounds", *path[1:])
    if found := re.search(r"unknown field `(.*?)`", text):
        names = [step for step in path if isinstance(step, str)]
        record = _TABLE_TYPES[names[-1] if names else ""]
        known = [each.name for each in msgspec.structs.fields(record)]
        unknown = unknown_name("key", found[1], known, source.location(*path, found[1]))
        at_top = path and found[1] in {each.name for each in msgspec.structs.fields(Fleet)}
        return BadInput(f"{unknown}; as a key of the fleet it goes above the first [table]") if at_top else unknown
    shown = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
    if found := re.search(r"Invalid enum value '(.*)'", text):
        choices = _choices(inspect.type_info(Fleet), path)
        near = did_you_mean(found[1], choices)
        text = f"{found[1][:80]!r} is not one of {', '.join(choices)}{near}" if choices else text
    text = angle_fault(_value(tree, path), path) or text
    return BadInput(f"{source.location(*path)}: {f'{shown}: ' if shown else ''}{text}")


def _value(tree: Any, path: Sequence[TomlKey]) -> Any:
    """Return the value at ``path`` of the file; None if the file does not contain it."""
    for step in path:
        try:
            tree = tree[step]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def _choices(kind: inspect.Type, path: Sequence[TomlKey]) -> tuple[str, ...]:
    """Return the choices of a key with fixed choices; ``kind`` is the type of the table in which ``path`` begins."""
    match kind:
        case inspect.Metadata():
            return _choices(kind.type, path)
        case inspect.UnionType():
            return tuple(choice for each in kind.types for choice in _choices(each, path))
        case inspect.LiteralType() if not path:
            return tuple(map(str, kind.values))
        case inspect.StructType() if path:
            fields = {each.encode_name: each.type for each in kind.fields}
            return _choices(fields[str(path[0])], path[1:]) if str(path[0]) in fields else ()
        case inspect.DictType() if path:
            return _choices(kind.value_type, path[1:])
        case inspect.ListType() | inspect.VarTupleType() if path:
            return _choices(kind.item_type, path[1:])
    return ()
