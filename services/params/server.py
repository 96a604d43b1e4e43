"""The parameter server: answers requests from the sets as they stand, and logs every change."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any, NamedTuple

from messages.base import Message, decoder, encode
from messages.parameters import (
    Announcement,
    Assignment,
    HistoryOf,
    ParameterChange,
    ParameterHistory,
    ParameterSchema,
    ParameterSet,
    ParameterSets,
    ParameterValues,
    ResetParameters,
    SetParameters,
    UndoParameters,
)
from messages.std import Empty, Time
from messages.topics import DESCRIPTIONS, UPDATES
from services.params.changes import (
    AnnounceResult,
    Change,
    apply_announcement,
    plan_new_run,
    plan_reset,
    plan_set,
    plan_undo,
)
from services.params.schema import ParameterConflict, SetState, changed_levels, validate_announcement
from services.params.store import SaveError, Store, StoreEntry, changed_rows
from services.runtime.errors import BadInput, unknown_name
from services.runtime.log import Log


class RequestedChange(NamedTuple):
    """A change that somebody asked for; ``request`` is its id, digest and reply, ``undoes`` what it takes back."""

    change: Change
    kind: str
    who: str
    request: tuple[str, str, bytes] | None
    undoes: int | None


class ChangeLog:
    """Writes what happens to the sets into the store; ``now`` is simulation time [ns]."""

    def __init__(self, store: Store, now: Callable[[], int]) -> None:
        self._store, self._now = store, now

    def log_request(self, asked: RequestedChange) -> None:
        """Enter what somebody asked for; raises NotSaved, and it does not count."""
        change = asked.change
        self._store.write(
            StoreEntry(
                set=change.after.name,
                revision=change.after.revision,
                saved=changed_rows(change.before.saved, change.after.saved),
                change=self._change_record(
                    change.before, change.after, change.names, asked.kind, asked.who, change.run
                ),
                undo_patch=change.undo_patch,
                undoable=asked.kind != "undo",
                undoes=asked.undoes,
                request=asked.request,
                run=change.run,
            )
        )

    def log_announcement(self, before: SetState, arrival: AnnounceResult) -> SaveError | None:
        """Enter an announcement; it counts even if it could not be written, which the next start repeats."""
        after = arrival.state
        change = None
        if arrival.migrated_names:
            change = self._change_record(before, after, arrival.migrated_names, "migrated", arrival.node, False)
        return self._try_write(
            StoreEntry(
                set=after.name,
                revision=after.revision,
                saved=changed_rows(before.saved, after.saved),
                change=change,
                owner=arrival.node,
                owned=arrival.owned,
            )
        )

    def log_new_run(self, change: Change) -> SaveError | None:
        """Enter that the values of a run are forgotten."""
        after = change.after
        said = self._change_record(change.before, after, change.names, "reset", "a new run", True)
        return self._try_write(StoreEntry(set=after.name, revision=after.revision, change=said, run=True))

    def _try_write(self, entry: StoreEntry) -> SaveError | None:
        try:
            self._store.write(entry)
        except SaveError as error:
            return error
        return None

    def _change_record(
        self, before: SetState, after: SetState, names: tuple[str, ...], kind: Any, who: str, run: bool
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


MAX_SETS = 1000
"""Sets that somebody announces, or of which something is saved."""
MAX_NODES = 100
"""Nodes that share a set; and nodes that have left it, for which saved values wait."""
MAX_BYTES = 64 << 20
"""Bytes of all announcements that are kept: 6,000 bases of robots."""
MAX_LIST_BYTES = 6 << 20
"""Bytes of one answer about all sets; a link carries 8 MiB in one message."""
MAX_DROPPED = 100
"""Announcements of dead nodes that are dropped at once: each is a write to the disk."""
LIVENESS_PERIOD_S = 5.0
"""Wall time between two looks for nodes that have died, when there is no room."""
MAX_HISTORY_BYTES = 2 << 20
"""Bytes of one answer about the past."""
_read_reply = decoder(ParameterValues)

Publish = Callable[[ParameterSchema | ParameterValues], None]
ChangeRequest = SetParameters | ResetParameters | UndoParameters


class ParameterServer:
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
        tell: Publish,
        log: Log,
        now: Callable[[], int],
        living: Callable[[], Collection[str]],
        end: Callable[[str], None],
    ) -> None:
        self._change_log = ChangeLog(store, now)
        self._store, self._publish, self._log, self._live_nodes, self._unpublish = store, tell, log, living, end
        kept = store.sets()
        self._owners = {name: dict(each.owners) for name, each in kept.items() if each.saved}
        self._sets = {
            name: SetState(name, saved=each.saved, revision=each.revision) for name, each in kept.items() if each.saved
        }
        self._revisions = {name: each.revision for name, each in kept.items() if not each.saved}
        self._sizes: dict[str, dict[str, int]] = {}
        self._last_liveness_check = -math.inf

    @property
    def announced_sets(self) -> set[str]:
        """The sets that somebody has announced."""
        return {name for name, state in self._sets.items() if state.schema.announced}

    def announce(self, asked: Announcement) -> ParameterValues:
        """Take a node's parameters up and give the values that count; raises BadInput for what cannot be."""
        if asked.leaves:
            self._find_set(asked.set)
            return self._remove_node(asked.set, asked.node)
        asked = validate_announcement(asked)
        size = len(encode(asked))
        self._make_room(asked, size)
        state = self._sets.get(asked.set) or self._restored_set(asked.set) or SetState(asked.set)
        arrival = apply_announcement(
            state, self._with_announcement(state, asked), asked, self._owners.get(asked.set, {})
        )
        _check_size(arrival.state.schema.to_message(asked.set), DESCRIPTIONS.largest)
        _check_size(arrival.state.to_message(notes=arrival.notes), UPDATES.largest)
        self._revisions.pop(asked.set, None)
        self._sizes.setdefault(asked.set, {})[asked.node] = size
        self._owners[asked.set] = dict(arrival.owners)
        for text in arrival.migration_notes:
            self._log.warn(f"{asked.set}: {text}")
        self._sets[asked.set] = arrival.state
        if (trouble := self._change_log.log_announcement(state, arrival)) is not None:
            self._log.error(f"{asked.set}: {trouble}")
        if arrival.schema_changed:
            self._publish(arrival.state.schema.to_message(asked.set))
        if arrival.values_changed:
            level = changed_levels(state, arrival.state) if state.schema.announced else arrival.state.to_message().level
            self._publish(arrival.state.to_message(level, arrival.notes))
        return arrival.state.to_message(notes=arrival.notes)

    def list(self, asked: Empty) -> ParameterSets:
        """Every set; one that nobody has announced has no nodes and no parameters."""
        if (size := sum(sum(each.values()) for each in self._sizes.values())) > MAX_LIST_BYTES:
            raise BadInput(
                f"{len(self._sets)} sets of {size} bytes: an answer has at most {MAX_LIST_BYTES}; "
                f"each set is described on a topic of its own, SET/{DESCRIPTIONS.name.removeprefix('~')}"
            )
        shown = sorted(self._sets.values(), key=lambda state: state.name)
        return ParameterSets(sets=tuple(each.schema.to_message(each.name) for each in shown))

    def get(self, asked: ParameterSet) -> ParameterValues:
        """The values of a set that count."""
        state = self._find_set(asked.set)
        notes = [f"{name} is saved, but no node has announced it" for name in state.unannounced()]
        if not state.schema.announced:
            notes = ["no running service has announced this set: these are its saved values"]
        return state.to_message(notes=notes)

    def set(self, asked: SetParameters) -> ParameterValues:
        """Change several parameters, all or none."""
        return self._idempotent(
            asked, lambda: self._apply(plan_set(self._find_set(asked.set), asked), asked, asked.kind)
        )

    def reset(self, asked: ResetParameters) -> ParameterValues:
        """Forget what was set."""
        return self._idempotent(
            asked, lambda: self._apply(plan_reset(self._find_set(asked.set), asked), asked, "reset")
        )

    def undo(self, asked: UndoParameters) -> ParameterValues:
        """Take the newest change back."""
        return self._idempotent(asked, lambda: self._undo(asked))

    def history(self, asked: HistoryOf) -> ParameterHistory:
        """Who changed what, newest first, as much as one answer may hold."""
        if asked.set:
            self._find_set(asked.set)
        changes, size = [], 0
        for each in self._store.history.changes(asked.set, asked.limit):
            size += len(encode(each))
            if size > MAX_HISTORY_BYTES:
                break
            changes.append(each)
        return ParameterHistory(changes=tuple(changes))

    def new_run(self) -> None:
        """The simulation was reset: what was for one run alone is forgotten."""
        for state in list(self._sets.values()):
            change = plan_new_run(state)
            if change is not None:
                self._commit(change)
                if (trouble := self._change_log.log_new_run(change)) is not None:
                    self._log.error(f"{state.name}: {trouble}")
        try:
            self._store.forget_run()
        except SaveError as error:
            self._log.error(str(error))

    def _find_set(self, name: str) -> SetState:
        state = self._sets.get(name) or self._restored_set(name)
        if state is None:
            raise unknown_name("set of parameters", name, self._sets)
        return state

    def _restored_set(self, name: str) -> SetState | None:
        """A set that was forgotten, without values: its revisions go on, so that those of its past mean one change."""
        revision = max(self._revisions.get(name, 0), self._store.history.revision(name))
        return SetState(name, revision=revision) if revision else None

    def _make_room(self, asked: Announcement, size: int) -> None:
        """See that one more announcement can be kept; raises BadInput when it cannot.

        Nodes that died without a word are dropped only for want of room: a set must not lose its values because a link
        was down for a moment.
        """
        if (
            lack := self._no_room_reason(asked, size)
        ) and time.monotonic() - self._last_liveness_check > LIVENESS_PERIOD_S:
            living = {*self._live_nodes(), asked.node}
            gone = [(name, node) for name, state in self._sets.items() for node in state.schema.announced]
            for name, node in [each for each in gone if each[1] not in living][:MAX_DROPPED]:
                self._remove_node(name, node)
            self._last_liveness_check = time.monotonic()
            lack = self._no_room_reason(asked, size)
        if lack:
            raise BadInput(f"{asked.set}: {lack}")

    def _no_room_reason(self, asked: Announcement, size: int) -> str:
        """Why an announcement finds no room, or nothing."""
        state = self._sets.get(asked.set)
        if state is None and len(self._sets) >= MAX_SETS:
            idle = sum(not each.schema.announced for each in self._sets.values())
            return (
                f"there are {MAX_SETS} sets of parameters, no more are taken; {idle} of them hold only "
                "what is saved for nodes that are not there: ./elea param reset SET forgets it"
            )
        nodes = state.schema.announced if state is not None else {}
        if asked.node not in nodes and len(nodes) >= MAX_NODES:
            return f"{MAX_NODES} nodes share it, no more are taken"
        kept = sum(sum(each.values()) for each in self._sizes.values())
        if kept + size - self._sizes.get(asked.set, {}).get(asked.node, 0) > MAX_BYTES:
            return f"all sets together are described in {kept} bytes, {MAX_BYTES} is the most"
        return ""

    def _forget(self, state: SetState) -> None:
        """Forget a set of which there is nothing left."""
        if state.schema.announced or state.saved or self._sets.get(state.name) is not state:
            return
        for known in (self._sets, self._owners, self._sizes):
            known.pop(state.name, None)
        self._unpublish(state.name)
        try:
            self._store.forget(state.name)
        except SaveError as error:
            self._log.error(str(error))

    def _with_announcement(self, state: SetState, asked: Announcement) -> SetState:
        """The set with the node's announcement; a node that has gone has no say against it."""
        while True:
            try:
                return replace(state, schema=state.schema.with_node(asked))
            except ParameterConflict as conflict:
                if conflict.other_node in self._live_nodes():
                    raise
                self._log.info(f"{asked.set}: {conflict.other_node} has gone, what it announced is forgotten")
                state = replace(state, schema=state.schema.without_node(conflict.other_node))

    def _remove_node(self, name: str, node: str) -> ParameterValues:
        """A node follows a set no more. What is saved waits for who announces it next; values of the run go."""
        state = self._find_set(name)
        if node not in state.schema.announced:
            return state.to_message()
        schema = state.schema.without_node(node)
        run = {each: value for each, value in state.run.items() if each in schema.parameters}
        left = self._sets[name] = replace(state, schema=schema, run=run, revision=state.revision + 1)
        self._sizes.get(name, {}).pop(node, None)
        self._publish(schema.to_message(name))
        self._publish(left.to_message(changed_levels(state, left), [f"{node} follows it no more"]))
        if left.schema.announced or left.saved:
            self._disown(left, node)
        else:
            self._forget(left)
        return left.to_message()

    def _disown(self, state: SetState, node: str) -> None:
        """Of a node that has left, only what is saved is kept for its return; of MOST_NODES that have left, nothing."""
        owners = self._owners.get(state.name, {})
        gone = {each for nodes in owners.values() for each in nodes} - state.schema.announced.keys()
        forgotten = gone if len(gone) > MAX_NODES else frozenset()
        kept = {
            name: nodes - forgotten if name in state.saved else nodes - {node} - forgotten
            for name, nodes in owners.items()
        }
        self._owners[state.name] = {name: nodes for name, nodes in kept.items() if nodes or name in state.saved}
        try:
            self._store.disown(state.name, node, forgotten)
        except SaveError as error:
            self._log.error(str(error))

    def _idempotent(self, asked: ChangeRequest, carry_out: Callable[[], ParameterValues]) -> ParameterValues:
        """Carry a request out, unless it was already under its id: then give the same answer."""
        if not asked.id:
            return carry_out()
        known = self._store.history.reply(asked.id)
        if known is None:
            return carry_out()
        digest, reply = known
        if digest != _digest(asked):
            raise BadInput(f"the request id {asked.id!r} was used for another request: give each its own")
        return _read_reply(reply)

    def _undo(self, asked: UndoParameters) -> ParameterValues:
        state = self._find_set(asked.set)
        past, revision = self._store.history, asked.revision
        undoable = past.change(asked.set, revision) if revision else past.undoable(asked.set)
        if undoable is None:
            which = f" that made revision {revision}" if revision else ""
            raise BadInput(f"{asked.set}: there is no change{which} to take back")
        if undoable.undone:
            return state.to_message(0, [f"revision {revision} is taken back already"])
        change = plan_undo(state, undoable.patch, undoable.run)
        return self._apply(change, asked, "undo", undoable.id)

    def _apply(self, change: Change, asked: ChangeRequest, kind: str, undoes: int | None = None) -> ParameterValues:
        """Write, then count, then tell, then answer."""
        level = changed_levels(change.before, change.after)
        reply = change.after.to_message(level, change.notes)
        _check_size(reply, UPDATES.largest)
        if change.names:
            request = (asked.id, _digest(asked), encode(reply)) if asked.id else None
            self._change_log.log_request(RequestedChange(change, kind, asked.who, request, undoes))
            self._commit(change)
        return reply

    def _commit(self, change: Change) -> None:
        self._sets[change.after.name] = change.after
        self._publish(change.after.to_message(changed_levels(change.before, change.after), change.notes))
        self._forget(change.after)


def _check_size(record: ParameterSchema | ParameterValues, largest: int) -> None:
    """Raise BadInput for what its readers would refuse."""
    if (size := len(encode(record))) > largest:
        raise BadInput(f"{record.set} would be told in {size} bytes, {largest} is the most; nothing was changed")


def _digest(asked: Message) -> str:
    return hashlib.blake2b(asked.ROS_TYPE.encode() + encode(asked), digest_size=16).hexdigest()
