"""The desk of the parameter service: what is asked of it, answered from the sets as they stand."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Collection
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
from messages.topics import DESCRIPTIONS, UPDATES
from services.params.arrival import announced
from services.params.change import Change, plan_new_run, plan_reset, plan_set, plan_undo
from services.params.ledger import Asked, Ledger
from services.params.schema import Conflict, checked
from services.params.state import State, level_of
from services.params.store import NotSaved, Store
from services.runtime.errors import BadInput, unknown
from services.runtime.log import Log

MOST_SETS = 1000
"""Sets that somebody announces, or of which something is saved."""
MOST_NODES = 100
"""Nodes that share a set; and nodes that have left it, for which saved values wait."""
MOST_BYTES = 64 << 20
"""Bytes of all announcements that are kept: 6,000 bases of robots."""
MOST_LISTED = 6 << 20
"""Bytes of one answer about all sets; a link carries 8 MiB in one message."""
MOST_DROPPED = 100
"""Announcements of dead nodes that are dropped at once: each is a write to the disk."""
LOOK_S = 5.0
"""Wall time between two looks for nodes that have died, when there is no room."""
MOST_HISTORY = 2 << 20
"""Bytes of one answer about the past."""
_read_reply = decoder(ParameterValues)

Tell = Callable[[ParameterSchema | ParameterValues], None]
Question = SetParameters | ResetParameters | UndoParameters


class Desk:
    """All sets, and the only place that changes them. A change is written, then counts, then is told, then answered.

    A set that nobody announces any more, and of which nothing is saved, is forgotten; its past stays.

    Args:
        store: What outlives this process.
        tell: Publishes a set's schema or values.
        log: Of the node.
        now: Simulation time [ns].
        living: The names of the nodes that are in sight.
        end: Ends the publications of a set.
    """

    def __init__(
        self,
        store: Store,
        tell: Tell,
        log: Log,
        now: Callable[[], int],
        living: Callable[[], Collection[str]],
        end: Callable[[str], None],
    ) -> None:
        self._ledger = Ledger(store, now)
        self._store, self._tell, self._log, self._living, self._end = store, tell, log, living, end
        kept = store.sets()
        self._owners = {name: dict(each.owners) for name, each in kept.items() if each.saved}
        self._sets = {
            name: State(name, saved=each.saved, revision=each.revision) for name, each in kept.items() if each.saved
        }
        self._revisions = {name: each.revision for name, each in kept.items() if not each.saved}
        self._sizes: dict[str, dict[str, int]] = {}
        self._looked = -math.inf

    @property
    def present(self) -> set[str]:
        """The sets that somebody has announced."""
        return {name for name, state in self._sets.items() if state.schema.announced}

    def announce(self, asked: Announcement) -> ParameterValues:
        """Take a node's parameters up and give the values that count; raises BadInput for what cannot be."""
        if asked.leaves:
            self._state(asked.set)
            return self._leave(asked.set, asked.node)
        asked = checked(asked)
        size = len(encode(asked))
        self._make_room(asked, size)
        state = self._sets.get(asked.set) or self._remembered(asked.set) or State(asked.set)
        arrival = announced(state, self._joined(state, asked), asked, self._owners.get(asked.set, {}))
        _check_size(arrival.state.schema.record(asked.set), DESCRIPTIONS.largest)
        _check_size(arrival.state.record(notes=arrival.notes), UPDATES.largest)
        self._revisions.pop(asked.set, None)
        self._sizes.setdefault(asked.set, {})[asked.node] = size
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
        if (size := sum(sum(each.values()) for each in self._sizes.values())) > MOST_LISTED:
            raise BadInput(
                f"{len(self._sets)} sets of {size} bytes: an answer has at most {MOST_LISTED}; "
                f"each set is described on a topic of its own, SET/{DESCRIPTIONS.name.removeprefix('~')}"
            )
        shown = sorted(self._sets.values(), key=lambda state: state.name)
        return ParameterSets(sets=tuple(each.schema.record(each.name) for each in shown))

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
        state = self._sets.get(name) or self._remembered(name)
        if state is None:
            raise unknown("set of parameters", name, self._sets)
        return state

    def _remembered(self, name: str) -> State | None:
        """A set that was forgotten, without values: its revisions go on, so that those of its past mean one change."""
        revision = max(self._revisions.get(name, 0), self._store.past.revision(name))
        return State(name, revision=revision) if revision else None

    def _make_room(self, asked: Announcement, size: int) -> None:
        """See that one more announcement can be kept; raises BadInput when it cannot.

        Nodes that died without a word are dropped only for want of room: a set must not lose its values because a link
        was down for a moment.
        """
        if (lack := self._lack(asked, size)) and time.monotonic() - self._looked > LOOK_S:
            living = {*self._living(), asked.node}
            gone = [(name, node) for name, state in self._sets.items() for node in state.schema.announced]
            for name, node in [each for each in gone if each[1] not in living][:MOST_DROPPED]:
                self._leave(name, node)
            self._looked = time.monotonic()
            lack = self._lack(asked, size)
        if lack:
            raise BadInput(f"{asked.set}: {lack}")

    def _lack(self, asked: Announcement, size: int) -> str:
        """Why an announcement finds no room, or nothing."""
        state = self._sets.get(asked.set)
        if state is None and len(self._sets) >= MOST_SETS:
            idle = sum(not each.schema.announced for each in self._sets.values())
            return (
                f"there are {MOST_SETS} sets of parameters, no more are taken; {idle} of them hold only "
                "what is saved for nodes that are not there: ./elea param reset SET forgets it"
            )
        nodes = state.schema.announced if state is not None else {}
        if asked.node not in nodes and len(nodes) >= MOST_NODES:
            return f"{MOST_NODES} nodes share it, no more are taken"
        kept = sum(sum(each.values()) for each in self._sizes.values())
        if kept + size - self._sizes.get(asked.set, {}).get(asked.node, 0) > MOST_BYTES:
            return f"all sets together are described in {kept} bytes, {MOST_BYTES} is the most"
        return ""

    def _forget(self, state: State) -> None:
        """Forget a set of which there is nothing left."""
        if state.schema.announced or state.saved or self._sets.get(state.name) is not state:
            return
        for known in (self._sets, self._owners, self._sizes):
            known.pop(state.name, None)
        self._end(state.name)
        try:
            self._store.forget(state.name)
        except NotSaved as error:
            self._log.error(str(error))

    def _joined(self, state: State, asked: Announcement) -> State:
        """The set with the node's announcement; a node that has gone has no say against it."""
        while True:
            try:
                return replace(state, schema=state.schema.with_node(asked))
            except Conflict as conflict:
                if conflict.other in self._living():
                    raise
                self._log.info(f"{asked.set}: {conflict.other} has gone, what it announced is forgotten")
                state = replace(state, schema=state.schema.without(conflict.other))

    def _leave(self, name: str, node: str) -> ParameterValues:
        """A node follows a set no more. What is saved waits for who announces it next; values of the run go."""
        state = self._state(name)
        if node not in state.schema.announced:
            return state.record()
        schema = state.schema.without(node)
        run = {each: value for each, value in state.run.items() if each in schema.parameters}
        left = self._sets[name] = replace(state, schema=schema, run=run, revision=state.revision + 1)
        self._sizes.get(name, {}).pop(node, None)
        self._tell(schema.record(name))
        self._tell(left.record(level_of(state, left), [f"{node} follows it no more"]))
        if left.schema.announced or left.saved:
            self._disown(left, node)
        else:
            self._forget(left)
        return left.record()

    def _disown(self, state: State, node: str) -> None:
        """Of a node that has left, only what is saved is kept for its return; of MOST_NODES that have left, nothing."""
        owners = self._owners.get(state.name, {})
        gone = {each for nodes in owners.values() for each in nodes} - state.schema.announced.keys()
        forgotten = gone if len(gone) > MOST_NODES else frozenset()
        kept = {
            name: nodes - forgotten if name in state.saved else nodes - {node} - forgotten
            for name, nodes in owners.items()
        }
        self._owners[state.name] = {name: nodes for name, nodes in kept.items() if nodes or name in state.saved}
        try:
            self._store.disown(state.name, node, forgotten)
        except NotSaved as error:
            self._log.error(str(error))

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
        _check_size(reply, UPDATES.largest)
        if change.names:
            request = (asked.id, _digest(asked), encode(reply)) if asked.id else None
            self._ledger.asked(Asked(change, kind, asked.who, request, undoes))
            self._count(change)
        return reply

    def _count(self, change: Change) -> None:
        self._sets[change.after.name] = change.after
        self._tell(change.after.record(level_of(change.before, change.after), change.notes))
        self._forget(change.after)


def _check_size(record: ParameterSchema | ParameterValues, largest: int) -> None:
    """Raise BadInput for what its readers would refuse."""
    if (size := len(encode(record))) > largest:
        raise BadInput(f"{record.set} would be told in {size} bytes, {largest} is the most; nothing was changed")


def _digest(asked: Message) -> str:
    return hashlib.blake2b(asked.ROS_TYPE.encode() + encode(asked), digest_size=16).hexdigest()
