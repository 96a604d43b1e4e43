"""Shortened variants of the project's fleets: the lab with short paths, also reordered; fleets without a logger."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from deploy.fleet_file import find_fleet

GOALS = [[0.5, 0.0], [0.0, 0.0]]
"""Goals out and back, from each robot's start [m]; 10 s of simulation time."""

SQUARE = 'services = [{ kind = "square", parameters = { side = 0.2, angular_speed = 1.5 } }]'
"""The Pioneer's square: 17 s of simulation time."""

ARM = 'services = [{ kind = "reference" }, { kind = "arm" }]'

_DRIVERS = """
[[robot.services]]
kind = "waypoint"
from_start = ["goals"]
parameters = {{ goals = {goals} }}
"""
_LOGGER = """
[[service]]
kind = "logger"
"""


def without_logger(file: Path) -> str:
    """Return the text of a fleet file without its logger, which takes a third of a small fleet's processor time."""
    text, found = re.subn(r'\[\[service\]\]\nkind = "logger"\nparameters = .*\n', "", file.read_text())
    assert found == 1
    return text


def short_lab(path: Path) -> Path:
    """Write the lab with GOALS, in its file's layout, and an arm exercise that ends with them; return the path."""
    text = find_fleet("lab").read_text()
    own = 'services = [{ kind = "square" }]'
    for old, new in ((own, SQUARE), ("at = 4\n", "at = 2.5\n"), ("at = 20.2 ", "at = 8 ")):
        assert old in text
        text = text.replace(old, new)
    before, _, rest = text.partition("goals = [\n")
    path.write_text(f"{before}goals = {GOALS}{rest.partition(chr(10) + ']')[2]}")
    return path


def reordered_lab(path: Path) -> Path:
    """Write the short lab in reverse: logger first, last robot first, controllers below their robots; return the
    path.
    """
    lab = tomllib.loads(short_lab(path).read_text())
    robots = [_robot(each) for each in reversed(lab["robot"])]
    run = "".join(f"{key} = {value!r}\n" for key, value in lab["run"].items())
    changes = "".join(map(_change, reversed(lab["change"])))
    path.write_text(f'name = "lab"\n{_LOGGER}{changes}{"".join(robots)}\n[run]\n{run}')
    return path


def _change(change: dict[str, Any]) -> str:
    values = ", ".join(f"{name} = {json.dumps(value)}" for name, value in change["values"].items())
    return f'\n[[change]]\nvalues = {{ {values} }}\nset = "{change["set"]}"\nat = {change["at"]}\n'


def _robot(robot: dict[str, object]) -> str:
    tables = "".join(
        f"{name} = {{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in table.items())} }}\n"
        for name, table in robot.items()
        if isinstance(table, dict)
    )
    head = f'\n[[robot]]\nname = "{robot["name"]}"\nmodel = "{robot["model"]}"\n{tables}'
    own = {"p3dx": f"{SQUARE}\n", "arm": f"{ARM}\n"}
    return head + own.get(str(robot["model"]), _DRIVERS.format(goals=GOALS))
