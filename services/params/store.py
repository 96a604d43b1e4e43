"""What outlives the parameter service: saved values, revisions, history and the replies to requests, in SQLite."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages.parameters import ParameterChange, Value
from services.params.change import Back
from services.params.file import claimed, connect
from services.params.past import Past
from services.params.tables import SCHEMA, read_value, seal, write_value
from services.runtime.errors import BadInput, EleaError

MEMORY = ":memory:"
KEPT_SETS = 1000
"""Sets of earlier runs whose revisions go on when they come again."""


class NotSaved(EleaError):
    """A change could not be written; it does not count."""


class Kept(NamedTuple):
    """What is known of a set at the start: its revision, saved values, and who had which parameter."""

    revision: int
    saved: Mapping[str, Value]
    owners: Mapping[str, frozenset[str]]


@dataclass(frozen=True)
class Entry:
    """One change as it is written, all of it or nothing. ``saved`` has None for what is no longer saved.

    ``owner`` is the node that announced the parameters ``owned``; ``request`` the id, digest and reply of who asked.
    """

    set: str
    revision: int
    saved: Mapping[str, str | None] = field(default_factory=dict)
    change: ParameterChange | None = None
    back: Back | None = None
    lasting: bool = False
    undoes: int | None = None
    request: tuple[str, str, bytes] | None = None
    run: bool = False
    owner: str = ""
    owned: tuple[str, ...] = ()


@contextmanager
def opened(file: str) -> Iterator[Store]:
    """The store in a file, or in memory when none is named; raises BadInput for a file that is not fit."""
    if file in ("", MEMORY):
        connection = sqlite3.connect(MEMORY, isolation_level=None)
        connection.executescript(SCHEMA)
        yield Store(connection)
        return
    path = Path(file).expanduser().resolve()
    with claimed(path):
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
        self.past = Past(connection)

    def sets(self) -> dict[str, Kept]:
        """All sets that were ever changed or announced."""
        kept = {name: Kept(revision, {}, {}) for name, revision in self._db.execute("SELECT name, revision FROM sets")}
        saved: dict[str, dict[str, Value]] = {}
        owners: dict[str, dict[str, frozenset[str]]] = {}
        for where, name, value in self._db.execute('SELECT "set", name, value FROM saved ORDER BY rowid'):
            saved.setdefault(where, {})[name] = read_value(value)
        for where, name, node in self._db.execute('SELECT "set", name, node FROM owners'):
            known = owners.setdefault(where, {})
            known[name] = known.get(name, frozenset()) | {node}
        return {name: Kept(each.revision, saved.get(name, {}), owners.get(name, {})) for name, each in kept.items()}

    def write(self, entry: Entry) -> None:
        """Write a change; raises NotSaved, and then nothing of it counts."""
        with self._whole(entry.set):
            self._write(entry)

    def forget(self, name: str) -> None:
        """Forget a set of which nothing is saved, but not its past; raises NotSaved."""
        with self._whole(name):
            self._db.execute("DELETE FROM sets WHERE name = ?", (name,))
            self._db.execute('DELETE FROM owners WHERE "set" = ?', (name,))

    def disown(self, name: str, node: str, nodes: Collection[str]) -> None:
        """Forget which parameters of a set ``node`` had, but for those that are saved, and all that ``nodes`` had."""
        with self._whole(name):
            self._db.execute(
                'DELETE FROM owners WHERE "set" = ?1 AND node = ?2 '
                'AND name NOT IN (SELECT name FROM saved WHERE "set" = ?1)',
                (name, node),
            )
            self._db.executemany('DELETE FROM owners WHERE "set" = ? AND node = ?', ((name, each) for each in nodes))

    def forget_oldest(self) -> None:
        """Of the sets of which nothing is saved, keep the last that were announced: what a run ended with is not left,
        and each run may have names of its own."""
        with self._whole("sets of earlier runs"):
            self._db.execute(
                'DELETE FROM sets WHERE name NOT IN (SELECT "set" FROM saved) AND rowid <= coalesce('
                "(SELECT rowid FROM sets ORDER BY rowid DESC LIMIT 1 OFFSET ?), 0)",
                (KEPT_SETS,),
            )
            self._db.execute('DELETE FROM owners WHERE "set" NOT IN (SELECT name FROM sets)')

    def forget_run(self) -> None:
        """What was for one run alone is over: it is neither taken back nor counted as carried out."""
        with self._whole("the end of a run"):
            self._db.execute("UPDATE history SET lasting = 0 WHERE run AND lasting")
            self._db.execute("DELETE FROM requests WHERE run")
            self.past.prune()
        self.past.new_run()

    def progress(self, run: str, epoch: int) -> frozenset[int]:
        """The numbers of the scheduled changes that this run has had since its last reset."""
        row = self._db.execute("SELECT done FROM progress WHERE run = ? AND epoch = ?", (run, epoch)).fetchone()
        return frozenset() if row is None else msgspec.json.decode(row[0], type=frozenset[int])

    def proceed(self, run: str, epoch: int, done: frozenset[int]) -> None:
        """Note the scheduled changes that this run has had; raises NotSaved."""
        row = (run, epoch, msgspec.json.encode(sorted(done)).decode())
        with self._whole("the progress of a run"):
            self._db.execute("DELETE FROM progress")
            self._db.execute("INSERT INTO progress VALUES (?, ?, ?, ?)", (*row, seal(*row)))

    @contextmanager
    def _whole(self, what: str) -> Iterator[None]:
        """One transaction, on the disk at the end; raises NotSaved, and then nothing of it counts."""
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            raise NotSaved(
                f"{what}: not saved ({error}), so nothing was changed: is the disk full or read-only?"
            ) from None
        finally:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
        self._into_file()

    def _write(self, entry: Entry) -> None:
        db, name, size = self._db, entry.set, 0
        values = (name, entry.revision)
        db.execute("INSERT OR REPLACE INTO sets VALUES (?, ?, ?)", (*values, seal(*values)))
        for parameter, text in entry.saved.items():
            if text is None:
                db.execute('DELETE FROM saved WHERE "set" = ? AND name = ?', (name, parameter))
            else:
                row = (name, parameter, text)
                db.execute(
                    'INSERT INTO saved VALUES (?, ?, ?, ?) ON CONFLICT ("set", name) '
                    "DO UPDATE SET value = excluded.value, seal = excluded.seal",
                    (*row, seal(*row)),
                )
        if entry.owner:
            db.execute('DELETE FROM owners WHERE "set" = ? AND node = ?', (name, entry.owner))
            for parameter in entry.owned:
                row = (name, parameter, entry.owner)
                db.execute("INSERT INTO owners VALUES (?, ?, ?, ?)", (*row, seal(*row)))
        if entry.undoes is not None:
            db.execute("UPDATE history SET undone = 1 WHERE id = ?", (entry.undoes,))
        if entry.change is not None:
            back = entry.back or Back((), {}, {})
            texts = (name, msgspec.json.encode(entry.change).decode(), msgspec.json.encode(back).decode())
            db.execute(
                'INSERT INTO history ("set", change, back, run, lasting, seal) VALUES (?, ?, ?, ?, ?, ?)',
                (*texts, entry.run, entry.lasting, seal(*texts)),
            )
            size += sum(map(len, texts))
        if entry.request is not None:
            asked = (*entry.request, int(entry.run))
            db.execute("INSERT INTO requests VALUES (?, ?, ?, ?, ?)", (*asked, seal(*asked)))
            size += len(entry.request[2])
        self.past.grown(size)

    def _into_file(self) -> None:
        """Empty the log. If that fails, the change is still durable in the log."""
        try:
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        except sqlite3.OperationalError:
            return


def texts(before: Mapping[str, Value], after: Mapping[str, Value]) -> dict[str, str | None]:
    """What to write so that the saved values ``before`` become those ``after``."""
    written: dict[str, str | None] = {name: None for name in before if name not in after}
    for name, value in after.items():
        text = write_value(value)
        if name not in before or write_value(before[name]) != text:
            written[name] = text
    return written
