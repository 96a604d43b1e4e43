"""The checks that services have stated themselves, as the report has them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from deploy.report.record import Check
from messages.elea import Check as Stated


def own_checks(told: Mapping[str, Iterable[Stated]]) -> tuple[Check, ...]:
    """One check for each bound, node after node in the order of their names; named ``NODE.name``."""
    return tuple(
        made for node in sorted(told) for stated in told[node] for made in _made(f"{node}.{stated.name}", stated)
    )


def is_own(check: Check) -> bool:
    """Whether a service has stated it: its name begins with a node's."""
    return check.name.startswith("/")


def unheard(nodes: Iterable[str]) -> tuple[str, ...]:
    """The note on nodes whose checks do not count."""
    listed = ", ".join(sorted(nodes))
    return (f"checks of nodes that are no processes of the fleet are not counted: {listed}",) if listed else ()


def _made(name: str, stated: Stated) -> Iterator[Check]:
    value, reason = stated.value, stated.reason
    if stated.min is not None:
        ok = value is not None and value >= stated.min
        yield Check(name=name, value=value, kind="min", bound=stated.min, ok=ok, reason=reason)
    if stated.max is not None:
        ok = value is not None and value <= stated.max
        yield Check(name=name, value=value, kind="max", bound=stated.max, ok=ok, reason=reason)
