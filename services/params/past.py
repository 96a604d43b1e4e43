"""The past in the file: changes that can be seen and taken back, replies that can be given again, and how many stay."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import NamedTuple

import msgspec

from messages.parameters import ParameterChange
from services.params.change import Back

KEPT_REQUESTS = 4096
"""Replies kept for who asks again; a retry comes within seconds."""
KEPT_CHANGES = 50_000
"""Changes kept, of all sets together; older ones can neither be seen nor taken back."""
KEPT_BYTES = 32 << 20
"""Bytes of replies, and of changes, that are kept; the oldest go first."""
_LOOK_WRITES, _LOOK_BYTES = 256, KEPT_BYTES // 8
"""Writes, or bytes written, after which the file is looked through for what is too old to keep."""


class Undoable(NamedTuple):
    """A change that an undo may take back, or has ``undone`` already."""

    id: int
    back: Back
    run: bool
    undone: bool


class Past:
    """What the tables of history and requests hold. Who adds to them reports it here, and at times they are pruned."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self._writes = self._bytes = 0
        self._run_since = 0

    def new_run(self) -> None:
        """What was set for a run before now is no longer what an undo brings back."""
        (self._run_since,) = self._db.execute("SELECT coalesce(max(id), 0) FROM history").fetchone()

    def reply(self, request: str) -> tuple[str, bytes] | None:
        """Digest and reply of a request that was carried out under this id."""
        found: tuple[str, bytes] | None = self._db.execute(
            "SELECT digest, reply FROM requests WHERE id = ?", (request,)
        ).fetchone()
        return found

    def history(self, name: str, limit: int) -> Iterator[ParameterChange]:
        """The newest changes of a set, or of all for an empty name."""
        rows = self._db.execute(
            """SELECT change, undone FROM history WHERE ?1 = '' OR "set" = ?1 ORDER BY id DESC LIMIT ?2""",
            (name, limit),
        )
        for change, undone in rows:
            yield msgspec.structs.replace(msgspec.json.decode(change, type=ParameterChange), undone=bool(undone))

    def revision(self, name: str) -> int:
        """The revision that the newest change of a set made; 0 for a set without a past."""
        row = self._db.execute(
            'SELECT change FROM history WHERE "set" = ? ORDER BY id DESC LIMIT 1', (name,)
        ).fetchone()
        return 0 if row is None else msgspec.json.decode(row[0], type=ParameterChange).revision

    def undoable(self, name: str) -> Undoable | None:
        """The newest change of a set that was not taken back yet."""
        row = self._db.execute(
            'SELECT id, back, run, undone FROM history WHERE "set" = ? AND lasting AND NOT undone '
            "ORDER BY id DESC LIMIT 1",
            (name,),
        ).fetchone()
        return None if row is None else self._undoable(*row)

    def change(self, name: str, revision: int) -> Undoable | None:
        """The change of a set that made a revision, without what later changes that still count have touched."""
        touched: set[str] = set()
        rows = self._db.execute(
            'SELECT change, id, back, run, undone FROM history WHERE "set" = ? AND lasting ORDER BY id DESC', (name,)
        )
        for change, number, text, run, undone in rows:
            made = msgspec.json.decode(change, type=ParameterChange).revision
            if made <= revision:
                return self._undoable(number, text, run, undone, touched) if made == revision else None
            if not undone:
                touched.update(msgspec.json.decode(text, type=Back).names)
        return None

    def grown(self, size: int) -> None:
        """A write has added so many bytes; within its transaction, what is too old to keep may go."""
        self._writes, self._bytes = self._writes + 1, self._bytes + size
        if self._writes >= _LOOK_WRITES or self._bytes >= _LOOK_BYTES:
            self.prune()

    def prune(self) -> None:
        """Forget the oldest changes and replies beyond what is kept."""
        self._writes = self._bytes = 0
        for table, key, size, most in (
            ("requests", "rowid", "length(reply)", KEPT_REQUESTS),
            ("history", "id", "length(change) + length(back)", KEPT_CHANGES),
        ):
            self._db.execute(
                f"""DELETE FROM {table} WHERE {key} <= coalesce((SELECT max(number) FROM (
                    SELECT {key} AS number, row_number() OVER newest AS place, sum({size}) OVER newest AS bytes
                    FROM {table} WINDOW newest AS (ORDER BY {key} DESC)
                ) WHERE place > ? OR bytes > ?), 0)""",
                (most, KEPT_BYTES),
            )

    def _undoable(self, number: int, text: str, run: int, undone: int, touched: Collection[str] = ()) -> Undoable:
        back = msgspec.json.decode(text, type=Back)
        names = tuple(each for each in back.names if each not in touched)
        before = {} if number <= self._run_since else back.run
        return Undoable(number, replace(back, names=names, run=before), bool(run), bool(undone))
