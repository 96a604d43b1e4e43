"""Reading a fleet file: what is wrong in it is told with file, line and the nearest right name."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from deploy.fleet import GONE_MODES, MODES, Change, Fleet, Member, Robot, Run, Start
from deploy.fleet_check import check
from deploy.own_service import is_own
from deploy.parameter_sets import check_changes
from deploy.policy import Policy
from deploy.report.bounds import KEYS, Bound
from deploy.toml_place import Source, Step
from services.runtime.errors import BadInput, unknown

FLEETS = Path(__file__).resolve().parent / "fleets"

_BY_MODE = "mode_bounds"
_TABLES: dict[str, type[msgspec.Struct]] = {
    "": Fleet,
    "run": Run,
    "robot": Robot,
    "pose": Start,
    "services": Member,
    "every_robot": Member,
    "service": Member,
    "restart": Policy,
    "change": Change,
    "bounds": Bound,
}
"""The record behind each table, by its last name."""


def fleet_names() -> tuple[str, ...]:
    """The fleets that come with the project."""
    return tuple(sorted(each.stem for each in FLEETS.glob("*.toml")))


def find_fleet(name: str) -> Path:
    """The file of a fleet: ``name`` is one of ``fleet_names``, or the path of a TOML file; raises BadInput."""
    if name in fleet_names():
        return FLEETS / f"{name}.toml"
    path = Path(name)
    if path.is_file():
        return path
    if path.suffix == ".toml" or "/" in name:
        raise BadInput(f"there is no fleet file {name}")
    raise unknown("fleet", name, fleet_names())


def read_fleet(path: Path) -> Fleet:
    """The fleet in a file, checked as far as it can be without starting anything; raises BadInput."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"the fleet file {path} cannot be read: {error}") from None
    return parse_fleet(path, text)


def parse_fleet(path: Path, text: str) -> Fleet:
    """The fleet in ``text``; ``path`` is named in errors. Raises BadInput."""
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        place = f"{path}:{found[1]}" if found else f"{path}:{text.count(chr(10)) + 1}"
        raise BadInput(f"{place}: this is not TOML: {error}") from None
    source = Source(path, text)
    _check_mode(tree, source)
    if _BY_MODE in tree:
        raise unknown("key", _BY_MODE, [each.name for each in msgspec.structs.fields(Fleet)], source.at(_BY_MODE))
    try:
        fleet = msgspec.convert(_apart(tree, source), Fleet)
    except msgspec.ValidationError as error:
        raise _located(source, str(error)) from None
    fleet = _with_files(fleet, path.parent)
    check(fleet, source)
    check_changes(fleet, source)
    return fleet


def _check_mode(tree: dict[str, Any], source: Source) -> None:
    """Raise BadInput for a mode that there was once."""
    run = tree.get("run")
    mode = run.get("mode") if isinstance(run, dict) else None
    if isinstance(mode, str) and mode in GONE_MODES:
        raise BadInput(f"{source.at('run', 'mode')}: {GONE_MODES[mode]}")


def _apart(tree: dict[str, Any], source: Source) -> dict[str, Any]:
    """The bounds for one mode, as ``[bounds.real]``, apart from those beside them, as the record has them."""
    bounds = tree.get("bounds")
    if not isinstance(bounds, dict):
        return tree
    for name, each in bounds.items():
        if isinstance(each, dict) and name not in (*KEYS, *MODES):
            raise unknown("figure or mode", name, (*KEYS, *MODES), source.at("bounds", name))
    by_mode = {name: each for name, each in bounds.items() if name in MODES}
    rest = {name: each for name, each in bounds.items() if name not in MODES}
    return {**tree, "bounds": rest, _BY_MODE: by_mode}


def _with_files(fleet: Fleet, folder: Path) -> Fleet:
    """The fleet with the Python files among its kinds found: a relative one counts from the fleet file's folder."""

    def found(members: tuple[Member, ...]) -> tuple[Member, ...]:
        return tuple(
            replace(each, kind=str((folder / each.kind).resolve())) if is_own(each.kind) else each for each in members
        )

    robots = tuple(replace(each, services=found(each.services)) for each in fleet.robot)
    return replace(fleet, robot=robots, every_robot=found(fleet.every_robot), service=found(fleet.service))


def _located(source: Source, error: str) -> BadInput:
    """msgspec's error with the line of its path, and the alternatives when a key is unknown."""
    text, _, where = error.partition(" - at `$")
    path = _path(where.rstrip("`"))
    if path[:1] == (_BY_MODE,):
        path = ("bounds", *path[1:])
    if found := re.search(r"unknown field `(.*?)`", text):
        names = [step for step in path if isinstance(step, str)]
        record = _TABLES[names[-1] if names else ""]
        known = [each.name for each in msgspec.structs.fields(record)]
        return unknown("key", found[1], known, source.at(*path, found[1]))
    shown = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
    return BadInput(f"{source.at(*path)}: {f'{shown}: ' if shown else ''}{text}")


def _path(text: str) -> tuple[Step, ...]:
    """``.robot[2].pose.x`` taken apart; it ends where msgspec no longer names the key."""
    steps: list[Step] = []
    for name, index, rest in re.findall(r"\.(\w+)|\[(\d+)\]|(\[\.\.\.\])", text):
        if rest:
            break
        steps.append(name or int(index))
    return tuple(steps)
