"""What the description of a parameter allows, in words, and what must hold between the parameters of a set."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, Protocol

from messages.parameters import ParameterDescription


class Related(Protocol):
    """A parameter with what must hold between it and others, as its description says."""

    @property
    def name(self) -> str: ...
    @property
    def at_most(self) -> str: ...
    @property
    def excludes(self) -> tuple[str, ...]: ...


def within(description: ParameterDescription) -> str:
    """The bounds in words, with the unit: ``0 to 5 m/s``, ``above 0``, or nothing."""
    low, high = description.low, description.high
    if low is None and high is None:
        return ""
    if low is not None and high is not None and not (description.above or description.below):
        text = f"{low:.12g} to {high:.12g}"
    else:
        least = "" if low is None else f"{'above' if description.above else 'at least'} {low:.12g}"
        most = "" if high is None else f"{'below' if description.below else 'at most'} {high:.12g}"
        text = " and ".join(each for each in (least, most) if each)
    return f"{text} {description.unit}".strip()


def long(description: ParameterDescription) -> str:
    """How many items a list may have, and how many characters a text: ``6 items``, ``at most 255 characters``."""
    depth = description.type.count("[]")
    parts = []
    for level, (least, most) in enumerate(zip(description.shortest, description.longest, strict=True)):
        what = "characters" if level == depth else "items"
        whose = "" if level == 0 else " each"
        low, high = f"at least {least}" if least else "", f"at most {most}" if most else ""
        bounds = str(least) if least == most else " and ".join(part for part in (low, high) if part)
        if least or most:
            parts.append(f"{bounds} {what}{whose}")
    return ", ".join(parts)


def beside(description: Related) -> str:
    """What must hold between it and others, in words: ``at most fastest``, ``not with a, b``, or nothing."""
    most = f"at most {description.at_most}" if description.at_most else ""
    off = f"not with {', '.join(description.excludes)}" if description.excludes else ""
    return ", ".join(each for each in (most, off) if each)


def contradictions(
    related: Iterable[Related], values: Mapping[str, Any], concerned: Collection[str] | None = None
) -> Iterator[str]:
    """A sentence for each pair of ``values`` that contradict each other, of those with one of ``concerned``, if given.

    A value of null is under no bound and is none; what is null or false is off.
    """
    for each in related:
        value = values.get(each.name)
        if value is None:
            continue
        most = values.get(each.at_most)
        if most is not None and value > most and _one_of(concerned, each.name, each.at_most):
            yield f"{each.name} = {value} is above {each.at_most} = {most}, which it may not exceed"
        for other in each.excludes if value is not False else ():
            on = values.get(other)
            if on is not None and on is not False and _one_of(concerned, each.name, other):
                yield f"{each.name} = {value} and {other} = {on} exclude each other: one of them must be off"


def _one_of(concerned: Collection[str] | None, *names: str) -> bool:
    return concerned is None or any(name in concerned for name in names)
