"""The node graph, from liveliness tokens, and its channels: nodes, topics and rates."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

from messages.elea import Health, InputHealth
from messages.topics import HEALTH, TOPICS
from services.panel.clock import SimTimeMap
from services.panel.protocol import as_json
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup
from services.runtime.graph import EVERYTHING, Entity
from services.runtime.transport.api import Transport


class NodeGraph:
    """Tracks the tokens of all nodes; ``version`` is incremented by each update with changes."""

    def __init__(self, transport: Transport) -> None:
        self._watch = transport.watch(EVERYTHING)
        self._entities: dict[str, Entity] = {}
        self.version = 0

    def update(self) -> None:
        """Process tokens that appeared or disappeared."""
        changed = False
        while (event := self._watch.poll()) is not None:
            entity = Entity.parse(event.key)
            if entity is None or entity.kind in ("step", "ready"):
                continue
            changed = True
            if event.alive:
                self._entities[event.key] = entity
            else:
                self._entities.pop(event.key, None)
        self.version += changed

    @property
    def entities(self) -> list[Entity]:
        """All entities, sorted by node, kind and name."""
        return sorted(self._entities.values(), key=lambda e: (e.node, e.kind, e.name))

    def publication(self, name: str) -> Entity | None:
        """Return a publication of a topic, with its type and quality, or None."""
        return next((each for each in self._entities.values() if each.kind == "pub" and each.name == name), None)

    def find_topics(self, kind: str, last: str) -> list[Entity]:
        """Return the publications (``pub``) or subscriptions (``sub``) of all topics whose name ends with ``/last``."""
        end = f"/{last}"
        found = [each for each in self._entities.values() if each.kind == kind and each.name.endswith(end)]
        return sorted(found, key=lambda e: e.name)


RATE_HEARTBEATS = 4
"""Number of heartbeat periods over which a rate is measured."""

MAX_NODES = 4096
"""Maximum nodes whose heartbeats are tracked."""

_EXPECTED_RATES = {topic.name.lstrip("/"): topic.rate for topic in TOPICS}


def expected_rate(name: str) -> float:
    """Return the rate [Hz of simulation time] that the table of topics declares for a topic, 0 for none.

    The end of the name is looked up: ``sonar/range`` for ``/tb3_0/sonar/range``.
    """
    parts = name.lstrip("/").split("/")
    return next(
        (_EXPECTED_RATES[end] for i in range(len(parts)) if (end := "/".join(parts[i:])) in _EXPECTED_RATES), 0.0
    )


class GraphChannel:
    """Sends the whole graph whenever it has changed."""

    period, streams = 0.2, False

    def __init__(self, graph: NodeGraph) -> None:
        self._graph = graph

    @property
    def version(self) -> int:
        """The version of the graph."""
        return self._graph.version

    def set_enabled(self, enabled: bool) -> None:
        """Do nothing: tokens are always tracked."""

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the graph."""

    def delta(self, since: int) -> str | None:
        nodes: dict[str, str] = {}
        topics: dict[str, dict[str, Any]] = {}
        services = []
        for each in self._graph.entities:
            nodes.setdefault(each.node, "")
            if each.kind == "node":
                nodes[each.node] = each.name
            elif each.kind == "srv":
                services.append({"name": each.name, "type": each.record, "node": each.node})
            else:
                topic = topics.setdefault(each.name, {"types": [], "quality": "", "pubs": [], "subs": []})
                topic[f"{each.kind}s"].append(each.node)
                if each.record not in topic["types"]:
                    topic["types"].append(each.record)
                if each.kind == "pub" or not topic["quality"]:
                    topic["quality"] = each.detail.lower()
        listed = [{"name": name, "promised": expected_rate(name), **topic} for name, topic in sorted(topics.items())]
        return as_json("graph", nodes=[{"name": n, "kind": k} for n, k in nodes.items()], topics=listed, srvs=services)


