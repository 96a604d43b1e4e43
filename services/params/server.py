"""The parameter server: keeps all sets, answers requests, and saves every change before it is applied."""

from __future__ import annotations

import hashlib
import math
import time
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Literal

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
from services.params.changes import Change, apply_announcement, plan_new_run, plan_reset, plan_set, plan_undo
from services.params.schema import ParameterConflict, SetState, changed_levels, validate_announcement
from services.params.store import RequestReply, SaveError, Store
from services.runtime.errors import BadInput, unknown_name
from services.runtime.log import Log

MAX_SETS = 1000
"""Maximum sets that a node has announced or that have saved values."""
MAX_NODES = 100
"""Maximum nodes that share a set."""
MAX_BYTES = 64 << 20
"""Maximum bytes of all kept announcements: 6,000 robot bases."""
MAX_LIST_BYTES = 6 << 20
"""Maximum bytes of one reply about all sets; a link carries messages of up to 8 MiB."""
MAX_DROPPED = 100
"""Maximum announcements of dead nodes dropped at once: each removal is published."""
LIVENESS_PERIOD_S = 5.0
"""Wall time [s] between two checks for dead nodes when a limit is reached."""
MAX_HISTORY_BYTES = 2 << 20
"""Maximum bytes of one reply about the history."""
_read_reply = decoder(ParameterValues)

Publish = Callable[[ParameterSchema | ParameterValues], None]
ChangeRequest = SetParameters | ResetParameters | UndoParameters
Kind = Literal["set", "load", "reset", "undo", "migrated"]


