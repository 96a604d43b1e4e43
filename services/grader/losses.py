"""Messages lost and ticks missed, gathered from the heartbeats of all nodes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from messages.base import counted
from messages.elea import Health

MOST_PROCESSES = 4096
MOST_TOPICS = 1 << 16
"""Processes, and topics of each, that are remembered: whoever else beats is not counted."""


@dataclass
class _Process:
    """What the heartbeats of one life of a node have told; ``total`` is over all its topics."""

    total: int = 0
    missed: int = 0
    of: dict[str, int] = field(default_factory=dict)


class Losses:
    """The last counts of every process; a restarted process counts anew beside its predecessor.

    A heartbeat tells the total, and of a node with many topics those with new losses first: each topic's count is the
    last one told. The losses of ``readers``, which are nodes, are the run's, those of all nodes when none is named.
    What others miss, who only look on, is told apart: a browser that is slow says nothing of a run.
    """

    def __init__(self, readers: Collection[str] = ()) -> None:
        self._readers = frozenset(readers)
        self._processes: dict[tuple[str, int], _Process] = {}

    def take(self, health: Health) -> None:
        """Take one heartbeat."""
        who = health.node, health.pid
        if (known := self._processes.get(who)) is None:
            if len(self._processes) >= MOST_PROCESSES:
                return
            known = self._processes[who] = _Process()
        known.missed = health.missed
        for each in health.inputs:
            if (topic := each.topic.strip("/")) in known.of or (each.lost and len(known.of) < MOST_TOPICS):
                known.of[topic] = each.lost
        known.total = max(health.lost, sum(known.of.values()))

    def total(self) -> int:
        """Messages that readers lost, on all topics."""
        return counted(0, sum(each.total for (node, _), each in self._processes.items() if self._counts(node)))

    def of(self, robot: str) -> int:
        """Messages that readers lost on the topics of one robot."""
        own = f"{robot}/"
        counting = (each for (node, _), each in self._processes.items() if self._counts(node))
        return counted(0, sum(lost for each in counting for at, lost in each.of.items() if at.startswith(own)))

    def missed(self) -> dict[str, int]:
        """The ticks that each reader missed because it was late; those that missed none are left out."""
        found: dict[str, int] = {}
        for (node, _), each in sorted(self._processes.items()):
            if each.missed and self._counts(node):
                found[node] = counted(found.get(node, 0), each.missed)
        return found

    def onlookers(self) -> dict[str, int]:
        """What each node missed that is no reader; those that missed nothing are left out."""
        found: dict[str, int] = {}
        for (node, _), each in sorted(self._processes.items(), key=lambda item: item[0]):
            if each.total and not self._counts(node):
                found[node] = counted(found.get(node, 0), each.total)
        return found

    def _counts(self, node: str) -> bool:
        return not self._readers or node in self._readers