@dataclass
class _NodeHealth:
    """The content of a node's heartbeats, each of which may list only some of its topics.

    ``sent`` has for each publication the heartbeats that listed it: the sender's clock [s], the simulation time [s] and
    the number of samples sent by then. ``inputs`` are the last counts of each subscription. ``at`` is the time of the
    last heartbeat [s of this process's clock].
    """

    sent: dict[str, deque[tuple[float, float, int]]] = field(default_factory=dict)
    inputs: dict[str, InputHealth] = field(default_factory=dict)
    last: Health = field(default_factory=Health)
    at: float = 0.0
    last_growth: dict[str, float] = field(default_factory=dict)

    def add(self, health: Health, wall: float, sim: float, now: float) -> None:
        """Add a heartbeat sent at ``wall`` and ``sim`` time [s], received at ``now`` [s]."""
        first = health.pid != self.last.pid
        if first:
            self.sent.clear()
            self.inputs.clear()
        for each in health.outputs:
            beats = self.sent.get(each.topic)
            if beats is None:
                beats = self.sent[each.topic] = deque(maxlen=RATE_HEARTBEATS + 1)
                grown = each.sent > 0 and not first and len(health.outputs) == health.writes
            else:
                grown = each.sent != beats[-1][2]
            if grown:
                self.last_growth[each.topic] = now
            beats.append((wall, sim, each.sent))
        self.inputs |= {each.topic: each for each in health.inputs}
        self.last, self.at = health, now

    def prune(self, ends: set[tuple[str, str]]) -> None:
        """Remove the publications and subscriptions that no longer exist; ``ends`` has kind and topic of the others."""
        self.sent = {topic: beats for topic, beats in self.sent.items() if ("pub", topic) in ends}
        self.last_growth = {topic: when for topic, when in self.last_growth.items() if ("pub", topic) in ends}
        self.inputs = {topic: each for topic, each in self.inputs.items() if ("sub", topic) in ends}


class RatesChannel:
    """Sends once a second, from the heartbeats: rates of publications, losses of subscriptions, and ages."""

    period, streams = 1.0, False

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph, time: SimTimeMap) -> None:
        self.version = 0
        self._subscriptions, self._graph, self._time = SubscriptionGroup(subscriptions), graph, time
        self._topic = (HEALTH.name, Health.ROS_TYPE)
        self._nodes: dict[str, _NodeHealth] = {}
        self._now = 0.0

    def set_enabled(self, enabled: bool) -> None:
        self._subscriptions.set_topics({self._topic: HEALTH.quality.name} if enabled else {})
        self._nodes = {}

    def update(self, now: float) -> None:
        self._now = now
        self.version += 1
        for health, origin in self._subscriptions.messages(*self._topic):
            if health.node not in self._nodes and len(self._nodes) >= MAX_NODES:
                continue
            node_health = self._nodes.setdefault(health.node, _NodeHealth())
            wall = origin.source_ns / 1e9 if origin is not None else now
            node_health.add(health, wall, self._time.at(origin) / 1e9, now)

    def delta(self, since: int) -> str | None:
        ends: dict[str, set[tuple[str, str]]] = {}
        for each in self._graph.entities:
            ends.setdefault(each.node, set()).add((each.kind, each.name))
        self._nodes = {node: node_health for node, node_health in self._nodes.items() if node in ends}
        nodes: dict[str, Any] = {}
        topics: dict[str, Any] = {}
        for node, node_health in self._nodes.items():
            health = node_health.last
            node_health.prune(ends[node])
            nodes[node] = {
                "state": health.state,
                "note": health.note,
                "pid": health.pid,
                "age": round(self._now - node_health.at, 1),
                "refused_requests": health.refused_requests,
                "request_reason": health.request_reason,
                "inputs": {
                    topic: [
                        each.received,
                        each.lost,
                        each.refused,
                        each.foreign,
                        each.reason,
                        each.repeated,
                        each.resynced,
                    ]
                    for topic, each in node_health.inputs.items()
                },
            }
            for topic, (by_sim, by_wall) in self._rates(node_health).items():
                known = topics.setdefault(topic, {"hz": 0.0, "wall": 0.0, "age": None, "sent": 0})
                known["hz"] += by_sim
                known["wall"] += by_wall
                known["sent"] += node_health.sent[topic][-1][2]
                if topic in node_health.last_growth:
                    age = round(self._now - node_health.last_growth[topic], 1)
                    known["age"] = age if known["age"] is None else min(known["age"], age)
        return as_json("rates", nodes=nodes, topics=topics)

    def _rates(self, node_health: _NodeHealth) -> dict[str, tuple[float, float]]:
        """Return each publication's rate [Hz] in simulation time and in wall time, once it has two heartbeats."""
        rates = {}
        for topic, beats in node_health.sent.items():
            if len(beats) < 2:
                continue
            (wall, sim, sent), (wall_now, sim_now, sent_now) = beats[0], beats[-1]
            grown = max(0, sent_now - sent)
            by_sim = grown / (sim_now - sim) if sim_now - sim > 0.05 else 0.0
            by_wall = grown / (wall_now - wall) if wall_now > wall else 0.0
            rates[topic] = round(by_sim, 2), round(by_wall, 2)
        return rates
