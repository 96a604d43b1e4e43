"""The values that the parameters of a run have, as its parameter service tells them, against those of its fleet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from deploy.fleet import Fleet
from deploy.report.record import Effective
from messages.parameters import Parameter, ParameterValues

Told = Callable[[], Mapping[str, ParameterValues]]
"""The values of each set as far as they were told; it does not block."""

Own = Mapping[str, Mapping[str, Any]]
"""What the fleet itself gives the live parameters of each set."""


class Saved:
    """Says once of each set which saved values win over the fleet's."""

    def __init__(self, told: Told, own: Own) -> None:
        self._told, self._own = told, own
        self._said: set[str] = set()

    def news(self) -> Iterator[str]:
        """One line for each set that was told of for the first time and has such values."""
        for name, values in self._told().items():
            if name in self._said:
                continue
            self._said.add(name)
            own = self._own.get(name, {})
            if parts := [
                _difference(each, own) for each in values.values if each.origin == "saved" and _differs(each, own)
            ]:
                yield f"saved parameters win over the fleet's: {name} {', '.join(parts)}; --no-saved leaves them out"


def effective(told: Mapping[str, ParameterValues], own: Own) -> dict[str, dict[str, Effective]]:
    """The live parameters that are not at their defaults, by set and name, in the order of their names."""
    found = {
        name: {
            each.name: Effective(value=each.value, origin=each.origin)
            for each in values.values
            if each.origin != "default" and each.name in own.get(name, {})
        }
        for name, values in sorted(told.items())
    }
    return {name: parameters for name, parameters in found.items() if parameters}


def note(told: Mapping[str, ParameterValues], own: Own, fleet: Fleet) -> tuple[str, ...]:
    """The values that make a run another than its fleet file says, as one note; none when there are none."""
    scheduled = {(change.set, name) for change in fleet.change for name in change.values}
    parts = [
        f"{name} {_difference(each, own[name])}"
        for name, values in sorted(told.items())
        for each in values.values
        if each.origin in ("saved", "command line", "run")
        and (name, each.name) not in scheduled
        and _differs(each, own.get(name, {}))
    ]
    if not parts:
        return ()
    return (
        f"Parameters were not the fleet's: {', '.join(parts)}. The run repeats with the same values alone; "
        "./elea up --no-saved leaves saved ones out.",
    )


def _differs(each: Parameter, own: Mapping[str, Any]) -> bool:
    return each.name in own and own[each.name] != each.value


def _difference(each: Parameter, own: Mapping[str, Any]) -> str:
    return f"{each.name} = {each.value} ({each.origin}; the fleet's is {own[each.name]})"
