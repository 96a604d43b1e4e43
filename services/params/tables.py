"""The tables of the file of parameters, and the seal by which damage to a row shows."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from typing import Any

import msgspec

from messages.parameters import Value

APPLICATION = 0x456C6561
"""SQLite's application id of our files: ``Elea``."""
FORMAT = 1
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
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {FORMAT};
"""
"""``lasting`` marks what an undo may take back; ``change`` and ``back`` are JSON."""

_SEALED = {
    "sets": ("name", "revision"),
    "saved": ('"set"', "name", "value"),
    "owners": ('"set"', "name", "node"),
    "history": ('"set"', "change", "back"),
    "requests": ("id", "digest", "reply", "run"),
}

_read_value = msgspec.json.Decoder(Value).decode


def seal(*parts: Any) -> str:
    """Eight bytes that tell whether a row is what was written."""
    return hashlib.blake2b(repr(parts).encode(), digest_size=8).hexdigest()


def write_value(value: Value) -> str:
    """A value as JSON, in which 1, 1.0 and true are three."""
    return json.dumps(value, allow_nan=False)


def read_value(text: str) -> Value:
    """The other way round."""
    value: Value = _read_value(text)
    return value


def first_damage(connection: sqlite3.Connection) -> str:
    """What SQLite or a seal finds wrong, or nothing; raises sqlite3.Error when it cannot even be read."""
    for (text,) in connection.execute("PRAGMA integrity_check(1)"):
        if text != "ok":
            return str(text)
    for table, columns in _SEALED.items():
        for *values, stored in connection.execute(f"SELECT {', '.join(columns)}, seal FROM {table}"):
            if seal(*values) != stored:
                return f"a row of {table} is not what was written: {str(values[:2])[:120]}"
    return ""
