"""Substitution arguments of launch files: ``$(find pkg)``, ``$(arg x)``, ``$(env V)``, ``$(eval …)`` and others."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from services.runtime.errors import BadInput, did_you_mean, unknown_name

COMMANDS = ("find", "arg", "env", "optenv", "anon", "eval", "dirname")

_SUBSTITUTION = re.compile(r"\$\(([^()$]*)\)")
_EVAL = re.compile(r"\s*\$\(\s*eval\s+(.*)\)\s*\Z", re.DOTALL)

KNOWN_VARIABLES = {
    "TURTLEBOT3_MODEL": "burger",
    "LDS_MODEL": "LDS-01",
    "TURTLEBOT_3D_SENSOR": "",
    "ROS_DISTRO": "noetic",
}
"""Variables that tutorials export first, with the values used if they are not set."""


@dataclass
class Substitution:
    """The values for substitutions in one launch file: its arguments, folder, packages and environment."""

    find: Callable[[str], Path]
    folder: Path
    arguments: Mapping[str, str]
    environment: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))
    anonymous: dict[str, str] = field(default_factory=dict)

    def resolve(self, text: str, where: str) -> str:
        """Return the text with all substitutions made; raises BadInput with the place ``where``."""
        if "$(" not in text:
            return text
        if found := _EVAL.match(text):
            return str(self._eval(found[1], where))
        made = _SUBSTITUTION.sub(lambda match: self._one(match[1], where), text)
        if re.search(r"\$\(\s*eval\b", made):
            raise BadInput(f"{where}: $(eval …) must be the whole value of its attribute: {text[:120]!r}")
        if (open_at := made.find("$(")) >= 0:
            raise BadInput(f"{where}: {made[open_at : open_at + 60]!r} is not closed: write $(command value)")
        return made

    def _one(self, text: str, where: str) -> str:
        command, *words = text.split(None, 1) or [""]
        rest = words[0].strip() if words else ""
        if command not in COMMANDS:
            raise unknown_name("substitution", command, COMMANDS, where)
        if command == "eval":
            return str(self._eval(rest, where))
        if command == "dirname":
            return str(self.folder)
        if not rest:
            raise BadInput(f"{where}: $({command}) needs a name, as in $({command} x)")
        if command != "optenv" and len(rest.split()) > 1:
            raise BadInput(f"{where}: $({command} {rest[:60]}) has more than one name")
        try:
            return {"find": self._find, "arg": self._arg, "env": self._env, "optenv": self._optenv, "anon": self._anon}[
                command
            ](rest)
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None

    def _find(self, name: str) -> str:
        return str(self.find(name))

    def _arg(self, name: str) -> str:
        if name not in self.arguments:
            known = ", ".join(sorted(self.arguments)) or "none"
            near = did_you_mean(name, self.arguments)
            raise BadInput(f"$(arg {name}): no <arg> of this name is declared before it{near} (declared: {known})")
        return self.arguments[name]

    def _env(self, name: str) -> str:
        if name in self.environment:
            return self.environment[name]
        if name in KNOWN_VARIABLES:
            return KNOWN_VARIABLES[name]
        raise BadInput(f"$(env {name}): the variable is not set: export {name}=… first")

    def _optenv(self, text: str) -> str:
        name, _, default = text.partition(" ")
        return self.environment.get(name, default.strip())

    def _anon(self, name: str) -> str:
        """Return a name that is the same each time, so that runs repeat; roslaunch uses host, process and time."""
        return self.anonymous.setdefault(name, f"{name}_{len(self.anonymous) + 1}")

    def _eval(self, expression: str, where: str) -> Any:
        """Return the value of a Python expression in which arguments are names."""
        if "__" in expression:
            raise BadInput(f"{where}: $(eval …) must not have '__' in it")
        names: dict[str, Any] = {
            **{name: value for name, value in vars(math).items() if not name.startswith("_")},
            "true": True,
            "false": False,
            "True": True,
            "False": False,
            "pi": math.pi,
            **{each.__name__: each for each in (abs, bool, dict, float, int, len, list, max, min, range, round, str)},
            **{name: python_value(value) for name, value in self.arguments.items()},
            "arg": lambda name: python_value(self._arg(name)),
            "env": self._env,
            "optenv": lambda name, default="": self.environment.get(name, default),
            "find": self._find,
            "anon": self._anon,
            "dirname": lambda: str(self.folder),
        }
        try:
            return eval(compile(expression.strip(), "<eval>", "eval"), {**names, "__builtins__": {}})
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
        except Exception as error:  # noqa: BLE001 whatever the expression raises
            raise BadInput(f"{where}: $(eval {expression[:120]}): {type(error).__name__}: {error}") from None


def python_value(text: str) -> Any:
    """Convert an argument's text as roslaunch does when it guesses the type: a number, a boolean, or text."""
    try:
        return float(text) if "." in text else int(text)
    except ValueError:
        pass
    return {"true": True, "false": False}.get(text.strip().lower(), text)


def truth(text: str, where: str, name: str) -> bool:
    """Return the value of a boolean attribute; raises BadInput."""
    try:
        return {"true": True, "1": True, "false": False, "0": False}[text.strip().lower()]
    except KeyError:
        raise BadInput(f"{where}: {name}={text[:80]!r} is neither true nor false (nor 1 or 0)") from None
