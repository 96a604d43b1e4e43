"""The SQLite file of the parameter service: tables, lock, check for damage, and conversion of format 1."""

from __future__ import annotations

import fcntl
import hashlib
import os
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from services.runtime.atomic_file import fsync_path
from services.runtime.errors import BadInput

APPLICATION_ID = 0x456C6561
"""SQLite application id of these files: ``Elea``."""
FORMAT_VERSION = 2
"""The version of the tables. Files of format 1 are converted when they are opened."""

SCHEMA = f"""
CREATE TABLE saved ("set" TEXT NOT NULL, name TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY ("set", name));
CREATE TABLE history (
    id INTEGER PRIMARY KEY,
    "set" TEXT NOT NULL,
    change TEXT NOT NULL,
    back TEXT NOT NULL,
    run INTEGER NOT NULL CHECK (run IN (0, 1)),
    undone INTEGER NOT NULL DEFAULT 0 CHECK (undone IN (0, 1)),
    lasting INTEGER NOT NULL CHECK (lasting IN (0, 1))
);
CREATE TABLE requests (
    id TEXT NOT NULL PRIMARY KEY, digest TEXT NOT NULL, reply BLOB NOT NULL,
    run INTEGER NOT NULL CHECK (run IN (0, 1))
);
CREATE INDEX saved_copy ON saved ("set", name, value);
CREATE INDEX history_copy ON history ("set", id, change, back, run, undone, lasting);
CREATE INDEX requests_copy ON requests (id, digest, reply, run);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {FORMAT_VERSION};
"""
"""``lasting`` marks the changes that an undo may revert; ``value``, ``change`` and ``back`` are JSON.

The ``_copy`` indexes contain every row a second time. SQLite's integrity check compares both copies, and so detects
damaged values as well as damaged pages.
"""

