"""A query that misses a reply has one TIMEOUT, also where the router and the session of the client both report it."""

from __future__ import annotations

from types import SimpleNamespace

from services.runtime.transport.api import TIMEOUT, Reply
from services.runtime.transport.zenoh import ZenohNotifyingReplies


class Payload(bytes):
    """A payload of Zenoh."""

    def to_bytes(self) -> bytes:
        return bytes(self)


ANSWER = SimpleNamespace(ok=SimpleNamespace(payload=Payload(b"yes")), err=None, replier_id=SimpleNamespace(zid="abc"))
LATE = SimpleNamespace(ok=None, err=SimpleNamespace(payload=Payload(TIMEOUT)), replier_id=None)


def replies(*given: SimpleNamespace) -> list[Reply] | None:
    pending = ZenohNotifyingReplies(lambda: None)
    for each in given:
        pending.on_reply(each)
    assert pending.poll() is None
    pending.on_end()
    return pending.poll()


def test_several_timeouts_are_one() -> None:
    answer, timeout = Reply(True, b"yes", "abc"), Reply(False, TIMEOUT)
    assert replies() == []
    assert replies(ANSWER) == [answer]
    assert replies(LATE, LATE) == [timeout]
    assert replies(LATE, ANSWER, LATE) == [answer, timeout]
