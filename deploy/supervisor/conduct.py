"""What the services tell of the conduct of a run: scheduled changes that were made or not, and how time ran."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from deploy.fleet import Change
from deploy.report.record import ChangeFigures
from messages.parameters import ScheduledChange, ScheduledChanges
from messages.simulation import SimStatus

LEEWAY_S = 1.0
"""Simulation time before the end of a run in which the making of a change may go unseen."""


class Conduct:
    """Gathers it. What was once told as not made stays so, until time begins anew."""

    def __init__(self) -> None:
        self._epoch = 0
        self._changes: dict[int, ScheduledChange] = {}
        self._statuses: dict[bytes, SimStatus] = {}
        self._said: set[str] = set()

    def schedule(self, news: ScheduledChanges) -> None:
        """Take what the parameter service tells. One that was started anew tells of its own life alone."""
        if news.epoch != self._epoch:
            self._epoch, self._changes = news.epoch, {}
        for each in news.changes:
            known = self._changes.get(each.number)
            if known is None or known.made:
                self._changes[each.number] = each

    def status(self, publisher: bytes, status: SimStatus) -> None:
        """Take what a simulation tells; one that was started anew counts beside its predecessor."""
        self._statuses[publisher] = status

    @property
    def absent(self) -> tuple[str, ...]:
        """The nodes that were not ready when time began."""
        return tuple(sorted({name for status in self._statuses.values() for name in status.absent}))

    @property
    def lag_s(self) -> float:
        """Wall time [s] by which the simulation fell behind."""
        return sum(status.lag for status in self._statuses.values())

    def changes(self, scheduled: Sequence[Change], end_s: float) -> tuple[ChangeFigures, ...]:
        """What became of the fleet's changes in a run that ended at ``end_s`` of simulation time."""
        return tuple(self._figures(*each, end_s) for each in enumerate(_in_order(scheduled)))

    def news(self, scheduled: Sequence[Change]) -> Iterator[str]:
        """One line for each thing that went wrong since the last call."""
        lines = [f"time began without {', '.join(self.absent)}: see ./elea logs"] if self.absent else []
        for number, change in enumerate(_in_order(scheduled)):
            told = self._changes.get(number)
            if told is not None and not told.made:
                lines.append(f"the change of {change.set} scheduled at {change.at:g} s was not made: {told.reason}")
        for line in lines:
            if line not in self._said:
                self._said.add(line)
                yield line

    def _figures(self, number: int, change: Change, end_s: float) -> ChangeFigures:
        told = self._changes.get(number)
        made, at, reason = (told.made, told.time.ns / 1e9, told.reason) if told else (None, None, "")
        if told is None and change.at + LEEWAY_S < end_s:
            made, reason = False, "the parameter service does not tell of it: did somebody announce its set?"
        elif told is None:
            reason = f"the run ended at {end_s:g} s"
        return ChangeFigures(
            at_s=change.at,
            set=change.set,
            values=change.values,
            made=made,
            made_at_s=at if made else None,
            reason=reason,
        )


def _in_order(scheduled: Sequence[Change]) -> list[Change]:
    """As the parameter service counts them."""
    return sorted(scheduled, key=lambda each: each.at)
