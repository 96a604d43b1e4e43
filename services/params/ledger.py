"""How changes are entered: each with its history, in one commit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from messages.parameters import Assignment, ParameterChange
from messages.std import Time
from services.params.arrival import Arrival
from services.params.change import Change
from services.params.state import State
from services.params.store import Entry, NotSaved, Store, texts


class Asked(NamedTuple):
    """A change that somebody asked for; ``request`` is its id, digest and reply, ``undoes`` what it takes back."""

    change: Change
    kind: str
    who: str
    request: tuple[str, str, bytes] | None
    undoes: int | None


class Ledger:
    """Writes what happens to the sets into the store; ``now`` is simulation time [ns]."""

    def __init__(self, store: Store, now: Callable[[], int]) -> None:
        self._store, self._now = store, now

    def asked(self, asked: Asked) -> None:
        """Enter what somebody asked for; raises NotSaved, and it does not count."""
        change = asked.change
        self._store.write(
            Entry(
                set=change.after.name,
                revision=change.after.revision,
                saved=texts(change.before.saved, change.after.saved),
                change=self._change(change.before, change.after, change.names, asked.kind, asked.who, change.run),
                back=change.back,
                lasting=asked.kind != "undo",
                undoes=asked.undoes,
                request=asked.request,
                run=change.run,
            )
        )

    def arrived(self, before: State, arrival: Arrival) -> NotSaved | None:
        """Enter an announcement; it counts even if it could not be written, which the next start repeats."""
        after = arrival.state
        change = None
        if arrival.changed:
            change = self._change(before, after, arrival.changed, "migrated", arrival.node, False)
        return self._try(
            Entry(
                set=after.name,
                revision=after.revision,
                saved=texts(before.saved, after.saved),
                change=change,
                owner=arrival.node,
                owned=arrival.owned,
            )
        )

    def new_run(self, change: Change) -> NotSaved | None:
        """Enter that the values of a run are forgotten."""
        after = change.after
        said = self._change(change.before, after, change.names, "reset", "a new run", True)
        return self._try(Entry(set=after.name, revision=after.revision, change=said, run=True))

    def _try(self, entry: Entry) -> NotSaved | None:
        try:
            self._store.write(entry)
        except NotSaved as error:
            return error
        return None

    def _change(
        self, before: State, after: State, names: tuple[str, ...], kind: Any, who: str, run: bool
    ) -> ParameterChange:
        return ParameterChange(
            set=after.name,
            revision=after.revision,
            kind=kind,
            who=who,
            wall_time=time.time_ns(),
            sim_time=Time.of(self._now()),
            before=tuple(Assignment(name=name, value=before.parameter(name).value) for name in names),
            after=tuple(Assignment(name=name, value=after.parameter(name).value) for name in names),
            run=run,
        )
