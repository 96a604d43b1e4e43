"""Finds the bases that can be driven, in the graph of nodes and topics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from messages.names import BadName, absolute_namespace
from messages.topics import CMD_VEL
from services.runtime.errors import BadInput, did_you_mean
from services.runtime.graph import Entity

_SUFFIX = f"/{CMD_VEL.name}"


class BaseInfo(NamedTuple):
    """Namespace of a base, and topic and ROS type of its commands."""

    namespace: str
    topic: str
    type_name: str


def find_bases(entities: Iterable[Entity]) -> dict[str, BaseInfo]:
    """Return the bases by namespace: nodes that subscribe to ``cmd_vel`` and publish there, unlike observers."""
    known = tuple(entities)
    found = {}
    for each in known:
        if each.kind != "sub" or not each.name.endswith(_SUFFIX):
            continue
        above = each.name.removesuffix(_SUFFIX)
        if any(e.kind == "pub" and e.node == each.node and e.name.rpartition("/")[0] == above for e in known):
            found[above or "/"] = BaseInfo(above or "/", each.name, each.record)
    return dict(sorted(found.items()))


def choose_base(asked: str, found: Mapping[str, BaseInfo], where: str) -> BaseInfo:
    """Return the base to drive; raises BadInput if there is none or the choice is ambiguous.

    Args:
        bases: The bases by namespace.
        asked: Namespace of the base; the only base if empty.
        where: Name of the network, for errors.
    """
    if not found:
        raise BadInput(f"no robot takes commands at {where}: is a fleet up that has one? (./elea ps lists them)")
    listed = ", ".join(found)
    if not asked:
        if len(found) > 1:
            raise BadInput(f"there are several robots, say which one: {listed}")
        return next(iter(found.values()))
    try:
        namespace = absolute_namespace(asked.rstrip("/"))
    except BadName as error:
        raise BadInput(str(error)) from None
    if namespace not in found:
        hint = did_you_mean(namespace, found)
        raise BadInput(f"no robot takes commands on {namespace.rstrip('/')}{_SUFFIX}{hint} (known: {listed})")
    return found[namespace]