class ParameterServer:
    """All parameter sets, and the only place that changes them.

    A change is first saved, then applied, published and answered. A set that no node announces any longer and that has
    no saved values is removed; its history stays.

    Args:
        store: The saved values and the history.
        publish: Publishes a set's schema or values.
        log: The node's log.
        now: Returns the simulation time [ns].
        live_nodes: Returns the names of the nodes on the network.
        unpublish: Closes the publishers of a set.
    """

    def __init__(
        self,
        store: Store,
        publish: Publish,
        log: Log,
        now: Callable[[], int],
        live_nodes: Callable[[], Collection[str]],
        unpublish: Callable[[str], None],
    ) -> None:
        self._store, self._publish, self._log, self._now = store, publish, log, now
        self._live_nodes, self._unpublish = live_nodes, unpublish
        self._sets = {
            name: SetState(name, saved=values, revision=store.revision(name)) for name, values in store.saved().items()
        }
        self._sizes: dict[str, dict[str, int]] = {}
        self._last_liveness_check = -math.inf

    @property
    def announced_sets(self) -> set[str]:
        """The names of announced sets, and of nodes that have announced exactly one set."""
        sets = {name for name, state in self._sets.items() if state.schema.announced}
        nodes = Counter(node for name in sets for node in self._sets[name].schema.announced)
        return sets | {node for node, count in nodes.items() if count == 1}

    def announce(self, asked: Announcement) -> ParameterValues:
        """Add a node's parameters to a set and return the effective values; raises BadInput if they do not fit."""
        if asked.leaves:
            return self._remove_node(self._find_set(asked.set).name, asked.node)
        asked = validate_announcement(asked)
        size = len(encode(asked))
        self._make_room(asked, size)
        state = self._sets.get(asked.set) or self._restored_set(asked.set) or SetState(asked.set)
        result = apply_announcement(state, self._with_announcement(state, asked), asked)
        after = result.state
        _check_size(after.schema.to_message(asked.set), DESCRIPTIONS.largest)
        _check_size(after.to_message(notes=result.notes), UPDATES.largest)
        self._sizes.setdefault(asked.set, {})[asked.node] = size
        self._sets[asked.set] = after
        for text in result.warnings:
            self._log.warn(f"{asked.set}: {text}")
        for text in result.waiting:
            self._log.info(f"{asked.set}: {text}")
        if result.migrated:
            self._try_write(Change(state, after, result.migrated), "migrated", asked.node)
        if result.schema_changed:
            self._publish(after.schema.to_message(asked.set))
        if result.values_changed:
            level = changed_levels(state, after) if state.schema.announced else after.to_message().level
            self._publish(after.to_message(level, result.notes))
        return after.to_message(notes=result.notes)

    def list(self, asked: Empty) -> ParameterSets:
        """Return all sets; one that no node has announced has no nodes and no parameters. Raises BadInput."""
        if (size := sum(sum(each.values()) for each in self._sizes.values())) > MAX_LIST_BYTES:
            raise BadInput(
                f"{len(self._sets)} sets of {size} bytes: an answer has at most {MAX_LIST_BYTES}; "
                f"each set is described on a topic of its own, SET/{DESCRIPTIONS.name.removeprefix('~')}"
            )
        shown = sorted(self._sets.values(), key=lambda state: state.name)
        return ParameterSets(sets=tuple(each.schema.to_message(each.name) for each in shown))

    def get(self, asked: ParameterSet) -> ParameterValues:
        """Return the effective values of a set."""
        state = self._find_set(asked.set)
        notes = [f"{name} is saved, but no running node has such a parameter" for name in state.unannounced()]
        if not state.schema.announced:
            notes = ["no running service has announced this set: these are its saved values"]
        return state.to_message(notes=notes)

    def set(self, asked: SetParameters) -> ParameterValues:
        """Set parameters, all or none."""
        return self._idempotent(
            asked, lambda: self._apply(plan_set(self._find_set(asked.set), asked), asked, asked.kind)
        )

    def reset(self, asked: ResetParameters) -> ParameterValues:
        """Reset parameters to their values without ``set``."""
        return self._idempotent(
            asked, lambda: self._apply(plan_reset(self._find_set(asked.set), asked), asked, "reset")
        )

    def undo(self, asked: UndoParameters) -> ParameterValues:
        """Revert the newest change, or the one that made a revision."""
        return self._idempotent(asked, lambda: self._undo(asked))

    def history(self, asked: HistoryOf) -> ParameterHistory:
        """Return the changes, newest first, as many as fit into one reply."""
        name = self._find_set(asked.set).name if asked.set else ""
        changes, size = [], 0
        for each in self._store.changes(name, asked.limit):
            size += len(encode(each))
            if size > MAX_HISTORY_BYTES:
                break
            changes.append(each)
        return ParameterHistory(changes=tuple(changes))

    def new_run(self) -> None:
        """Drop the run values after a reset of the simulation."""
        for state in list(self._sets.values()):
            change = plan_new_run(state)
            if change is not None:
                self._commit(change)
                self._try_write(change, "reset", "a new run")
        try:
            self._store.forget_run()
        except SaveError as error:
            self._log.error(str(error))

    def _find_set(self, name: str) -> SetState:
        """Return the set with this name, or that of the node with this name; raises BadInput."""
        state = self._sets.get(name) or self._restored_set(name)
        if state is not None:
            return state
        of_node = [each for each in self._sets.values() if name in each.schema.announced]
        if len(of_node) == 1:
            return of_node[0]
        if of_node:
            raise BadInput(f"{name} has several sets: which one? {', '.join(sorted(each.name for each in of_node))}")
        raise unknown_name("set of parameters", name, self._sets)

    def _restored_set(self, name: str) -> SetState | None:
        """Return a set known only by its history, continuing its revisions so that each identifies one change."""
        revision = self._store.revision(name)
        return SetState(name, revision=revision) if revision else None

    def _make_room(self, asked: Announcement, size: int) -> None:
        """Raise BadInput if an announcement exceeds the limits, after dropping the nodes that died without leaving.

        They are dropped only then: a set must not lose its values because a link was down for a moment.
        """
        reason = self._no_room_reason(asked, size)
        if reason and time.monotonic() - self._last_liveness_check > LIVENESS_PERIOD_S:
            live = {*self._live_nodes(), asked.node}
            announced = [(name, node) for name, state in self._sets.items() for node in state.schema.announced]
            for name, node in [each for each in announced if each[1] not in live][:MAX_DROPPED]:
                self._remove_node(name, node)
            self._last_liveness_check = time.monotonic()
            reason = self._no_room_reason(asked, size)
        if reason:
            raise BadInput(f"{asked.set}: {reason}")

    def _no_room_reason(self, asked: Announcement, size: int) -> str:
        """Return which limit an announcement exceeds, as an error text; empty if none."""
        state = self._sets.get(asked.set)
        if state is None and len(self._sets) >= MAX_SETS:
            idle = sum(not each.schema.announced for each in self._sets.values())
            return (
                f"there are {MAX_SETS} sets of parameters, the most that are kept; {idle} of them hold only "
                "saved values of nodes that are not running: ./elea param reset SET forgets them"
            )
        nodes = state.schema.announced if state is not None else {}
        if asked.node not in nodes and len(nodes) >= MAX_NODES:
            return f"{MAX_NODES} nodes share it, which is the limit"
        kept = sum(sum(each.values()) for each in self._sizes.values())
        if kept + size - self._sizes.get(asked.set, {}).get(asked.node, 0) > MAX_BYTES:
            return f"the descriptions of all sets have {kept} bytes, the limit is {MAX_BYTES}"
        return ""

    def _with_announcement(self, state: SetState, asked: Announcement) -> SetState:
        """Return the set with the node's announcement; in a conflict with a node that is gone, the new one wins."""
        while True:
            try:
                return replace(state, schema=state.schema.with_node(asked))
            except ParameterConflict as conflict:
                if conflict.other_node in self._live_nodes():
                    raise
                self._log.info(f"{asked.set}: {conflict.other_node} is gone, its announcement is dropped")
                state = replace(state, schema=state.schema.without_node(conflict.other_node))

    def _remove_node(self, name: str, node: str) -> ParameterValues:
        """Remove a node that has left a set. Saved values stay; run values that no other node has are dropped."""
        state = self._find_set(name)
        if node not in state.schema.announced:
            return state.to_message()
        schema = state.schema.without_node(node)
        run = {each: value for each, value in state.run.items() if each in schema.parameters}
        left = self._sets[name] = replace(state, schema=schema, run=run, revision=state.revision + 1)
        self._sizes.get(name, {}).pop(node, None)
        self._publish(schema.to_message(name))
        self._publish(left.to_message(changed_levels(state, left), [f"{node} has left this set"]))
        self._forget(left)
        return left.to_message()

    def _forget(self, state: SetState) -> None:
        """Remove a set that no node announces and that has no saved values."""
        if state.schema.announced or state.saved or self._sets.get(state.name) is not state:
            return
        for known in (self._sets, self._sizes):
            known.pop(state.name, None)
        self._unpublish(state.name)

    def _idempotent(self, asked: ChangeRequest, carry_out: Callable[[], ParameterValues]) -> ParameterValues:
        """Carry out a request once per id; a repeated one gets the same reply."""
        known = self._store.reply(asked.id) if asked.id else None
        if known is None:
            return carry_out()
        if known.digest != _digest(asked):
            raise BadInput(f"the request id {asked.id!r} was used for another request: give each its own")
        return _read_reply(known.reply)

    def _undo(self, asked: UndoParameters) -> ParameterValues:
        state, revision = self._find_set(asked.set), asked.revision
        name = state.name
        undoable = self._store.undoable(name, revision) if revision else self._store.last_undoable(name)
        if undoable is None:
            which = f" that made revision {revision}" if revision else ""
            raise BadInput(f"{name}: there is no change{which} to undo")
        if undoable.undone:
            return state.to_message(0, [f"revision {revision} is undone already"])
        change = plan_undo(state, undoable.patch, undoable.run)
        return self._apply(change, asked, "undo", undoable.id)

    def _apply(self, change: Change, asked: ChangeRequest, kind: Kind, undoes: int | None = None) -> ParameterValues:
        """Save a change, apply and publish it, and return the reply."""
        after = change.after
        reply = after.to_message(changed_levels(change.before, after), change.notes)
        _check_size(reply, UPDATES.largest)
        if after.unannounced():
            _check_size(SetState(after.name, saved=after.saved).to_message(), UPDATES.largest)
        if change.names:
            request = RequestReply(asked.id, _digest(asked), encode(reply)) if asked.id else None
            self._write(change, kind, asked.who, undoable=kind != "undo", undoes=undoes, request=request)
            self._commit(change)
        return reply

    def _commit(self, change: Change) -> None:
        self._sets[change.after.name] = change.after
        self._publish(change.after.to_message(changed_levels(change.before, change.after), change.notes))
        self._forget(change.after)

    def _write(
        self,
        change: Change,
        kind: Kind,
        who: str,
        *,
        undoable: bool = False,
        undoes: int | None = None,
        request: RequestReply | None = None,
    ) -> None:
        """Save a change with its entry in the history; raises SaveError."""
        before, after = change.before, change.after
        record = ParameterChange(
            set=after.name,
            revision=after.revision,
            kind=kind,
            who=who,
            wall_time=time.time_ns(),
            sim_time=Time.of(self._now()),
            before=tuple(Assignment(name=name, value=before.parameter(name).value) for name in change.names),
            after=tuple(Assignment(name=name, value=after.parameter(name).value) for name in change.names),
            run=change.run,
        )
        self._store.write(change, record, undoable=undoable, undoes=undoes, request=request)

    def _try_write(self, change: Change, kind: Kind, who: str) -> None:
        """Save a change that is applied even if it cannot be saved; the next start repeats it."""
        try:
            self._write(change, kind, who)
        except SaveError as error:
            self._log.error(f"{change.after.name}: {error}")


def _check_size(record: ParameterSchema | ParameterValues, largest: int) -> None:
    """Raise BadInput for a message too large for its subscribers."""
    if (size := len(encode(record))) > largest:
        raise BadInput(
            f"{record.set} would have {size} bytes in a message, the limit is {largest}; nothing was changed"
        )


def _digest(asked: Message) -> str:
    return hashlib.blake2b(asked.ROS_TYPE.encode() + encode(asked), digest_size=16).hexdigest()
