"""The SQLite store of the parameter service: saved values, revisions, history, and replies to requests."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages.parameters import ParameterChange, Value
from services.params.changes import UndoPatch
from services.params.database_file import SCHEMA, checksum, connect, locked, read_value, write_value
from services.runtime.errors import BadInput, EleaError

KEPT_REQUESTS = 4096
"""Replies kept for who asks again; a retry comes within seconds."""
KEPT_CHANGES = 50_000
"""Changes kept, of all sets together; older ones can neither be seen nor taken back."""
KEPT_BYTES = 32 << 20
"""Bytes of replies, and of changes, that are kept; the oldest go first."""
_PRUNE_WRITES, _PRUNE_BYTES = 256, KEPT_BYTES // 8
"""Writes, or bytes written, after which the file is looked through for what is too old to keep."""


class Undoable(NamedTuple):
    """A change that an undo may take back, or has ``undone`` already."""

    id: int
    patch: UndoPatch
    run: bool
    undone: bool


class History:
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

    def changes(self, name: str, limit: int) -> Iterator[ParameterChange]:
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
                touched.update(msgspec.json.decode(text, type=UndoPatch).names)
        return None

    def note_written(self, size: int) -> None:
        """A write has added so many bytes; within its transaction, what is too old to keep may go."""
        self._writes, self._bytes = self._writes + 1, self._bytes + size
        if self._writes >= _PRUNE_WRITES or self._bytes >= _PRUNE_BYTES:
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
        back = msgspec.json.decode(text, type=UndoPatch)
        names = tuple(each for each in back.names if each not in touched)
        before = {} if number <= self._run_since else back.run
        return Undoable(number, replace(back, names=names, run=before), bool(run), bool(undone))


MEMORY = ":memory:"
KEPT_SETS = 1000
"""Sets of earlier runs whose revisions go on when they come again."""


class SaveError(EleaError):
    """A change could not be written; it does not count."""


class StoredSet(NamedTuple):
    """What is known of a set at the start: its revision, saved values, and who had which parameter."""

    revision: int
    saved: Mapping[str, Value]
    owners: Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class StoreEntry:
    """One change as it is written, all of it or nothing. ``saved`` has None for what is no longer saved.

    ``owner`` is the node that announced the parameters ``owned``; ``request`` the id, digest and reply of who asked.
    """

    set: str
    revision: int
    saved: Mapping[str, str | None] = field(default_factory=dict)
    change: ParameterChange | None = None
    undo_patch: UndoPatch | None = None
    undoable: bool = False
    undoes: int | None = None
    request: tuple[str, str, bytes] | None = None
    run: bool = False
    owner: str = ""
    owned: tuple[str, ...] = ()


@contextmanager
def open_store(file: str) -> Iterator[Store]:
    """The store in a file, or in memory when none is named; raises BadInput for a file that is not fit."""
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
                f"cannot use the file of parameters {path}: {error}: is its folder, where its log lies, read-only?"
            ) from None
        try:
            store = Store(connection)
            store.forget_run()
            store.forget_oldest()
            yield store
        finally:
            connection.close()


class Store:
    """Everything is read once; a change is on the disk when ``write`` returns.

    After each commit the log goes into the file and is emptied before anybody is told: what was acknowledged lies in
    the file itself, and a log that is lost, torn or corrupted can only hold what nobody was told of. It costs 0.5 ms.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self.history = History(connection)

    def sets(self) -> dict[str, StoredSet]:
        """All sets that were ever changed or announced."""
        kept = {
            name: StoredSet(revision, {}, {}) for name, revision in self._db.execute("SELECT name, revision FROM sets")
        }
        saved: dict[str, dict[str, Value]] = {}
        owners: dict[str, dict[str, frozenset[str]]] = {}
        for where, name, value in self._db.execute('SELECT "set", name, value FROM saved ORDER BY rowid'):
            saved.setdefault(where, {})[name] = read_value(value)
        for where, name, node in self._db.execute('SELECT "set", name, node FROM owners'):
            known = owners.setdefault(where, {})
            known[name] = known.get(name, frozenset()) | {node}
        return {
            name: StoredSet(each.revision, saved.get(name, {}), owners.get(name, {})) for name, each in kept.items()
        }

    def write(self, entry: StoreEntry) -> None:
        """Write a change; raises NotSaved, and then nothing of it counts."""
        with self._transaction(entry.set):
            self._write(entry)

    def forget(self, name: str) -> None:
        """Forget a set of which nothing is saved, but not its past; raises NotSaved."""
        with self._transaction(name):
            self._db.execute("DELETE FROM sets WHERE name = ?", (name,))
            self._db.execute('DELETE FROM owners WHERE "set" = ?', (name,))

    def disown(self, name: str, node: str, nodes: Collection[str]) -> None:
        """Forget which parameters of a set ``node`` had, but for those that are saved, and all that ``nodes`` had."""
        with self._transaction(name):
            self._db.execute(
                'DELETE FROM owners WHERE "set" = ?1 AND node = ?2 '
                'AND name NOT IN (SELECT name FROM saved WHERE "set" = ?1)',
                (name, node),
            )
            self._db.executemany('DELETE FROM owners WHERE "set" = ? AND node = ?', ((name, each) for each in nodes))

    def forget_oldest(self) -> None:
        """Of the sets of which nothing is saved, keep the last that were announced: what a run ended with is not left,
        and each run may have names of its own."""
        with self._transaction("sets of earlier runs"):
            self._db.execute(
                'DELETE FROM sets WHERE name NOT IN (SELECT "set" FROM saved) AND rowid <= coalesce('
                "(SELECT rowid FROM sets ORDER BY rowid DESC LIMIT 1 OFFSET ?), 0)",
                (KEPT_SETS,),
            )
            self._db.execute('DELETE FROM owners WHERE "set" NOT IN (SELECT name FROM sets)')

    def forget_run(self) -> None:
        """What was for one run alone is over: it is neither taken back nor counted as carried out."""
        with self._transaction("the end of a run"):
            self._db.execute("UPDATE history SET lasting = 0 WHERE run AND lasting")
            self._db.execute("DELETE FROM requests WHERE run")
            self.history.prune()
        self.history.new_run()

    def load_schedule_position(self, run: str, epoch: int) -> frozenset[int]:
        """The numbers of the scheduled changes that this run has had since its last reset."""
        row = self._db.execute("SELECT done FROM progress WHERE run = ? AND epoch = ?", (run, epoch)).fetchone()
        return frozenset() if row is None else msgspec.json.decode(row[0], type=frozenset[int])

    def save_schedule_position(self, run: str, epoch: int, done: frozenset[int]) -> None:
        """Note the scheduled changes that this run has had; raises NotSaved."""
        row = (run, epoch, msgspec.json.encode(sorted(done)).decode())
        with self._transaction("the progress of a run"):
            self._db.execute("DELETE FROM progress")
            self._db.execute("INSERT INTO progress VALUES (?, ?, ?, ?)", (*row, checksum(*row)))

    @contextmanager
    def _transaction(self, what: str) -> Iterator[None]:
        """One transaction, on the disk at the end; raises NotSaved, and then nothing of it counts."""
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

    def _write(self, entry: StoreEntry) -> None:
        db, name, size = self._db, entry.set, 0
        values = (name, entry.revision)
        db.execute("INSERT OR REPLACE INTO sets VALUES (?, ?, ?)", (*values, checksum(*values)))
        for parameter, text in entry.saved.items():
            if text is None:
                db.execute('DELETE FROM saved WHERE "set" = ? AND name = ?', (name, parameter))
            else:
                row = (name, parameter, text)
                db.execute(
                    'INSERT INTO saved VALUES (?, ?, ?, ?) ON CONFLICT ("set", name) '
                    "DO UPDATE SET value = excluded.value, seal = excluded.seal",
                    (*row, checksum(*row)),
                )
        if entry.owner:
            db.execute('DELETE FROM owners WHERE "set" = ? AND node = ?', (name, entry.owner))
            for parameter in entry.owned:
                row = (name, parameter, entry.owner)
                db.execute("INSERT INTO owners VALUES (?, ?, ?, ?)", (*row, checksum(*row)))
        if entry.undoes is not None:
            db.execute("UPDATE history SET undone = 1 WHERE id = ?", (entry.undoes,))
        if entry.change is not None:
            back = entry.undo_patch or UndoPatch((), {}, {})
            texts = (name, msgspec.json.encode(entry.change).decode(), msgspec.json.encode(back).decode())
            db.execute(
                'INSERT INTO history ("set", change, back, run, lasting, seal) VALUES (?, ?, ?, ?, ?, ?)',
                (*texts, entry.run, entry.undoable, checksum(*texts)),
            )
            size += sum(map(len, texts))
        if entry.request is not None:
            asked = (*entry.request, int(entry.run))
            db.execute("INSERT INTO requests VALUES (?, ?, ?, ?, ?)", (*asked, checksum(*asked)))
            size += len(entry.request[2])
        self.history.note_written(size)

    def _checkpoint(self) -> None:
        """Empty the log. If that fails, the change is still durable in the log."""
        try:
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        except sqlite3.OperationalError:
            return


def changed_rows(before: Mapping[str, Value], after: Mapping[str, Value]) -> dict[str, str | None]:
    """What to write so that the saved values ``before`` become those ``after``."""
    written: dict[str, str | None] = {name: None for name in before if name not in after}
    for name, value in after.items():
        text = write_value(value)
        if name not in before or write_value(before[name]) != text:
            written[name] = text
    return written
