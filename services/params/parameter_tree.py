"""The server of the ROS 1 parameter tree: its requests, and the topic on which the tree is published."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from messages.requests import Done
from messages.rosparam import (
    MAX_TREE_BYTES,
    RosparamDelete,
    RosparamGet,
    RosparamKey,
    RosparamNames,
    RosparamSearch,
    RosparamSet,
    RosparamTree,
    RosparamValue,
    RosparamWriter,
)
from messages.std import Bool, Empty
from services.runtime.errors import BadInput, did_you_mean
from services.runtime.parameters.tree import (
    ParameterTree,
    checked_value,
    parse_json,
    same_value,
    split_key,
    value_to_json,
)

MAX_WRITERS = 1000
"""Maximum nodes whose last change is remembered; the one idle for the longest time is forgotten."""
MAX_QUEUED = 10_000
"""Maximum changes that wait for a tick."""


class _Change(NamedTuple):
    """A change that waits for its tick; changes are applied in the order of time, writer and number."""

    time: int
    writer: str
    number: int
    key: str
    value: Any
    deletes: bool
    size: int
    """Characters by which it makes the tree's JSON text longer, at most."""


class ParameterTreeServer:
    """Owns the tree.

    A change with a time waits for the first tick after it: changes of one lockstep tick arrive in any order, and are
    applied in the order of their times and writers. Those of time 0, from before simulation time started, are applied
    at the first tick, even at time 0. Changes without a time are applied at once.

    Args:
        publish: Publishes the tree.
        initial: The values at the start.
    """

    def __init__(self, publish: Callable[[RosparamTree], None], initial: ParameterTree | None = None) -> None:
        self._publish, self._tree = publish, initial or ParameterTree()
        self._revision = 1
        self._dirty = True
        self._writers: dict[str, int] = {}
        self._queue: list[_Change] = []
        self._queued_size = 0

    def set(self, asked: RosparamSet) -> Done:
        """Set a value or branch; raises BadInput."""
        value = checked_value(asked.key, parse_json(asked.key, asked.value))
        if asked.key.strip("/") == "" and not isinstance(value, dict):
            raise BadInput("/: the root of the tree must be a map of names to values")
        size = _text_size(asked.key, value)
        self._check_room(size)
        return self._change(asked, value, f"{asked.key} is set", deletes=False, size=size)

    def delete(self, asked: RosparamDelete) -> Done:
        """Delete a value or branch; raises BadInput."""
        if not asked.key.strip("/"):
            raise BadInput("/: the root of the tree cannot be deleted; set it to {} to empty it")
        if asked.time is None:
            self._find(asked.key)
        return self._change(asked, None, f"{asked.key} is deleted", deletes=True)

    def get(self, asked: RosparamGet) -> RosparamValue:
        """Return a value or branch; raises BadInput."""
        return RosparamValue(
            value=value_to_json(self._find(asked.key)),
            revision=self._revision,
            number=self._writers.get(asked.writer, 0),
        )

    def has(self, asked: RosparamKey) -> Bool:
        """Return whether there is a value or branch."""
        return Bool(data=self._tree.has(asked.key))

    def search(self, asked: RosparamSearch) -> RosparamKey:
        """Return the nearest key from a namespace upwards; empty if there is none."""
        return RosparamKey(key=self._tree.search(asked.namespace, asked.key) or "")

    def names(self, _: Empty) -> RosparamNames:
        """Return the names of all values."""
        return RosparamNames(names=tuple(self._tree.names()))

    def tick(self, now: int, reset: bool) -> None:
        """Apply the changes of times before ``now`` [ns]; after a reset of time, all waiting ones."""
        before = max(now, 1)
        due = sorted((each for each in self._queue if reset or each.time < before), key=lambda each: each[:3])
        self._queue = [] if reset else [each for each in self._queue if each.time >= before]
        self._queued_size = sum(each.size for each in self._queue)
        for each in due:
            self._make(each)
        self.publish_changes()

    def publish_changes(self) -> None:
        """Publish the tree if it has changed since the last publication."""
        if self._dirty:
            self._dirty = False
            writers = tuple(RosparamWriter(node=node, number=number) for node, number in self._writers.items())
            self._publish(RosparamTree(revision=self._revision, tree=self._tree.to_json(), writers=writers))

    def _find(self, key: str) -> Any:
        try:
            return self._tree.get(key)
        except KeyError:
            near = did_you_mean(key, self._tree.names())
            raise BadInput(f"there is no parameter {key}{near}") from None

    def _change(
        self, asked: RosparamSet | RosparamDelete, value: Any, text: str, *, deletes: bool, size: int = 0
    ) -> Done:
        change = _Change(asked.time or 0, asked.writer, asked.number, asked.key, value, deletes, size)
        if asked.time is None:
            self._make(change)
        elif len(self._queue) >= MAX_QUEUED:
            raise BadInput(f"{MAX_QUEUED} parameter changes wait for the next tick: is the simulation paused?")
        else:
            self._queue.append(change)
            self._queued_size += size
        return Done(text=text)

    def _make(self, change: _Change) -> None:
        before = self._tree.get(change.key) if self._tree.has(change.key) else None
        if change.deletes:
            if before is not None:
                self._tree.delete(change.key)
        elif before is None or not same_value(before, change.value):
            self._tree.set_checked(change.key, change.value)
        if change.writer and change.number:
            self._writers.pop(change.writer, None)
            self._writers[change.writer] = change.number
            if len(self._writers) > MAX_WRITERS:
                del self._writers[next(iter(self._writers))]
        self._revision += 1
        self._dirty = True

    def _check_room(self, more: int) -> None:
        """Raise BadInput if ``more`` characters, after the waiting changes, would make the tree too large to be
        published."""
        if (size := self._tree.size() + self._queued_size + more) > MAX_TREE_BYTES:
            raise BadInput(
                f"the parameter tree would have {size} characters, the limit is {MAX_TREE_BYTES}; nothing was changed"
            )


def _text_size(key: str, value: Any) -> int:
    """Return the characters that a value adds to the tree's JSON text, at most."""
    for part in reversed(split_key(key)):
        value = {part: value}
    return len(value_to_json(value))


def read_tree_file(file: str) -> ParameterTree:
    """Read a tree from a JSON file; an empty tree for an empty name. Raises BadInput."""
    if not file:
        return ParameterTree()
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise BadInput(f"rosparam_file {file} cannot be read: {error}") from None
    try:
        return ParameterTree.from_json(text)
    except BadInput as error:
        raise BadInput(f"{file}: {error}") from None
