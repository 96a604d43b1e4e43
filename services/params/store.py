"""The SQLite store of the parameter service: saved values, the history of changes, and replies to requests."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages.parameters import ParameterChange, Value
from services.params.changes import Change, UndoPatch
from services.params.database_file import SCHEMA, connect, locked
from services.runtime.errors import BadInput, EleaError

MEMORY = ":memory:"
"""File name that keeps values in memory only, like an empty one."""
KEPT_REQUESTS = 4096
"""Maximum replies kept for clients that repeat a request; a retry follows within seconds."""
KEPT_CHANGES = 50_000
"""Maximum changes kept of all sets together; older ones can be neither listed nor undone."""
KEPT_BYTES = 32 << 20
"""Maximum bytes of kept replies, and of kept changes; the oldest are deleted first."""
_PRUNE_WRITES, _PRUNE_BYTES = 256, KEPT_BYTES // 8
"""Writes, or bytes written, between two deletions of old entries."""

_read_value = msgspec.json.Decoder(Value).decode


class SaveError(EleaError):
    """A change could not be written, and is not applied."""


class Undoable(NamedTuple):
    """A change that an undo may revert, or has reverted already (``undone``)."""

    id: int
    patch: UndoPatch
    run: bool
    undone: bool


class RequestReply(NamedTuple):
    """A completed request: its id, a digest of its content, and the reply."""

    id: str
    digest: str
    reply: bytes


@contextmanager
def open_store(file: str) -> Iterator[Store]:
    """Open the store in a file, or in memory if none is named; raises BadInput if the file cannot be used."""
    if file in ("", MEMORY):
        connection = sqlite3.connect(MEMORY, isolation_level=None)
        connection.executescript(SCHEMA)
        yield Store(connection)
        return
    path = Path(file).expanduser().resolve()
    with locked(path):
        try:
            connection = connect(path)
        except sqlite3.Error as error:
            raise BadInput(
                f"cannot use the parameter file {path}: {error}: is its folder, where its log is written, read-only?"
            ) from None
        try:
            store = Store(connection)
            store.forget_run()
            yield store
        finally:
            connection.close()


class Store:
    """Reads and writes the tables; a change is on the disk when ``write`` returns.

    After each commit, the write-ahead log is moved into the file and emptied before the request is answered: all
    acknowledged changes are in the file itself, so none is lost with a damaged log. This costs 0.5 ms.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self._writes = self._bytes = 0
        self._run_since = 0

    def saved(self) -> dict[str, dict[str, Value]]:
        """Return the saved values of all sets, in the order in which they were first set."""
        found: dict[str, dict[str, Value]] = {}
        for where, name, value in self._db.execute('SELECT "set", name, value FROM saved ORDER BY rowid'):
            found.setdefault(where, {})[name] = _read_value(value)
        return found

    def reply(self, request: str) -> RequestReply | None:
        """Return the completed request with this id, or None."""
        row = self._db.execute("SELECT id, digest, reply FROM requests WHERE id = ?", (request,)).fetchone()
        return None if row is None else RequestReply(*row)

    def changes(self, name: str, limit: int) -> Iterator[ParameterChange]:
        """Yield the newest changes of a set, or of all sets for an empty name."""
        rows = self._db.execute(
            """SELECT change, undone FROM history WHERE ?1 = '' OR "set" = ?1 ORDER BY id DESC LIMIT ?2""",
            (name, limit),
        )
        for change, undone in rows:
            yield msgspec.structs.replace(_read_change(change), undone=bool(undone))

    def revision(self, name: str) -> int:
        """Return the revision made by the newest change of a set; 0 for a set without a history."""
        row = self._db.execute(
            'SELECT change FROM history WHERE "set" = ? ORDER BY id DESC LIMIT 1', (name,)
        ).fetchone()
        return 0 if row is None else _read_change(row[0]).revision

    def last_undoable(self, name: str) -> Undoable | None:
        """Return the newest change of a set that was not undone yet, or None."""
        row = self._db.execute(
            'SELECT id, back, run, undone FROM history WHERE "set" = ? AND lasting AND NOT undone '
            "ORDER BY id DESC LIMIT 1",
            (name,),
        ).fetchone()
        return None if row is None else self._undoable(*row)

    def undoable(self, name: str, revision: int) -> Undoable | None:
        """Return the change of a set that made a revision, without the parameters changed since; None if unknown."""
        touched: set[str] = set()
        rows = self._db.execute(
            'SELECT change, id, back, run, undone FROM history WHERE "set" = ? AND lasting ORDER BY id DESC', (name,)
        )
        for change, number, back, run, undone in rows:
            made = _read_change(change).revision
            if made <= revision:
                return self._undoable(number, back, run, undone, touched) if made == revision else None
            if not undone:
                touched.update(_read_patch(back).names)
        return None

    def write(
        self,
        change: Change,
        record: ParameterChange,
        *,
        undoable: bool,
        undoes: int | None = None,
        request: RequestReply | None = None,
    ) -> None:
        """Write a change in one transaction.

        Args:
            change: The set before and after.
            record: Its entry in the history.
            undoable: Whether an undo may revert it.
            undoes: The id of the change that it reverts, if it is an undo.
            request: The request that caused it, kept for clients that repeat it.

        Raises:
            SaveError: It could not be written; nothing of it is saved.
        """
        with self._transaction(record.set):
            self._write_saved(change)
            if undoes is not None:
                self._db.execute("UPDATE history SET undone = 1 WHERE id = ?", (undoes,))
            texts = (
                record.set,
                msgspec.json.encode(record).decode(),
                msgspec.json.encode(change.undo_patch).decode(),
            )
            self._db.execute(
                'INSERT INTO history ("set", change, back, run, lasting) VALUES (?, ?, ?, ?, ?)',
                (*texts, record.run, undoable),
            )
            if request is not None:
                self._db.execute("INSERT INTO requests VALUES (?, ?, ?, ?)", (*request, record.run))
            self._note_written(sum(map(len, texts)) + (len(request.reply) if request is not None else 0))

    def forget_run(self) -> None:
        """End a run: its run-only changes can no longer be undone, and their replies are deleted; raises SaveError."""
        with self._transaction("the end of a run"):
            self._db.execute("UPDATE history SET lasting = 0 WHERE run AND lasting")
            self._db.execute("DELETE FROM requests WHERE run")
            self._prune()
        (self._run_since,) = self._db.execute("SELECT coalesce(max(id), 0) FROM history").fetchone()

    @contextmanager
    def _transaction(self, what: str) -> Iterator[None]:
        """Run one transaction, which is on the disk at its end; raises SaveError after rolling it back."""
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            raise SaveError(
                f"{what}: not saved ({error}), so nothing was changed: is the disk full or read-only?"
            ) from None
        finally:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
        self._checkpoint()

    def _checkpoint(self) -> None:
        """Empty the write-ahead log. If that fails, the change is still durable in the log."""
        try:
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        except sqlite3.OperationalError:
            return

    def _write_saved(self, change: Change) -> None:
        name, before, after = change.after.name, change.before.saved, change.after.saved
        for parameter in before.keys() - after.keys():
            self._db.execute('DELETE FROM saved WHERE "set" = ? AND name = ?', (name, parameter))
        for parameter, value in after.items():
            text = json.dumps(value, allow_nan=False)
            if parameter not in before or json.dumps(before[parameter], allow_nan=False) != text:
                self._db.execute(
                    'INSERT INTO saved VALUES (?, ?, ?) ON CONFLICT ("set", name) DO UPDATE SET value = excluded.value',
                    (name, parameter, text),
                )

    def _note_written(self, size: int) -> None:
        self._writes, self._bytes = self._writes + 1, self._bytes + size
        if self._writes >= _PRUNE_WRITES or self._bytes >= _PRUNE_BYTES:
            self._prune()

    def _prune(self) -> None:
        """Delete the oldest changes and replies beyond the limits."""
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

    def _undoable(self, number: int, back: str, run: int, undone: int, touched: Collection[str] = ()) -> Undoable:
        patch = _read_patch(back)
        names = tuple(each for each in patch.names if each not in touched)
        before = {} if number <= self._run_since else patch.run
        return Undoable(number, replace(patch, names=names, run=before), bool(run), bool(undone))


def _read_change(text: str) -> ParameterChange:
    return msgspec.json.decode(text, type=ParameterChange)


def _read_patch(text: str) -> UndoPatch:
    return msgspec.json.decode(text, type=UndoPatch)
