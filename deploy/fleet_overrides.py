"""``--set KEY=VALUE``: keys of a fleet file overridden on the command line, before the file is checked."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from deploy.fleet import GridConfig, RobotConfig, RunConfig
from deploy.service_parameters import BUILTIN_SERVICES
from models import is_world_file
from models.toml_source import TomlKey
from services.runtime.errors import BadInput, unknown_name

HELP = (
    "Change a key of the fleet file: model=waffle (of its only robot), world=house, ROBOT.model=waffle, "
    "ROBOT.pose.x=1, ROBOT.parameters.odometry=world, SERVICE.PARAMETER=VALUE, run.KEY=VALUE, grid.KEY=VALUE; "
    "or 'SET NAME=VALUE' for a live parameter of one set, e.g. '/tb3_0/waypoint max_linear=0.1'. May be repeated."
)


_NO_GRID = "this fleet has no [[grid]] of robots; the fleet swarm has one"
_SEVERAL_GRIDS = "this fleet has several [[grid]]: change them in its file"


class Override(NamedTuple):
    """An overridden key: its path in the file, and the option as written."""

    path: tuple[TomlKey, ...]
    option: str


def apply_overrides(
    tree: dict[str, Any], assignments: Sequence[str], robots: int | None = None
) -> tuple[dict[str, Any], tuple[Override, ...]]:
    """Return the content of a fleet file with these assignments, and the keys that they changed.

    Args:
        tree: The content of the file; it is not changed.
        assignments: As written after ``--set``, in order; the last of several for one key counts.
        robots: As written after ``--robots``: the number of robots of the fleet's grid.

    Raises:
        BadInput: An assignment is malformed, or matches no key of this file.
    """
    changed = copy.deepcopy(tree)
    options = [(text, f"--set {text}") for text in assignments]
    if robots is not None:
        options.append((f"grid.robots={robots}", f"--robots {robots}"))
    return changed, tuple(each for text, option in options for each in _apply(changed, text, option))


def _apply(tree: dict[str, Any], text: str, option: str) -> Iterator[Override]:
    name, equals, value = text.partition("=")
    set_name, _, parameter = name.strip().partition(" ")
    if equals and set_name.startswith("/") and parameter.strip():
        path = _change_at_start(tree, set_name, parameter.strip())
        _assign(tree, path, _value(value.strip(), path), option)
        yield Override(path, option)
        return
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise BadInput(
            f"--set {text!r} is not an assignment: write KEY=VALUE, e.g. model=waffle or run.seed=3, or "
            "'SET NAME=VALUE', e.g. '/tb3_0/waypoint max_linear=0.1'"
        )
    paths = list(_paths(tree, keys, option))
    for path in paths:
        _assign(tree, path, _value(value.strip(), path), option)
        yield Override(path, option)


def _change_at_start(tree: dict[str, Any], set_name: str, parameter: str) -> tuple[TomlKey, ...]:
    """Return the path of a set's parameter in its ``[[change]]`` at 0 s, which is added if there is none."""
    changes = _tables(tree, "change")
    found = next(
        (index for index, each in enumerate(changes) if (each.get("set"), each.get("at")) == (set_name, 0)), None
    )
    if found is None:
        found = len(changes)
        tree["change"] = [*changes, {"at": 0, "set": set_name, "values": {}}]
    return ("change", found, "values", parameter)


