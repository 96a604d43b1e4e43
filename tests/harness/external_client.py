"""A Zenoh session that keeps to none of the project's rules."""

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
"""Nothing that it sends is dropped on the way for want of room, as Zenoh's default does on a busy machine."""


@contextmanager
def external_client(endpoint: str) -> Iterator[zenoh.Session]:
    """A plain client of the router at ``endpoint``."""
    config = {"mode": "client", "connect": {"endpoints": [endpoint]}, "qos": {"network": [_BLOCKING_QOS]}}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        yield session


def error_reason(session: zenoh.Session, key: str, payload: bytes | None) -> str:
    """The reason in the error reply to a request; fails when it was carried out or left without an answer."""
    replies = list(session.get(key, payload=payload, timeout=10.0))
    assert len(replies) == 1, f"{len(replies)} replies of {key} to {payload!r}"
    assert replies[0].ok is None, f"{key} did what {payload!r} asks"
    assert replies[0].err is not None
    said = msgpack.unpackb(replies[0].err.payload.to_bytes())
    assert said.keys() == set(Refusal.__struct_fields__)
    return str(said["reason"])