_OPTIONS = "--params PATH of ./elea up, --param file=PATH of the service"
_HEADER_BYTES = 100
_MAGIC = b"SQLite format 3\0"


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Lock the file against other parameter services and check it; create it first if there is none.

    Raises:
        BadInput: It cannot be written, is in use, is damaged, or is another kind of file. It stays unchanged.
    """
    try:
        if not path.exists():
            _create(path)
        handle = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError as error:
        raise BadInput(
            f"cannot write the parameter file {path} ({error.strerror}): "
            f"name another ({_OPTIONS}), or none to keep values for this run only"
        ) from None
    except sqlite3.Error as error:
        raise BadInput(f"cannot create the parameter file {path} ({error}): is the disk full?") from None
    try:
        _lock(handle, path)
        _check_header(handle, path)
        _check_content(path)
        yield
    finally:
        os.close(handle)


def connect(path: Path) -> sqlite3.Connection:
    """Open a locked file with durable commits, and convert it if it has format 1; raises sqlite3.Error."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, isolation_level=None, timeout=2.0)
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        (mode,) = connection.execute("PRAGMA journal_mode = WAL").fetchone()
        if mode != "wal":
            raise sqlite3.OperationalError(f"its journal is {mode}, not a write-ahead log")
        connection.execute("PRAGMA synchronous = FULL")
        if _format_of(connection) == 1:
            _convert_format_1(connection)
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _create(path: Path) -> None:
    """Create an empty file atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = _log_of(path)
    if log.exists() and log.stat().st_size:
        raise BadInput(f"{path} is gone, but its log {log} is there: put the file back, or move the log away as well")
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        made = Path(folder) / "new"
        with closing(sqlite3.connect(made, isolation_level=None)) as connection:
            connection.executescript(f"PRAGMA journal_mode = WAL; BEGIN; {SCHEMA} COMMIT;")
        fsync_path(made)
        try:
            os.link(made, path)
        except FileExistsError:
            return
    fsync_path(path.parent)


def _lock(handle: int, path: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise BadInput(
            f"another parameter service uses {path}: stop it, or give this one a file of its own ({_OPTIONS})"
        ) from None


def _check_header(handle: int, path: Path) -> None:
    header = os.pread(handle, _HEADER_BYTES, 0)
    if not header:
        raise BadInput(_recovery_advice(path, "is empty: it was truncated"))
    if not header.startswith(_MAGIC[: len(header)]):
        raise BadInput(_recovery_advice(path, "is not a database of parameters, or its beginning was destroyed"))
    if len(header) < _HEADER_BYTES:
        raise BadInput(_recovery_advice(path, f"was truncated to {len(header)} bytes"))
    if (application := int.from_bytes(header[68:72], "big")) != APPLICATION_ID:
        raise BadInput(
            f"{path} is a database of another program (application id {application:#x}): it was left as it is. "
            f"Name a file of its own ({_OPTIONS})"
        )


def _check_content(path: Path) -> None:
    """Raise BadInput for an unknown format or damage.

    The file is opened read-only, and so is its write-ahead log, which a killed service may have left.
    """
    log = _log_of(path)
    view = "mode=ro" if log.exists() and log.stat().st_size else "mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?{view}", uri=True)) as connection:
            version = _format_of(connection)
            damage = _find_damage(connection, version) if version in (1, FORMAT_VERSION) else ""
    except (sqlite3.Error, UnicodeDecodeError) as error:
        version, damage = FORMAT_VERSION, str(error)
    finally:
        path.with_name(f"{path.name}-shm").unlink(missing_ok=True)
    if version not in (1, FORMAT_VERSION):
        raise BadInput(
            f"{path} has format {version}, this Elea knows formats up to {FORMAT_VERSION}: it was left as it is. "
            "Use the version that wrote it (elea param dump), or name another file"
        )
    if damage:
        raise BadInput(_recovery_advice(path, f"is damaged ({damage})"))


def _find_damage(connection: sqlite3.Connection, version: int) -> str:
    """Return a description of the damage, empty for none; raises sqlite3.Error if the file is unreadable."""
    for (text,) in connection.execute("PRAGMA integrity_check(1)"):
        if text != "ok":
            return str(text)
    if version == 1:
        return _find_damage_1(connection)
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(SCHEMA)
        return "" if _tables(connection) == _tables(model) else "its tables are not those of its format"


def _tables(connection: sqlite3.Connection) -> set[tuple[str, str]]:
    """Return the names and definitions of tables and indexes."""
    return set(connection.execute("SELECT name, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite\\_%' ESCAPE '\\'"))


def _format_of(connection: sqlite3.Connection) -> int:
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    return int(version)


def _log_of(path: Path) -> Path:
    return path.with_name(f"{path.name}-wal")


def _recovery_advice(path: Path, what: str) -> str:
    return (
        f"{path} {what}: it was left as it is, nothing was reset. Restore it from a copy, or start without it: "
        f"move {path} and the files whose names begin with it away, then ./elea param load FILE if there is a dump"
    )


_TABLES_1 = {
    "saved": ('"set", name, value', ""),
    "history": ('"set", change, back', ", id, run, undone, lasting"),
    "requests": ("id, digest, reply, run", ""),
}
"""The tables kept from format 1: the columns covered by a row's checksum ``seal``, and the others."""


def _find_damage_1(connection: sqlite3.Connection) -> str:
    connection.create_function("checksum", -1, _checksum_1, deterministic=True)
    for table, (columns, _) in _TABLES_1.items():
        if connection.execute(f"SELECT 1 FROM {table} WHERE seal != checksum({columns}) LIMIT 1").fetchone():
            return f"a row of {table} was changed since it was written"
    return ""


def _checksum_1(*parts: Any) -> str:
    return hashlib.blake2b(repr(parts).encode(), digest_size=8).hexdigest()


def _convert_format_1(connection: sqlite3.Connection) -> None:
    """Convert a file of format 1 in one transaction, keeping its values, history and replies."""
    renamed = "".join(f"ALTER TABLE {table} RENAME TO {table}_1;" for table in _TABLES_1)
    copied = "".join(
        f"INSERT INTO {table} ({sealed}{more}) SELECT {sealed}{more} FROM {table}_1 ORDER BY rowid;"
        f"DROP TABLE {table}_1;"
        for table, (sealed, more) in _TABLES_1.items()
    )
    dropped = "".join(f"DROP TABLE IF EXISTS {table};" for table in ("sets", "owners", "progress"))
    connection.executescript(f"BEGIN IMMEDIATE; {renamed} {SCHEMA} {copied} {dropped} COMMIT;")
