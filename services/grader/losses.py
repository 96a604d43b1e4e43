"""Messages lost, gathered from the heartbeats of all nodes."""

from __future__ import annotations

from collections.abc import Collection

from messages.elea import Health


class Losses:
    """The last count of every process and topic; a restarted process counts anew beside its predecessor.

    The losses of ``readers``, which are nodes, are the run's, those of all nodes when none is named. What others miss,
    who only look on, is told apart: a browser that is slow says nothing of a run.
    """

    def __init__(self, readers: Collection[str] = ()) -> None:
        self._readers = frozenset(readers)
        self._lost: dict[tuple[str, int, str], int] = {}

    def take(self, health: Health) -> None:
        """Take one heartbeat."""
        for each in health.inputs:
            self._lost[health.node, health.pid, each.topic.strip("/")] = each.lost

    def total(self) -> int:
        """Messages that readers lost, on all topics."""
        return sum(lost for (node, _, _), lost in self._lost.items() if self._counts(node))

    def of(self, robot: str) -> int:
        """Messages that readers lost on the topics of one robot."""
        own = f"{robot}/"
        return sum(lost for (node, _, at), lost in self._lost.items() if self._counts(node) and at.startswith(own))

    def onlookers(self) -> dict[str, int]:
        """What each node missed that is no reader; those that missed nothing are left out."""
        found: dict[str, int] = {}
        for (node, _, _), lost in sorted(self._lost.items()):
            if lost and not self._counts(node):
                found[node] = found.get(node, 0) + lost
        return found

    def _counts(self, node: str) -> bool:
        return not self._readers or node in self._readers
