"""A plain Zenoh session that uses none of the project's transport."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager

import msgpack
import zenoh

from messages.requests import Refusal

_BLOCKING_QOS = {
    "id": "waiting",
    "messages": ["put", "delete"],
    "key_exprs": ["**"],
    "overwrite": {"congestion_control": "block"},
    "flows": ["egress"],
}
"""Block when a queue is full; Zenoh's default drops messages then, which happens on a busy machine."""


@contextmanager
def external_client(endpoint: str) -> Iterator[zenoh.Session]:
    """Open a plain Zenoh client session with the router at ``endpoint``."""
    config = {"mode": "client", "connect": {"endpoints": [endpoint]}, "qos": {"network": [_BLOCKING_QOS]}}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        yield session


def error_reason(session: zenoh.Session, key: str, payload: bytes | None) -> str:
    """Send a request and return the reason in its error reply; fail if it succeeded or got no reply."""
    replies = list(session.get(key, payload=payload, timeout=60.0))
    assert len(replies) == 1, f"{len(replies)} replies of {key} to {payload!r}"
    assert replies[0].ok is None, f"{key} did what {payload!r} asks"
    assert replies[0].err is not None
    said = msgpack.unpackb(replies[0].err.payload.to_bytes())
    assert said.keys() == set(Refusal.__struct_fields__)
    return str(said["reason"])