def _paths(tree: dict[str, Any], keys: list[str], option: str) -> Iterator[tuple[TomlKey, ...]]:
    """Yield the paths of a key; a service's name may have several: one for each robot that states it."""
    first, *rest = keys
    robots = [each.get("name") for each in _tables(tree, "robot")]
    services = dict(_services(tree))
    if first == "run" and rest:
        yield ("run", *rest)
    elif first == "grid" and rest:
        if (grids := len(_tables(tree, "grid"))) != 1:
            raise BadInput(f"{option}: {_SEVERAL_GRIDS if grids else _NO_GRID}")
        yield ("grid", 0, *rest)
    elif first == "world" and not rest:
        sims = [each for each in _tables(tree, "service") if each.get("kind") == "sim"]
        own = [each.get("parameters") for each in sims]
        stated = any(isinstance(each, dict) and "world" in each for each in own)
        yield (*_builtin(tree, "sim"), "parameters", "world") if stated else ("world",)
    elif first == "model" and not rest:
        if len(robots) != 1:
            raise BadInput(
                f"{option}: this fleet has {len(robots)} robots: say which, e.g. ROBOT.model=… "
                f"({', '.join(map(str, robots))})"
            )
        yield ("robot", 0, "model")
    elif first in robots and rest:
        yield ("robot", robots.index(first), *rest)
    elif first in services.values() and rest:
        yield from ((*path, "parameters", *rest) for path, name in services.items() if name == first)
    elif first in BUILTIN_SERVICES and rest:
        yield (*_builtin(tree, first), "parameters", *rest)
    elif first in (*robots, *services.values(), *BUILTIN_SERVICES, "run", "grid"):
        raise BadInput(f"{option}: {first} is a table: say which of its keys, e.g. {_example(first, robots)}")
    else:
        known = [
            "model",
            "world",
            "run",
            *(["grid"] if tree.get("grid") else []),
            *map(str, robots),
            *services.values(),
            *BUILTIN_SERVICES,
        ]
        raise unknown_name("key", first, list(dict.fromkeys(known)), option)


def _example(first: str, robots: Sequence[object]) -> str:
    if first == "grid":
        return f"{first}.{msgspec.structs.fields(GridConfig)[0].name}=…"
    if first == "run":
        return f"run.{msgspec.structs.fields(RunConfig)[0].name}=…"
    return f"{first}.{msgspec.structs.fields(RobotConfig)[1].name}=…" if first in robots else f"{first}.PARAMETER=…"


def _services(tree: dict[str, Any]) -> Iterator[tuple[tuple[TomlKey, ...], str]]:
    """Yield the path of each stated service, and its name."""
    for table in ("service", "every_robot"):
        for index, each in enumerate(_tables(tree, table)):
            yield (table, index), str(each.get("name") or each.get("kind"))
    for table in ("robot", "grid"):
        for number, robot in enumerate(_tables(tree, table)):
            for index, each in enumerate(_tables(robot, "services")):
                yield (table, number, "services", index), str(each.get("name") or each.get("kind"))


def _builtin(tree: dict[str, Any], kind: str) -> tuple[TomlKey, ...]:
    """Return the path of the table of a service that every fleet has, adding the table if the file states none."""
    stated = _tables(tree, "service")
    found = next((index for index, each in enumerate(stated) if each.get("kind") == kind), None)
    if found is None:
        found = len(stated)
        tree["service"] = [*stated, {"kind": kind}]
    return ("service", found)


def _tables(tree: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """Return an array's tables; empty if it contains anything else, which is rejected when the file is checked."""
    found = tree.get(name)
    return found if isinstance(found, list) and all(isinstance(each, dict) for each in found) else []


def _value(text: str, path: Sequence[TomlKey]) -> Any:
    """Parse a TOML value; anything else is text. The file of a model or world is relative to the working directory."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except ValueError:  # no TOML, or a number of thousands of digits
        value = text
    if path[0] in ("robot", "grid") and path[-1] == "model" and isinstance(value, str):
        from models.robot_source import names_file  # importing it loads mesh readers, which --help must not wait for

        return str(Path(value).expanduser().absolute()) if names_file(value) else value
    if path[-1] == "world" and isinstance(value, str) and is_world_file(value):
        return str(Path(value).expanduser().absolute())
    return value


def _assign(tree: dict[str, Any], path: Sequence[TomlKey], value: Any, option: str) -> None:
    at: Any = tree
    for number, step in enumerate(path[:-1]):
        if isinstance(step, int):
            at = at[step]
            continue
        if not isinstance(at, dict):
            raise BadInput(f"{option}: {path[number - 1]} is a list: set it as a whole")
        if not isinstance(at.setdefault(step, {}), dict | list):
            at[step] = {}  # e.g. pose = "world", of which one coordinate is set
        at = at[step]
    if not isinstance(at, dict):
        raise BadInput(f"{option}: {path[-2]} is a list: set it as a whole")
    at[path[-1]] = value
