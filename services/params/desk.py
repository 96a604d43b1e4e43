"""The desk of the parameter service: what is asked of it, answered from the sets as they stand."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace

from messages.base import Message, decoder, encode
from messages.parameters import (
    Announcement,
    HistoryOf,
    ParameterHistory,
    ParameterSchema,
    ParameterSet,
    ParameterSets,
    ParameterValues,
    ResetParameters,
    SetParameters,
    UndoParameters,
)
from messages.std import Empty
from services.params.arrival import announced
from services.params.change import Change, plan_new_run, plan_reset, plan_set, plan_undo
from services.params.ledger import Asked, Ledger
from services.params.schema import Conflict, checked
from services.params.state import State, level_of
from services.params.store import NotSaved, Store
from services.runtime.errors import BadInput, unknown
from services.runtime.log import Log

MOST_SETS = 1000
MOST_HISTORY = 2 << 20
"""Bytes of one answer about the past."""
_read_reply = decoder(ParameterValues)

Tell = Callable[[ParameterSchema | ParameterValues], None]
Question = SetParameters | ResetParameters | UndoParameters


class Desk:
    """All sets, and the only place that changes them. A change is written, then counts, then is told, then answered."""

    def __init__(
        self, store: Store, tell: Tell, log: Log, now: Callable[[], int], alive: Callable[[str], bool]
    ) -> None:
        self._ledger = Ledger(store, now)
        self._store, self._tell, self._log, self._alive = store, tell, log, alive
        kept = store.sets()
        self._owners = {name: dict(each.owners) for name, each in kept.items()}
        self._sets = {name: State(name, saved=each.saved, revision=each.revision) for name, each in kept.items()}

    @property
    def present(self) -> set[str]:
        """The sets that somebody has announced."""
        return {name for name, state in self._sets.items() if state.schema.announced}

    def announce(self, asked: Announcement) -> ParameterValues:
        """Take a node's parameters up and give the values that count; raises BadInput for what cannot be."""
        if asked.leaves:
            return self._leave(asked)
        asked = checked(asked)
        state = self._sets.get(asked.set)
        if state is None:
            if sum(bool(each.schema.announced or each.saved) for each in self._sets.values()) >= MOST_SETS:
                raise BadInput(f"{asked.set}: there are {MOST_SETS} sets of parameters, no more are taken")
            state = State(asked.set)
        arrival = announced(state, self._joined(state, asked), asked, self._owners.get(asked.set, {}))
        self._owners[asked.set] = dict(arrival.owners)
        for text in arrival.migrated:
            self._log.warn(f"{asked.set}: {text}")
        self._sets[asked.set] = arrival.state
        if (trouble := self._ledger.arrived(state, arrival)) is not None:
            self._log.error(f"{asked.set}: {trouble}")
        if arrival.described:
            self._tell(arrival.state.schema.record(asked.set))
        if arrival.news:
            level = level_of(state, arrival.state) if state.schema.announced else arrival.state.record().level
            self._tell(arrival.state.record(level, arrival.notes))
        return arrival.state.record(notes=arrival.notes)

    def list(self, asked: Empty) -> ParameterSets:
        """Every set; one that nobody has announced has no nodes and no parameters."""
        shown = [state for state in self._sets.values() if state.schema.announced or state.saved]
        return ParameterSets(sets=tuple(each.schema.record(each.name) for each in sorted(shown, key=lambda s: s.name)))

    def get(self, asked: ParameterSet) -> ParameterValues:
        """The values of a set that count."""
        state = self._state(asked.set)
        notes = [f"{name} is saved, but nobody has announced it" for name in state.dormant()]
        if not state.schema.announced:
            notes = ["no running service has announced this set: these are its saved values"]
        return state.record(notes=notes)

    def set(self, asked: SetParameters) -> ParameterValues:
        """Change several parameters, all or none."""
        return self._once(asked, lambda: self._carry_out(plan_set(self._state(asked.set), asked), asked, asked.kind))

    def reset(self, asked: ResetParameters) -> ParameterValues:
        """Forget what was set."""
        return self._once(asked, lambda: self._carry_out(plan_reset(self._state(asked.set), asked), asked, "reset"))

    def undo(self, asked: UndoParameters) -> ParameterValues:
        """Take the newest change back."""
        return self._once(asked, lambda: self._undo(asked))

    def history(self, asked: HistoryOf) -> ParameterHistory:
        """Who changed what, newest first, as much as one answer may hold."""
        if asked.set:
            self._state(asked.set)
        changes, size = [], 0
        for each in self._store.past.history(asked.set, asked.limit):
            size += len(encode(each))
            if size > MOST_HISTORY:
                break
            changes.append(each)
        return ParameterHistory(changes=tuple(changes))

    def new_run(self) -> None:
        """The simulation was reset: what was for one run alone is forgotten."""
        for state in list(self._sets.values()):
            change = plan_new_run(state)
            if change is not None:
                self._count(change)
                if (trouble := self._ledger.new_run(change)) is not None:
                    self._log.error(f"{state.name}: {trouble}")
        try:
            self._store.forget_run()
        except NotSaved as error:
            self._log.error(str(error))

    def _state(self, name: str) -> State:
        if name not in self._sets:
            raise unknown("set of parameters", name, self._sets)
        return self._sets[name]

    def _joined(self, state: State, asked: Announcement) -> State:
        """The set with the node's announcement; a node that has gone has no say against it."""
        while True:
            try:
                return replace(state, schema=state.schema.with_node(asked))
            except Conflict as conflict:
                if self._alive(conflict.other):
                    raise
                self._log.info(f"{asked.set}: {conflict.other} has gone, what it announced is forgotten")
                state = replace(state, schema=state.schema.without(conflict.other))

    def _leave(self, asked: Announcement) -> ParameterValues:
        """A node follows a set no more. What is saved waits for who announces it next; values of the run go."""
        state = self._state(asked.set)
        if asked.node not in state.schema.announced:
            return state.record()
        schema = state.schema.without(asked.node)
        run = {name: value for name, value in state.run.items() if name in schema.parameters}
        left = self._sets[asked.set] = replace(state, schema=schema, run=run, revision=state.revision + 1)
        self._tell(schema.record(asked.set))
        self._tell(left.record(level_of(state, left), [f"{asked.node} follows it no more"]))
        return left.record()

    def _once(self, asked: Question, carry_out: Callable[[], ParameterValues]) -> ParameterValues:
        """Carry a request out, unless it was already under its id: then give the same answer."""
        if not asked.id:
            return carry_out()
        known = self._store.past.reply(asked.id)
        if known is None:
            return carry_out()
        digest, reply = known
        if digest != _digest(asked):
            raise BadInput(f"the request id {asked.id!r} was used for another request: give each its own")
        return _read_reply(reply)

    def _undo(self, asked: UndoParameters) -> ParameterValues:
        state = self._state(asked.set)
        past, revision = self._store.past, asked.revision
        undoable = past.change(asked.set, revision) if revision else past.undoable(asked.set)
        if undoable is None:
            which = f" that made revision {revision}" if revision else ""
            raise BadInput(f"{asked.set}: there is no change{which} to take back")
        if undoable.undone:
            return state.record(0, [f"revision {revision} is taken back already"])
        change = plan_undo(state, undoable.back, undoable.run)
        return self._carry_out(change, asked, "undo", undoable.id)

    def _carry_out(self, change: Change, asked: Question, kind: str, undoes: int | None = None) -> ParameterValues:
        """Write, then count, then tell, then answer."""
        level = level_of(change.before, change.after)
        reply = change.after.record(level, change.notes)
        if change.names:
            request = (asked.id, _digest(asked), encode(reply)) if asked.id else None
            self._ledger.asked(Asked(change, kind, asked.who, request, undoes))
            self._count(change)
        return reply

    def _count(self, change: Change) -> None:
        self._sets[change.after.name] = change.after
        self._tell(change.after.record(level_of(change.before, change.after), change.notes))


def _digest(asked: Message) -> str:
    return hashlib.blake2b(asked.ROS_TYPE.encode() + encode(asked), digest_size=16).hexdigest()
