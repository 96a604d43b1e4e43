"""Exercises: folders with a fleet, a world, a controller to complete and a test that grades it."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

from messages.errors import BadInput, unknown_name
from messages.names import validate
from services.runtime.process import ROOT

EXERCISES = ("obstacle_avoidance",)
"""The exercises that come with Elea."""

TEMPLATE = ".template"
"""Suffix of Python files that are copied into an exercise and are not code of this project."""

_HERE = Path(__file__).resolve().parent


def make_exercise(name: str, kind: str, parent: Path) -> Path:
    """Create the folder of an exercise.

    Args:
        name: Name of the folder and its fleet: a letter first, then letters, digits and underscores.
        kind: One of ``EXERCISES``.
        parent: The folder in which to create it.

    Returns:
        The new folder.

    Raises:
        BadInput: The name is not valid, or the folder exists or cannot be written.
    """
    if kind not in EXERCISES:
        raise unknown_name("exercise", kind, EXERCISES)
    validate(name)
    if "/" in name:
        raise BadInput(f"{name!r} is a path: give a name, and with --in the folder to make it in")
    target = parent / name
    try:
        target.mkdir()
        for source in sorted((_HERE / kind).iterdir()):
            if source.is_file():
                text = source.read_text().replace("NAME", name).replace("ELEA", shlex.quote(str(ROOT / "elea")))
                (target / source.name.removesuffix(TEMPLATE)).write_text(text)
    except FileExistsError:
        raise BadInput(f"{target} exists already: choose another name, or remove it") from None
    except OSError as error:
        shutil.rmtree(target, ignore_errors=True)
        raise BadInput(f"{target} cannot be made: {error.strerror}") from None
    return target
