"""The SQLite file of the parameter service: tables and checksums, locking, creation, and the check for damage."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from messages.parameters import Value
from services.runtime.atomic_file import fsync_path
from services.runtime.errors import BadInput

APPLICATION_ID = 0x456C6561
"""SQLite's application id of our files: ``Elea``."""
FORMAT_VERSION = 1
"""The version of these tables."""

SCHEMA = f"""
CREATE TABLE sets (name TEXT PRIMARY KEY, revision INTEGER NOT NULL, seal TEXT NOT NULL);
CREATE TABLE saved (
    "set" TEXT NOT NULL, name TEXT NOT NULL, value TEXT NOT NULL, seal TEXT NOT NULL, PRIMARY KEY ("set", name)
);
CREATE TABLE owners (
    "set" TEXT NOT NULL, name TEXT NOT NULL, node TEXT NOT NULL, seal TEXT NOT NULL, PRIMARY KEY ("set", name, node)
);
CREATE TABLE history (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    "set" TEXT NOT NULL,
    change TEXT NOT NULL,
    back TEXT NOT NULL,
    run INTEGER NOT NULL CHECK (run IN (0, 1)),
    undone INTEGER NOT NULL DEFAULT 0 CHECK (undone IN (0, 1)),
    lasting INTEGER NOT NULL CHECK (lasting IN (0, 1)),
    seal TEXT NOT NULL
);
CREATE INDEX history_of_set ON history ("set", id);
CREATE TABLE requests (
    id TEXT PRIMARY KEY, digest TEXT NOT NULL, reply BLOB NOT NULL,
    run INTEGER NOT NULL CHECK (run IN (0, 1)), seal TEXT NOT NULL
);
CREATE TABLE progress (run TEXT PRIMARY KEY, epoch INTEGER NOT NULL, done TEXT NOT NULL, seal TEXT NOT NULL);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {FORMAT_VERSION};
"""
"""``lasting`` marks what an undo may take back; ``change``, ``back`` and ``done`` are JSON."""

_CHECKSUMMED = {
    "sets": ("name", "revision"),
    "saved": ('"set"', "name", "value"),
    "owners": ('"set"', "name", "node"),
    "history": ('"set"', "change", "back"),
    "requests": ("id", "digest", "reply", "run"),
    "progress": ("run", "epoch", "done"),
}

_read_value = msgspec.json.Decoder(Value).decode


def checksum(*parts: Any) -> str:
    """Eight bytes that tell whether a row is what was written."""
    return hashlib.blake2b(repr(parts).encode(), digest_size=8).hexdigest()


def write_value(value: Value) -> str:
    """A value as JSON, in which 1, 1.0 and true are three."""
    return json.dumps(value, allow_nan=False)


def read_value(text: str) -> Value:
    """The other way round."""
    value: Value = _read_value(text)
    return value


def find_damage(connection: sqlite3.Connection) -> str:
    """What SQLite or a seal finds wrong, or nothing; raises sqlite3.Error when it cannot even be read."""
    for (text,) in connection.execute("PRAGMA integrity_check(1)"):
        if text != "ok":
            return str(text)
    for table, columns in _CHECKSUMMED.items():
        for *values, stored in connection.execute(f"SELECT {', '.join(columns)}, seal FROM {table}"):
            if checksum(*values) != stored:
                return f"a row of {table} is not what was written: {str(values[:2])[:120]}"
    return ""


_HEADER = 100
_MAGIC = b"SQLite format 3\0"


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the file, made first if there is none, while no other service does; raises BadInput.

    It is looked at in a copy, so that what is refused stays as it was, its write-ahead log included.
    """
    try:
        if not path.exists():
            _make(path)
        handle = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError as error:
        raise BadInput(
            f"cannot write the file of parameters {path} ({error.strerror}): "
            "give another with --param file=PATH, or none"
        ) from None
    except sqlite3.Error as error:
        raise BadInput(f"cannot make the file of parameters {path} ({error}): is the disk full?") from None
    try:
        _lock(handle, path)
        _check_header(handle, path)
        yield
    finally:
        os.close(handle)


def connect(path: Path) -> sqlite3.Connection:
    """A connection to a claimed file, durable at every commit; raises sqlite3.Error."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, isolation_level=None, timeout=2.0)
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        (mode,) = connection.execute("PRAGMA journal_mode = WAL").fetchone()
        if mode != "wal":
            raise sqlite3.OperationalError(f"its journal is {mode}, not a write-ahead log")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    except sqlite3.Error:
        connection.close()
        raise
    return connection


def _make(path: Path) -> None:
    """A whole empty file appears at once, or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = path.with_name(f"{path.name}-wal")
    if log.exists() and log.stat().st_size:
        raise BadInput(f"{path} is gone, but its log {log} is there: put the file back, or move the log away as well")
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        made = Path(folder) / "new"
        connection = sqlite3.connect(made, isolation_level=None)
        try:
            connection.executescript(f"PRAGMA journal_mode = WAL; BEGIN; {SCHEMA} COMMIT;")
        finally:
            connection.close()
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
            f"another parameter service uses {path}: stop it, or give this one a file of its own (--param file=PATH)"
        ) from None


def _check_header(handle: int, path: Path) -> None:
    header = os.pread(handle, _HEADER, 0)
    if not header:
        raise BadInput(_recovery_advice(path, "is empty: it was truncated"))
    if not header.startswith(_MAGIC[: len(header)]):
        raise BadInput(_recovery_advice(path, "is not a database of parameters, or its beginning was destroyed"))
    if len(header) < _HEADER:
        raise BadInput(_recovery_advice(path, f"was truncated to {len(header)} bytes"))
    version, application = int.from_bytes(header[60:64], "big"), int.from_bytes(header[68:72], "big")
    if application != APPLICATION_ID:
        raise BadInput(
            f"{path} is a database of another program (application id {application:#x}): it was left as it is. "
            "Give a file of its own with --param file=PATH"
        )
    if version != FORMAT_VERSION:
        raise BadInput(
            f"{path} has format {version}, this Elea knows {FORMAT_VERSION}: it was left as it is. "
            "Use the version that wrote it (elea param dump), or give another file"
        )
    if damage := _find_damage(handle, path):
        raise BadInput(_recovery_advice(path, f"is damaged ({damage})"))


def _find_damage(handle: int, path: Path) -> str:
    """What is wrong with a copy of the file and its log, as far as SQLite can recover it."""
    log = path.with_name(f"{path.name}-wal")
    try:
        with tempfile.TemporaryDirectory(prefix="elea-params-") as folder:
            copy = Path(folder) / "copy"
            with open(handle, "rb", closefd=False) as source, copy.open("wb") as out:
                source.seek(0)
                shutil.copyfileobj(source, out)
            if log.exists():
                shutil.copyfile(log, copy.with_name("copy-wal"))
            connection = sqlite3.connect(copy, isolation_level=None)
            try:
                return find_damage(connection)
            except (sqlite3.Error, UnicodeDecodeError) as error:
                return str(error)
            finally:
                connection.close()
    except OSError as error:
        raise BadInput(f"cannot look at a copy of {path}: {error}") from None


def _recovery_advice(path: Path, what: str) -> str:
    return (
        f"{path} {what}: it was left as it is, nothing was reset. Put a copy of it back, or start without it: "
        f"move {path} and what begins like it away, then ./elea param load FILE if there is a dump"
    )
