"""The topics and requests of the network, from a snapshot of its graph, and the one that a person means."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import NamedTuple

from messages.names import BadName, resolve
from services.runtime.errors import BadInput
from services.runtime.graph import Entity


class Ends(NamedTuple):
    """Who publishes and who subscribes to a topic, in the order of their nodes."""

    name: str
    publishers: tuple[Entity, ...] = ()
    subscribers: tuple[Entity, ...] = ()

    @property
    def types(self) -> tuple[str, ...]:
        """The ROS types that its ends have declared, those of the publishers first; one, when all is well."""
        return tuple(dict.fromkeys(each.record for each in (*self.publishers, *self.subscribers)))

    @property
    def latched(self) -> bool:
        """Whether a publisher keeps its last value for late joiners."""
        return any(each.detail == "LATCHED" for each in self.publishers)


def absolute(name: str) -> str:
    """The absolute name that a person means: written with or without its first slash; raises BadInput."""
    try:
        if name.startswith("~"):
            raise BadName(f"{name!r} is private to a node: write its whole name, as /tb3_0/waypoint/parameter_updates")
        return resolve(name, "/", "")
    except BadName as error:
        raise BadInput(str(error)) from None


def topics(graph: Iterable[Entity]) -> dict[str, Ends]:
    """Every topic of the graph by its name, in order."""
    found: dict[str, Ends] = {}
    for each in graph:
        ends = found.get(each.name, Ends(each.name))
        if each.kind == "pub":
            found[each.name] = ends._replace(publishers=(*ends.publishers, each))
        elif each.kind == "sub":
            found[each.name] = ends._replace(subscribers=(*ends.subscribers, each))
    return dict(sorted(found.items()))


def nearest(name: str, known: Iterable[str]) -> str:
    """``; did you mean '/tb3_0/odom'?`` or nothing, to end a message about a name that nobody has."""
    near = difflib.get_close_matches(name, known, 1)
    return f"; did you mean {near[0]!r}?" if near else ""


def absent(kind: str, name: str, known: Iterable[str], advice: str) -> BadInput:
    """The error for a topic, node or request that is not on the network, with what to do about it."""
    names = sorted(known)
    hint = nearest(name, names) or ("." if names else ": there are none at all; is a fleet up?")
    return BadInput(f"no {kind} {name} is on the network{hint} ({advice})")


def is_hidden(node: str) -> bool:
    """Whether a node is a passing tool's, by its name, as in ROS 2."""
    return node.rpartition("/")[2].startswith("_")
