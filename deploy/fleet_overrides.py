"""``--set KEY=VALUE``: keys of a fleet file that are changed on the command line, before the file is checked."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from deploy.fleet import RobotConfig, RunConfig
from deploy.service_parameters import BUILTIN_SERVICES
from models import is_world_file
from models.toml_source import TomlKey
from services.runtime.errors import BadInput, unknown_name

HELP = (
    "Change a key of the fleet file: model=waffle (of its only robot), world=house, ROBOT.model=waffle, "
    "ROBOT.pose.x=1, ROBOT.parameters.odometry=world, SERVICE.PARAMETER=VALUE, run.KEY=VALUE. May be repeated."
)


class Override(NamedTuple):
    """A changed key: its path in the file, and the assignment as it was written."""

    path: tuple[TomlKey, ...]
    text: str


def apply_overrides(tree: dict[str, Any], assignments: Sequence[str]) -> tuple[dict[str, Any], tuple[Override, ...]]:
    """The content of a fleet file with these assignments, and where each of them went.

    Args:
        tree: The content of the file; it stays as it is.
        assignments: As written behind ``--set``, in order; the last of several for one key counts.

    Raises:
        BadInput: An assignment is none, or means nothing in this file.
    """
    changed = copy.deepcopy(tree)
    return changed, tuple(each for text in assignments for each in _apply(changed, text))


def _apply(tree: dict[str, Any], text: str) -> Iterator[Override]:
    name, equals, value = text.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys):
        raise BadInput(f"--set {text!r} is no assignment: write KEY=VALUE, as model=waffle or run.seed=3")
    paths = list(_paths(tree, keys, text))
    for path in paths:
        _assign(tree, path, _value(value.strip(), path), text)
        yield Override(path, text)


def _paths(tree: dict[str, Any], keys: list[str], text: str) -> Iterator[tuple[TomlKey, ...]]:
    """Where a key lies in the file; a service of every robot is one, one that each robot states is several."""
    first, *rest = keys
    robots = [each.get("name") for each in _tables(tree, "robot")]
    services = dict(_services(tree))
    if first == "run" and rest:
        yield ("run", *rest)
    elif first == "world" and not rest:
        sims = [each for each in _tables(tree, "service") if each.get("kind") == "sim"]
        own = [each.get("parameters") for each in sims]
        stated = any(isinstance(each, dict) and "world" in each for each in own)
        yield (*_builtin(tree, "sim"), "parameters", "world") if stated else ("world",)
    elif first == "model" and not rest:
        if len(robots) != 1:
            raise BadInput(
                f"--set {text}: this fleet has {len(robots)} robots: say which, as ROBOT.model=… "
                f"({', '.join(map(str, robots))})"
            )
        yield ("robot", 0, "model")
    elif first in robots and rest:
        yield ("robot", robots.index(first), *rest)
    elif first in services.values() and rest:
        yield from ((*path, "parameters", *rest) for path, name in services.items() if name == first)
    elif first in BUILTIN_SERVICES and rest:
        yield (*_builtin(tree, first), "parameters", *rest)
    elif first in (*robots, *services.values(), *BUILTIN_SERVICES, "run"):
        raise BadInput(f"--set {text}: {first} is a table: say which of its keys, as {_example(first, robots)}")
    else:
        known = ["model", "world", "run", *map(str, robots), *services.values(), *BUILTIN_SERVICES]
        raise unknown_name("key", first, list(dict.fromkeys(known)), f"--set {text}")


def _example(first: str, robots: Sequence[object]) -> str:
    if first == "run":
        return f"run.{msgspec.structs.fields(RunConfig)[0].name}=…"
    return f"{first}.{msgspec.structs.fields(RobotConfig)[1].name}=…" if first in robots else f"{first}.PARAMETER=…"


def _services(tree: dict[str, Any]) -> Iterator[tuple[tuple[TomlKey, ...], str]]:
    """Where each service is stated, and its name."""
    for table in ("service", "every_robot"):
        for index, each in enumerate(_tables(tree, table)):
            yield (table, index), str(each.get("name") or each.get("kind"))
    for number, robot in enumerate(_tables(tree, "robot")):
        for index, each in enumerate(_tables(robot, "services")):
            yield ("robot", number, "services", index), str(each.get("name") or each.get("kind"))


def _builtin(tree: dict[str, Any], kind: str) -> tuple[TomlKey, ...]:
    """The table of a service that every fleet has; it is added where the file states none."""
    stated = _tables(tree, "service")
    found = next((index for index, each in enumerate(stated) if each.get("kind") == kind), None)
    if found is None:
        found = len(stated)
        tree["service"] = [*stated, {"kind": kind}]
    return ("service", found)


def _tables(tree: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """The tables of an array as far as they are some; what else a file has there is refused when it is checked."""
    found = tree.get(name)
    return found if isinstance(found, list) and all(isinstance(each, dict) for each in found) else []


def _value(text: str, path: Sequence[TomlKey]) -> Any:
    """A value as TOML has it; anything else is text. The file of a model or world counts from the working
    directory."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    if path[0] == "robot" and path[-1] == "model" and isinstance(value, str):
        from models.robot_source import names_file  # it loads what reads meshes, which no --help is to wait for

        return str(Path(value).expanduser().absolute()) if names_file(value) else value
    if path[-1] == "world" and isinstance(value, str) and is_world_file(value):
        return str(Path(value).expanduser().absolute())
    return value


def _assign(tree: dict[str, Any], path: Sequence[TomlKey], value: Any, text: str) -> None:
    at: Any = tree
    for step in path[:-1]:
        if isinstance(step, int):
            at = at[step]
            continue
        if not isinstance(at.setdefault(step, {}), dict | list):
            at[step] = {}  # as pose = "world", of which one coordinate is set
        at = at[step]
    if not isinstance(at, dict):
        raise BadInput(f"--set {text}: {path[-2]} is a list: set it as a whole")
    at[path[-1]] = value
