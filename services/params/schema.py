"""The schema of a parameter set, merged from its nodes' announcements, and the layers of its values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import msgspec

from messages.names import BadName
from messages.names import key as checked_key
from messages.parameters import (
    Announcement,
    Assignment,
    Origin,
    Parameter,
    ParameterDescription,
    ParameterSchema,
    ParameterValues,
    Value,
)
from services.params.value_check import fit, format_value, parse_type
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.schema import ALL_LEVELS

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z0-9_]+)*")


class ParameterConflict(BadInput):
    """Two nodes describe a parameter differently; ``other_node`` announced it first."""

    def __init__(self, other: str, text: str) -> None:
        super().__init__(text)
        self.other_node = other


@dataclass(frozen=True)
class Schema:
    """The merged announcements of a set, in the order of their nodes' names."""

    announced: Mapping[str, Announcement] = field(default_factory=dict)
    parameters: Mapping[str, ParameterDescription] = field(default_factory=dict)
    fleet: Mapping[str, Value] = field(default_factory=dict)
    command_line: Mapping[str, Value] = field(default_factory=dict)

    def with_node(self, announcement: Announcement) -> Schema:
        """Return the schema with a node's new announcement; raises ParameterConflict."""
        others = {node: each for node, each in self.announced.items() if node != announcement.node}
        for other in others.values():
            _check_agreement(announcement, other)
        return merge_announcements((*others.values(), announcement))

    def without_node(self, node: str) -> Schema:
        """Return the schema without a node's announcement."""
        return merge_announcements(each for name, each in self.announced.items() if name != node)

    def to_message(self, name: str) -> ParameterSchema:
        """Return the message that describes the set ``name``."""
        return ParameterSchema(set=name, nodes=tuple(self.announced), parameters=tuple(self.parameters.values()))

    def description(self, name: str, where: str) -> ParameterDescription:
        """Return the description of a parameter; raises BadInput with the nearest name."""
        if name not in self.parameters:
            raise unknown_name("parameter", name, self.parameters, where)
        return self.parameters[name]


def merge_announcements(announcements: Iterable[Announcement]) -> Schema:
    """Merge announcements that agree into a schema."""
    ordered = sorted(announcements, key=lambda each: each.node)
    return Schema(
        {each.node: each for each in ordered},
        {one.name: one for each in ordered for one in each.parameters},
        {one.name: one.value for each in ordered for one in each.fleet},
        {one.name: one.value for each in ordered for one in each.command_line},
    )


def validate_announcement(announcement: Announcement) -> Announcement:
    """Return the announcement with values converted to their parameters' types; raises BadInput if inconsistent."""
    where = f"announcement of {announcement.node or 'nobody'}"
    for what, name in (("set", announcement.set), ("node", announcement.node)):
        try:
            checked_key(name)
        except BadName as error:
            raise BadInput(f"{where}: its {what} needs an absolute name: {error}") from None
    described: dict[str, ParameterDescription] = {}
    for each in announcement.parameters:
        if each.name in described:
            raise BadInput(f"{where}: parameter {each.name} is described twice")
        described[each.name] = _validate_description(each, where)
    for each in described.values():
        _check_relations(each, described, where)
    return msgspec.structs.replace(
        announcement,
        parameters=tuple(described.values()),
        fleet=_fitted(announcement.fleet, described, f"{where}: fleet file"),
        command_line=_fitted(announcement.command_line, described, f"{where}: command line"),
    )


def _validate_description(described: ParameterDescription, where: str) -> ParameterDescription:
    name = described.name
    if not _NAME.fullmatch(name) or len(name) > 255:
        raise BadInput(
            f"{where}: {name[:80]!r} is not a valid parameter name: letters, digits and '_', parts joined by '.'"
        )
    parts = parse_type(described.type)
    if parts is None:
        raise BadInput(
            f"{where}: {name} has the type {described.type[:80]!r}; known are bool, int, float, str, and [] behind them"
        )
    bounded = described.low is not None or described.high is not None
    if bounded and parts[0] not in ("int", "float"):
        raise BadInput(f"{where}: {name} has bounds, but {described.type} does not have any")
    if (
        described.low is not None
        and described.high is not None
        and _excludes_all(described, described.low, described.high)
    ):
        raise BadInput(f"{where}: the bounds of {name} exclude everything: {described.low} to {described.high}")
    lengths = (*described.shortest, *described.longest)
    if len(described.shortest) != len(described.longest) or len(described.shortest) > parts[1] + (parts[0] == "str"):
        raise BadInput(f"{where}: {name} has bounds for {len(lengths)} lengths, which {described.type} does not have")
    if any(0 < most < least for least, most in zip(described.shortest, described.longest, strict=True)):
        raise BadInput(f"{where}: the lengths of {name} exclude everything")
    if described.default is None:
        return described
    try:
        return msgspec.structs.replace(described, default=fit(described, described.default).value)
    except BadInput as error:
        raise BadInput(f"{where}: the default does not fit: {error}") from None


