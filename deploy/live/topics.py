"""The network's topics with their endpoints, and the search for the one that the user names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from deploy.interfaces import known_topic
from deploy.live.connect import spin
from deploy.live.output import write_note
from messages.names import BadName, resolve
from messages.topics import Quality
from services.runtime.errors import BadInput, did_you_mean
from services.runtime.graph import Entity, snapshot
from services.runtime.light_node import LightNode
from services.runtime.subscriber import UntypedSubscriber


class TopicEndpoints(NamedTuple):
    """The publishers and subscribers of a topic, sorted by node."""

    name: str
    publishers: tuple[Entity, ...] = ()
    subscribers: tuple[Entity, ...] = ()

    @property
    def types(self) -> tuple[str, ...]:
        """The ROS types that its endpoints declare, publishers' first; normally a single one."""
        return tuple(dict.fromkeys(each.record for each in (*self.publishers, *self.subscribers)))

    @property
    def latched(self) -> bool:
        """Whether a publisher keeps its last value for late subscribers."""
        return any(each.detail == "LATCHED" for each in self.publishers)


def absolute_name(name: str) -> str:
    """Return the absolute form of a name typed with or without its first slash; raises BadInput."""
    try:
        if name.startswith("~"):
            raise BadName(f"{name!r} is private to a node: write its full name, e.g. /tb3_0/waypoint/parameter_updates")
        return resolve(name, "/", "")
    except BadName as error:
        raise BadInput(str(error)) from None


def group_by_topic(graph: Iterable[Entity]) -> dict[str, TopicEndpoints]:
    """Group the graph's endpoints by topic, sorted by name."""
    found: dict[str, TopicEndpoints] = {}
    for each in graph:
        ends = found.get(each.name, TopicEndpoints(each.name))
        if each.kind == "pub":
            found[each.name] = ends._replace(publishers=(*ends.publishers, each))
        elif each.kind == "sub":
            found[each.name] = ends._replace(subscribers=(*ends.subscribers, each))
    return dict(sorted(found.items()))


def not_found(kind: str, name: str, known: Iterable[str], advice: str) -> BadInput:
    """Return the error for a topic, node or service that is not on the network, with advice."""
    names = sorted(known)
    hint = did_you_mean(name, names) or ("" if names else ": there are none at all; is a fleet running?")
    return BadInput(f"no {kind} {name} is on the network{hint} ({advice})")


def is_hidden(node: str) -> bool:
    """Return whether a node belongs to a short-lived tool, by its name, as in ROS 2."""
    return node.rpartition("/")[2].startswith("_")


_LISTEN_S = 1.0
"""Wall time [s] to wait for a sample of a publisher that is not in the graph."""


def wait_for_topic(
    live: LightNode, name: str, wait: bool, graph: Mapping[str, TopicEndpoints] | None = None
) -> TopicEndpoints:
    """Return the endpoints of a topic; with ``wait``, wait for an unknown one. Raises BadInput as ``find_topic``.

    ``graph`` are the topics of the network, if already known.
    """
    known = group_by_topic(snapshot(live.transport)) if graph is None else graph
    if not wait:
        ends = find_topic(live, name, known)
    else:
        ends = known.get(name, TopicEndpoints(name))
        if name not in known and (hint := did_you_mean(name, known)):
            write_note(f"no topic {name} is on the network{hint}")
    if not ends.publishers and (wait or ends.subscribers):
        write_note(f"{name} is not published yet: waiting, Ctrl-C to stop")
    return ends


def find_topic(live: LightNode, name: str, graph: Mapping[str, TopicEndpoints] | None = None) -> TopicEndpoints:
    """Return the endpoints of the topic ``name``; raises BadInput if it is not in the graph and has no sample for a
    second.
    """
    known = group_by_topic(snapshot(live.transport)) if graph is None else graph
    if name in known:
        return known[name]
    listener = UntypedSubscriber(live.transport, name)
    for _ in spin(live, listener.raw, _LISTEN_S):
        if any(True for _ in listener.drain()):
            listener.close()
            return TopicEndpoints(name)
    raise not_found("topic", name, known, "./elea topic list shows them all; --wait waits for it")


def is_latched(ends: TopicEndpoints) -> bool:
    """Return whether late subscribers get the last value: by the publishers, else by the table of topics."""
    topic = known_topic(ends.name)
    return ends.latched or (not ends.publishers and topic is not None and topic.quality is Quality.LATCHED)


def topic_type(ends: TopicEndpoints) -> str:
    """Return the ROS type of a topic, for samples that do not state one; empty if unknown."""
    topic = known_topic(ends.name)
    return next((each for each in ends.types if each != "-"), "" if topic is None else topic.record.ROS_TYPE)
