"""Saved values under a schema that has changed: converted where nothing is lost, otherwise left out, never silently."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from messages.parameters import ParameterDescription, Value
from services.params.check import fit, shown, taken_apart
from services.params.schema import Schema
from services.runtime.errors import BadInput, nearest

_MOST_HINTS = 10
"""Values that are left out with a guess at their new name: each is compared with all names."""


@dataclass(frozen=True)
class Migration:
    """What saved values became: ``saved`` as they count now, the ``names`` of those that changed, and why."""

    saved: Mapping[str, Value]
    names: tuple[str, ...]
    texts: tuple[str, ...]
    waiting: tuple[str, ...] = ()


def migrate(saved: Mapping[str, Value], schema: Schema, owners: Mapping[str, Collection[str]]) -> Migration:
    """Fit saved values to the schema. ``owners`` are the nodes that had each parameter when it was last announced.

    An int becomes a float and a whole float an int. What is out of the new bounds is left out, not clamped: a bound is
    a value that nobody chose. A name that all its owners no longer announce is left out, and a new name for it is not
    guessed; one that waits for an owner to announce is kept as it is.
    """
    kept: dict[str, Value] = {}
    names: list[str] = []
    texts: list[str] = []
    waiting: list[str] = []
    for name, value in saved.items():
        described = schema.parameters.get(name)
        if described is None and not set(owners.get(name, ())) <= set(schema.announced):
            kept[name] = value
            waiting.append(f"{name} = {shown(value)} is kept for {', '.join(sorted(owners[name])[:10])}")
            continue
        try:
            new = _fitted(described, name, value, schema, len(texts) < _MOST_HINTS)
        except BadInput as error:
            names.append(name)
            texts.append(f"saved {name} = {shown(value)} was left out: {error}")
            continue
        kept[name] = new
        if repr(new) != repr(value):
            assert described is not None
            names.append(name)
            texts.append(f"saved {name} = {shown(value)} became {shown(new)}: its type is {described.type} now")
    return Migration(kept, tuple(names), tuple(texts), tuple(waiting))


def _fitted(described: ParameterDescription | None, name: str, value: Value, schema: Schema, hints: bool) -> Value:
    if described is None:
        near = nearest(name, schema.parameters) if hints else ""
        hint = f" (if it is called {near} now, set that)" if near else ""
        raise BadInput(f"no parameter has this name any more{hint}")
    if not described.live:
        raise BadInput("it is for the fleet file or the command line to say now")
    return fit(described, _whole(value) if taken_apart(described.type) == ("int", 0) else value).value


def _whole(value: Value) -> Value:
    return int(value) if isinstance(value, float) and value.is_integer() else value
