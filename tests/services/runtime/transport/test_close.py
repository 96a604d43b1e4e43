"""A session is closed only when no thread of ours uses it."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from services.runtime.transport.api import ThreadedSubscriber
from services.runtime.transport.zenoh import ZenohThreadedSubscriber, ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.ports import free_port

LONG_S = 0.3
"""Wall time of a wake-up during which its session is closed."""


class Slow:
    """A session whose put blocks until the session is closed, at most LONG_S."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.entered, self._closed = threading.Event(), threading.Event()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def put(self, *arguments: Any, **options: Any) -> None:
        self.entered.set()
        self._closed.wait(LONG_S)
        self._session.put(*arguments, **options)

    def close(self) -> None:
        self._session.close()
        self._closed.set()


def test_a_nudge_under_way_meets_no_closed_session(monkeypatch: pytest.MonkeyPatch) -> None:
    died: list[Any] = []
    monkeypatch.setattr(threading, "excepthook", died.append)
    with ZenohTransport(configuration("router", listen=(f"tcp/127.0.0.1:{free_port()}",))) as transport:
        slow = Slow(transport._zenoh)
        monkeypatch.setattr(transport, "_zenoh", slow)
        inlet = transport.subscribe("elea/test", 8)
        reader = threading.Thread(target=transport.wait, args=(inlet,))
        reader.start()
        transport.wake()
        assert slow.entered.wait(60)
        transport.close()
        reader.join(60)
    assert not reader.is_alive()
    assert died == []


def test_a_subscription_ends_while_a_thread_waits_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.transport.zenoh._RELEASE_S", 20.0)
    with ZenohTransport(configuration("router", listen=(f"tcp/127.0.0.1:{free_port()}",))) as transport:
        for _ in range(20):
            inlet = transport.subscribe_threaded("elea/test", 8)
            ended = threading.Event()

            def wait(inlet: ThreadedSubscriber = inlet, ended: threading.Event = ended) -> None:
                while not ended.is_set() and inlet.wait():
                    pass

            reader = threading.Thread(target=wait)
            reader.start()
            ended.set()
            inlet.close()
            reader.join(60)
            assert not reader.is_alive()


class Undeclaring:
    """A subscriber of Zenoh that another thread undeclares from the first read on."""

    def __init__(self) -> None:
        self.reading, self.is_undeclaring = threading.Event(), threading.Event()

    def recv(self) -> Any:
        self.reading.set()
        self.is_undeclaring.wait(60)
        raise RuntimeError("Already mutably borrowed")

    try_recv = recv

    def undeclare(self) -> None:
        self.is_undeclaring.set()


@pytest.mark.parametrize(("read", "end"), [("recv", None), ("wait", False)])
def test_a_thread_that_reads_while_its_subscription_is_undeclared_meets_its_end(read: str, end: bool | None) -> None:
    declared = Undeclaring()
    inlet = ZenohThreadedSubscriber("elea/test", declared, "", lambda *arguments, **options: None)
    found: list[Any] = []
    reader = threading.Thread(target=lambda: found.append(getattr(inlet, read)()))
    reader.start()
    assert declared.reading.wait(60)
    inlet.close()
    reader.join(60)
    assert found == [end]


def test_another_error_of_a_read_is_not_taken_for_the_end() -> None:
    declared = Undeclaring()
    declared.undeclare()
    inlet = ZenohThreadedSubscriber("elea/test", declared, "", lambda *arguments, **options: None)
    with pytest.raises(RuntimeError, match="borrowed"):
        inlet.wait()
