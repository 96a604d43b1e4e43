"""The roots of the tree of errors, which services/runtime/errors.py draws as a whole, and errors for wrong names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class EleaError(Exception):
    """Anything that this project raises on purpose."""


class BadInput(EleaError, ValueError):
    """Something from outside is wrong: the text says what, where, the limit and the likely cause."""


_MOST_LISTED = 100
"""Alternatives that an error lists."""
_LONG = 100
"""Characters of a name from which on it is compared with none."""
_WORK = 500_000
"""Pairs of characters: 1,200 names of 20, within 4 ms; of the worst kind, 35 ms."""


def unknown_name(kind: str, name: str, known: Iterable[str], where: str = "") -> BadInput:
    """The error for a name that does not exist, with the nearest right one and the alternatives."""
    names = sorted(known)
    prefix = f"{where}: " if where else ""
    listed = ", ".join(names[:_MOST_LISTED]) or "none"
    more = f" and {len(names) - _MOST_LISTED} more" if len(names) > _MOST_LISTED else ""
    return BadInput(f"{prefix}unknown {kind} {name[:255]!r}{did_you_mean(name, names)} (known: {listed}{more})")


def did_you_mean(name: str, known: Iterable[str], count: int = 1) -> str:
    """``; did you mean '/tb3_0/odom'?``, to end a text about a name that does not exist; empty if none is near."""
    near = [repr(each) for each in nearest(name, known, count)]
    listed = " or ".join(filter(None, (", ".join(near[:-1]), *near[-1:])))
    return f"; did you mean {listed}?" if near else ""


def missing_file(path: Path) -> BadInput:
    """The error for a file that does not exist, with the nearest name of its kind in its folder."""
    try:
        beside = [each.name for each in path.parent.iterdir() if each.suffix == path.suffix]
    except OSError:
        beside = []
    return BadInput(f"there is no file {path}{did_you_mean(path.name, beside)}")


def nearest(name: str, known: Iterable[str], count: int = 1, cutoff: float = 0.6) -> list[str]:
    """The names of ``known`` most similar to ``name``, the nearest first.

    Names from outside may be long and many, and comparing two costs the product of their lengths: a name of _LONG
    characters or more is compared with none, others with those nearest to its length within the budget _WORK.

    Args:
        name: The name that does not exist.
        known: The names that do.
        count: The most names to return.
        cutoff: The least similarity, from 0 to 1.
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
