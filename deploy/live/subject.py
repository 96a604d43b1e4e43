"""The topic that a person wants to hear: found in the graph, heard from a foreign sender, or waited for."""

from __future__ import annotations

from collections.abc import Mapping

from deploy.live.ends import Ends, absent, nearest, topics
from deploy.live.known import topic_of
from deploy.live.listener import Listener
from deploy.live.output import note
from deploy.live.session import Session
from messages.topics import Quality
from services.runtime.graph import snapshot

_FOREIGN_S = 1.0
"""Wall time in which a sender that is not in the graph may make itself heard."""


def await_subject(live: Session, name: str, wait: bool, graph: Mapping[str, Ends] | None = None) -> Ends:
    """The topic that is to be heard; with ``wait`` also one that nobody knows. Raises BadInput as ``find_subject``.

    ``graph`` are the topics of the network, where they are known already.
    """
    known = topics(snapshot(live.transport)) if graph is None else graph
    if not wait:
        ends = find_subject(live, name, known)
    else:
        ends = known.get(name, Ends(name))
        if name not in known and (hint := nearest(name, known)):
            note(f"no topic {name} is on the network{hint}")
    if not ends.publishers and (wait or ends.subscribers):
        note(f"nobody publishes {name} yet: waiting, Ctrl-C ends it")
    return ends


def find_subject(live: Session, name: str, graph: Mapping[str, Ends] | None = None) -> Ends:
    """The topic ``name``; raises BadInput when it is neither in the graph nor heard for a second."""
    known = topics(snapshot(live.transport)) if graph is None else graph
    if name in known:
        return known[name]
    listener = Listener(live.transport, name)
    for _ in live.turns(listener.inlet, _FOREIGN_S):
        if any(True for _ in listener.take()):
            listener.close()
            return Ends(name)
    raise absent("topic", name, known, "./elea topic list tells them all; --wait waits for it")


def is_latched(ends: Ends) -> bool:
    """Whether late joiners get the last value: by who publishes, else by the table of topics."""
    topic = topic_of(ends.name)
    return ends.latched or (not ends.publishers and topic is not None and topic.quality is Quality.LATCHED)


def type_of(ends: Ends) -> str:
    """The ROS type of a topic, for samples that do not tell it; empty when nobody knows."""
    topic = topic_of(ends.name)
    return next((each for each in ends.types if each != "-"), "" if topic is None else topic.record.ROS_TYPE)
