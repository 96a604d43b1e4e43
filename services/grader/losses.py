"""Messages lost, gathered from the heartbeats of all nodes."""

from __future__ import annotations

from messages.elea import Health


class Losses:
    """The last count of every process and topic; a restarted process counts anew beside its predecessor."""

    def __init__(self) -> None:
        self._lost: dict[tuple[str, int, str], int] = {}

    def take(self, health: Health) -> None:
        """Take one heartbeat."""
        for each in health.inputs:
            self._lost[health.node, health.pid, each.topic.strip("/")] = each.lost

    def total(self) -> int:
        """Messages lost on all topics."""
        return sum(self._lost.values())

    def of(self, robot: str) -> int:
        """Messages lost on the topics of one robot."""
        return sum(lost for (_, _, topic), lost in self._lost.items() if topic.startswith(f"{robot}/"))
