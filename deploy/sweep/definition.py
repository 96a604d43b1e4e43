"""Defines a sweep: seeds and assignments with several values, and the runs of all their combinations."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Sequence

import msgspec

from services.runtime.errors import BadInput

SEED = "seed"
"""The name of the axis of seeds."""
MAX_RUNS = 10_000
"""Maximum number of runs of a sweep."""
_SEED_RANGE = re.compile(r"(\d{1,19})(?:\.\.(\d{1,19}))?\Z")
_OPENING, _CLOSING = "[{(", "]})"


class Axis(msgspec.Struct, frozen=True, kw_only=True):
    """One varied quantity: ``key`` as before the ``=`` of ``up --set``, and the values as written."""

    key: str
    values: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its column name: the key, with a dot between a set and its parameter."""
        return self.key.replace(" ", ".")

    def number(self, value: str) -> float | None:
        """Return a value as a number; None if it is not numeric."""
        try:
            return float(value)
        except ValueError:
            return None

    @property
    def is_numeric(self) -> bool:
        """Whether all its values are numbers."""
        return all(self.number(each) is not None for each in self.values)


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """One run: its number, and the value of each axis."""

    number: int
    values: dict[str, str]

    def folder_name(self) -> str:
        """Return the name of its folder in that of the sweep."""
        return f"{self.number:04d}"


class Definition(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A sweep: the fleet as given on the command line, a digest of its file, the axes, and further options of ``up``.

    ``options`` are arguments of ``up`` for all runs.
    """

    fleet: str
    digest: str
    axes: tuple[Axis, ...]
    options: tuple[str, ...] = ()

    @property
    def varied(self) -> tuple[Axis, ...]:
        """The axes with more than one value."""
        return tuple(each for each in self.axes if len(each.values) > 1)

    @property
    def runs(self) -> tuple[Run, ...]:
        """All combinations; the last axis changes fastest."""
        names = [each.name for each in self.axes]
        each_values = itertools.product(*(each.values for each in self.axes))
        return tuple(
            Run(number=number, values=dict(zip(names, values, strict=True)))
            for number, values in enumerate(each_values)
        )

    def arguments(self, run: Run) -> list[str]:
        """Return the arguments of ``up`` for one run, without its folder and network."""
        arguments = [self.fleet, *self.options]
        for axis in self.axes:
            value = run.values[axis.name]
            arguments += ["--seed", value] if axis.name == SEED else ["--set", f"{axis.key}={value}"]
        return arguments

    def overrides(self, run: Run) -> tuple[str, ...]:
        """Return the assignments of one run, in the form of ``up --set``."""
        return tuple(f"{axis.key}={run.values[axis.name]}" for axis in self.axes if axis.name != SEED)


def read_axes(seeds: str, assignments: Sequence[str]) -> tuple[Axis, ...]:
    """Parse the axes of a command line: the assignments in order, then the seeds.

    Args:
        seeds: E.g. ``0..31`` or ``1,2,7..9``; the fleet's own seed if empty.
        assignments: Each ``KEY=VALUE[,VALUE…]`` or ``SET NAME=VALUE[,VALUE…]``.

    Raises:
        BadInput: One of them is malformed or given twice, or there are more than MAX_RUNS combinations.
    """
    axes: list[Axis] = []
    for text in assignments:
        key, equals, values = text.partition("=")
        key = " ".join(key.split())
        if not equals or not key:
            raise BadInput(
                f"--set {text!r} is not an assignment: write KEY=VALUE,VALUE, e.g. waypoint.max_linear=0.1,0.2, or "
                "'SET NAME=VALUE,VALUE', e.g. '/tb3_0/waypoint max_linear=0.1,0.2'"
            )
        if any(each.key == key for each in axes):
            raise BadInput(f"--set gives {key} twice: name all its values in one")
        axes.append(Axis(key=key, values=_distinct(tuple(split_values(values)), f"--set {text}")))
    if seeds:
        axes.append(Axis(key=SEED, values=_distinct(tuple(_seeds(seeds)), f"--seeds {seeds}")))
    count = 1
    for each in axes:
        count *= len(each.values)
    if count > MAX_RUNS:
        raise BadInput(f"{count} combinations: a sweep has at most {MAX_RUNS} runs, so vary fewer values")
    return tuple(axes)


def split_values(text: str) -> Iterator[str]:
    """Split a text at the commas outside brackets and quotes."""
    depth, quote, begin = 0, "", 0
    for at, each in enumerate(text):
        if quote:
            quote = "" if each == quote else quote
        elif each in "\"'":
            quote = each
        elif each in _OPENING or each in _CLOSING:
            depth += 1 if each in _OPENING else -1
        elif each == "," and depth <= 0:
            yield text[begin:at].strip()
            begin = at + 1
    yield text[begin:].strip()


def _seeds(text: str) -> Iterator[str]:
    for part in text.split(","):
        found = _SEED_RANGE.match(part.strip())
        if found is None:
            raise BadInput(f"--seeds {text}: {part.strip()!r} is neither a seed nor a range: write 0..31, or 1,2,7..9")
        first, last = int(found[1]), int(found[2] or found[1])
        if last < first:
            raise BadInput(f"--seeds {text}: the range {part.strip()} ends before it begins")
        if last - first >= MAX_RUNS:
            raise BadInput(f"--seeds {text}: the range {part.strip()} has more than {MAX_RUNS} seeds")
        yield from map(str, range(first, last + 1))


def _distinct(values: tuple[str, ...], where: str) -> tuple[str, ...]:
    if "" in values:
        raise BadInput(f"{where}: a value is empty")
    twice = [each for each, count in Counter(values).items() if count > 1]
    if twice:
        raise BadInput(f"{where}: {twice[0]} is given twice")
    return values
