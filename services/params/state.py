"""One set as it stands: its schema, the layers of values over it, and which of them counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from messages.parameters import Origin, Parameter, ParameterValues, Value
from services.params.schema import Schema

MOST_NOTES = 20
"""Of what was clamped, migrated or left out, as many are told."""
EVERYTHING = 2**32 - 1
"""The level of what is told for the first time."""


@dataclass(frozen=True)
class State:
    """A set at one revision. ``saved`` may hold values of parameters that nobody has announced yet."""

    name: str
    schema: Schema = field(default_factory=Schema)
    saved: Mapping[str, Value] = field(default_factory=dict)
    run: Mapping[str, Value] = field(default_factory=dict)
    revision: int = 0

    def parameter(self, name: str) -> Parameter:
        """The value of a parameter that counts: the latest of default, fleet, saved, command line and run."""
        layers: tuple[tuple[Origin, Mapping[str, Value]], ...] = (
            ("run", self.run),
            ("command line", self.schema.command_line),
            ("saved", self.saved),
            ("fleet", self.schema.fleet),
        )
        for origin, layer in layers:
            if name in layer:
                return Parameter(name=name, value=layer[name], origin=origin)
        described = self.schema.parameters.get(name)
        return Parameter(name=name, value=None if described is None else described.default)

    def values(self) -> dict[str, Parameter]:
        """All effective values; of a set that nobody has announced, the saved ones."""
        return {name: self.parameter(name) for name in self.schema.parameters or self.saved}

    def dormant(self) -> tuple[str, ...]:
        """Names with a saved value that nobody has announced."""
        return tuple(name for name in self.saved if name not in self.schema.parameters)

    def record(self, level: int = EVERYTHING, notes: Iterable[str] = ()) -> ParameterValues:
        """As it is told, with what listeners should know."""
        return ParameterValues(
            set=self.name,
            revision=self.revision,
            level=level,
            values=tuple(self.values().values()),
            note=_joined(tuple(notes)),
        )


def _joined(notes: tuple[str, ...]) -> str:
    more = (f"{len(notes) - MOST_NOTES} more notes",) if len(notes) > MOST_NOTES else ()
    return "; ".join((*notes[:MOST_NOTES], *more))


def level_of(before: State, after: State) -> int:
    """The union of the levels of what has changed; what is new counts as changed."""
    old, level = before.values(), 0
    for name, now in after.values().items():
        if name not in old or not same(old[name].value, now.value):
            described = after.schema.parameters.get(name)
            level |= described.level if described is not None else 0
    return level


def same(one: Value, other: Value) -> bool:
    """Equality of values and their types: 1, 1.0 and true are three."""
    return repr(one) == repr(other)
