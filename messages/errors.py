"""The base exceptions (services/runtime/errors.py shows the whole tree), and errors for unknown names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from pathlib import Path


class EleaError(Exception):
    """Base class of all exceptions that this project raises."""


class BadInput(EleaError, ValueError):
    """External input is wrong: the text says what, where, the limit and the likely cause."""


_MOST_LISTED = 100
"""Maximum number of alternatives that an error lists."""
_LONG = 100
"""Length from which on a name is not compared with others."""
_WORK = 500_000
"""Budget in pairs of characters: 1,200 names of 20, within 4 ms; in the worst case, 35 ms."""


def unknown_name(kind: str, name: str, known: Iterable[str], where: str = "") -> BadInput:
    """Return the error for an unknown name, with the nearest known name and the alternatives."""
    names = sorted(known)
    prefix = f"{where}: " if where else ""
    listed = list_names(names, _MOST_LISTED) or "none"
    return BadInput(f"{prefix}unknown {kind} {name[:255]!r}{did_you_mean(name, names)} (known: {listed})")


def list_names(names: Sequence[str], most: int) -> str:
    """Return the first ``most`` names, separated by commas, and how many more there are."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def did_you_mean(name: str, known: Iterable[str], count: int = 1) -> str:
    """Return ``; did you mean '/tb3_0/odom'?``, to append to an error on an unknown name; empty if none is similar."""
    near = [repr(each) for each in nearest(name, known, count)]
    listed = " or ".join(filter(None, (", ".join(near[:-1]), *near[-1:])))
    return f"; did you mean {listed}?" if near else ""


def missing_file(path: Path) -> BadInput:
    """Return the error for a missing file, with the most similar name of the same suffix in its folder."""
    try:
        beside = [each.name for each in path.parent.iterdir() if each.suffix == path.suffix]
    except OSError:
        beside = []
    return BadInput(f"there is no file {path}{did_you_mean(path.name, beside)}")


def nearest(name: str, known: Iterable[str], count: int = 1, cutoff: float = 0.6) -> list[str]:
    """Return the names in ``known`` that are most similar to ``name``, the nearest first.

    Names from outside may be long and many, and comparing two costs the product of their lengths: a name of _LONG
    characters or more is not compared at all, others with those of the nearest length within the budget _WORK.

    Args:
        name: The unknown name.
        known: The names that exist.
        count: Maximum number of names to return.
        cutoff: Minimum similarity, from 0 to 1.
    """
    if len(name) >= _LONG:
        return []
    work, candidates = 0, []
    for each in sorted(known, key=lambda each: abs(len(each) - len(name))):
        work += len(name) * len(each)
        if work > _WORK or len(each) >= _LONG:
            break
        candidates.append(each)
    return difflib.get_close_matches(name, candidates, count, cutoff)