def _excludes_all(described: ParameterDescription, low: float, high: float) -> bool:
    """Return whether the bounds allow no value, for an int no whole number."""
    if described.type.startswith("int"):
        first = math.floor(low) + 1 if described.above else math.ceil(low)
        last = math.ceil(high) - 1 if described.below else math.floor(high)
        return first > last
    return low > high or (low == high and (described.above or described.below))


def _check_relations(one: ParameterDescription, described: Mapping[str, ParameterDescription], where: str) -> None:
    for other in (one.at_most, *one.excludes):
        if other and other not in described:
            raise unknown_name("parameter", other, described, f"{where}: {one.name} is bound to another")
    if one.at_most and {one.type, described[one.at_most].type} - {"int", "float"}:
        raise BadInput(f"{where}: {one.name} cannot be at most {one.at_most}: only numbers have an order")


def _fitted(
    given: Iterable[Assignment], described: Mapping[str, ParameterDescription], where: str
) -> tuple[Assignment, ...]:
    fitted = []
    for each in given:
        if each.name not in described:
            raise unknown_name("parameter", each.name, described, where)
        try:
            fitted.append(Assignment(name=each.name, value=fit(described[each.name], each.value).value))
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
    return tuple(fitted)


def _check_agreement(new: Announcement, old: Announcement) -> None:
    known = {each.name: each for each in old.parameters}
    for each in new.parameters:
        other = known.get(each.name)
        if other is not None and other != each:
            fields = [f for f in each.__struct_fields__ if getattr(each, f) != getattr(other, f)]
            differs = ", ".join(
                f"{f} {format_value(getattr(each, f))} and {format_value(getattr(other, f))}" for f in fields
            )
            raise ParameterConflict(
                old.node,
                f"{new.node} and {old.node} describe {new.set} {each.name} differently: {differs}. "
                "Nodes that share a set must agree on it",
            )
    for what, mine, theirs in (
        ("fleet file gives", new.fleet, old.fleet),
        ("command lines give", new.command_line, old.command_line),
    ):
        given = {each.name: each.value for each in theirs}
        for one in mine:
            if one.name in given and given[one.name] != one.value:
                raise ParameterConflict(
                    old.node,
                    f"the {what} {new.set} {one.name} as {format_value(one.value)} for {new.node} and as "
                    f"{format_value(given[one.name])} for {old.node}, which share this set: give one value",
                )


MAX_NOTES = 20
"""Maximum notes about clamped, converted and dropped values in one message."""


@dataclass(frozen=True)
class SetState:
    """A set at one revision. ``saved`` may contain values of parameters that no running node has."""

    name: str
    schema: Schema = field(default_factory=Schema)
    saved: Mapping[str, Value] = field(default_factory=dict)
    run: Mapping[str, Value] = field(default_factory=dict)
    revision: int = 0

    def parameter(self, name: str) -> Parameter:
        """Return the effective value of a parameter; precedence: run, command line, saved, fleet, default."""
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

    def effective_values(self) -> dict[str, Parameter]:
        """Return all effective values; for a set that no node has announced, the saved ones."""
        return {name: self.parameter(name) for name in self.schema.parameters or self.saved}

    def unannounced(self) -> tuple[str, ...]:
        """Return the names of saved values whose parameter no running node has."""
        return tuple(name for name in self.saved if name not in self.schema.parameters)

    def to_message(self, level: int = ALL_LEVELS, notes: Iterable[str] = ()) -> ParameterValues:
        """Return the message with the effective values, and notes for subscribers."""
        return ParameterValues(
            set=self.name,
            revision=self.revision,
            level=level,
            values=tuple(self.effective_values().values()),
            note=_join_notes(tuple(notes)),
        )


def _join_notes(notes: tuple[str, ...]) -> str:
    more = (f"{len(notes) - MAX_NOTES} more notes",) if len(notes) > MAX_NOTES else ()
    return "; ".join((*notes[:MAX_NOTES], *more))


def changed_levels(before: SetState, after: SetState) -> int:
    """Return the bitwise OR of the levels of the parameters that changed or are new."""
    old, level = before.effective_values(), 0
    for name, now in after.effective_values().items():
        if name not in old or not same_value(old[name].value, now.value):
            described = after.schema.parameters.get(name)
            level |= described.level if described is not None else 0
    return level


def same_value(one: Value, other: Value) -> bool:
    """Return whether values and their types are equal: 1, 1.0 and true all differ."""
    return repr(one) == repr(other)
