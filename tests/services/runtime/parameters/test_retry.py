"""Retried requests: each is carried out once, and an unknown outcome is reported as such."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.base import encode
from messages.requests import STEP, Refusal
from messages.simulation import SimTime, Steps
from services.runtime.errors import CallFailed
from services.runtime.graph import Entity
from services.runtime.parameters.client import OutcomeUnknown, call_idempotent
from services.runtime.transport.api import Query
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.processes import Network
from tests.harness.stopping import stop_process

pytestmark = pytest.mark.waits

Answer = Callable[[Query], None]


def silent(query: Query) -> None:
    """Never answer the request, like a killed server."""


def fails(query: Query) -> None:
    query.refuse(encode(Refusal(reason="internal error: out of luck")))


def refuses(query: Query) -> None:
    query.refuse(encode(Refusal(reason="no")))


def steps(query: Query) -> None:
    query.reply(encode(SimTime(tick=3)))


def babbles(query: Query) -> None:
    query.reply(b"nonsense")


@contextmanager
def server(bus: MemoryBus, *answers: Answer) -> Iterator[list[bytes]]:
    """Serve one answer after the other, repeating the last; yield the list of received requests."""
    asked: list[bytes] = []
    ended = threading.Event()
    with MemoryTransport(bus) as transport:
        served, inlet = transport.serve(STEP.name[1:]), transport.subscribe("rest", 1)
        transport.declare_token(Entity(transport.session, "srv", "/sim", STEP.name, "x").key)

        def work() -> None:
            while not ended.is_set():
                while (query := served.recv()) is not None:
                    asked.append(query.payload)
                    answers[min(len(asked), len(answers)) - 1](query)
                transport.wait(inlet)

        thread = threading.Thread(target=work)
        thread.start()
        try:
            yield asked
        finally:
            ended.set()
            transport.wake()
            thread.join(5)


def test_a_lost_answer_is_asked_for_again_with_the_same_words(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.parameters.client.TRY_TIMEOUT_S", 0.05)
    with server(bus, silent, fails, steps) as asked, MemoryTransport(bus) as me:
        assert call_idempotent(me, STEP, Steps(count=2), 60.0).tick == 3
    assert len(asked) >= 3, "a slow answer is lost too"
    assert set(asked) == {encode(Steps(count=2))}


def test_a_refusal_is_final(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.parameters.client.TRY_TIMEOUT_S", 60.0)
    with server(bus, refuses, steps) as asked, MemoryTransport(bus) as me:
        with pytest.raises(CallFailed, match=r"^no$") as caught:
            call_idempotent(me, STEP, Steps(), 60.0)
        assert not isinstance(caught.value, OutcomeUnknown)
    assert len(asked) == 1


@pytest.mark.parametrize("answer", [silent, fails])
def test_without_any_answer_the_outcome_is_unknown(bus: MemoryBus, answer: Answer) -> None:
    with (
        server(bus, answer),
        MemoryTransport(bus) as me,
        pytest.raises(OutcomeUnknown, match="unknown whether the request was carried out"),
    ):
        call_idempotent(me, STEP, Steps(), timeout=0.3)


def test_an_answer_that_cannot_be_read_is_no_success(bus: MemoryBus) -> None:
    with (
        server(bus, babbles),
        MemoryTransport(bus) as me,
        pytest.raises(CallFailed, match="answered with something other than a SimTime"),
    ):
        call_idempotent(me, STEP, Steps(), 60.0)


def test_with_nobody_there_it_was_certainly_not_carried_out(bus: MemoryBus) -> None:
    with MemoryTransport(bus) as me:
        with pytest.raises(CallFailed, match="no server for /sim/step, nothing was sent") as caught:
            call_idempotent(me, STEP, Steps(), timeout=0.2)
        assert not isinstance(caught.value, OutcomeUnknown)


def test_a_network_that_is_too_busy_to_say_who_is_there_is_asked_again(tmp_path: Path) -> None:
    with (
        Network(tmp_path) as network,
        ZenohTransport(configuration("star", (network.endpoint,), reliable=True)) as transport,
    ):
        stop_process(network.router.pid)
        began = time.monotonic()
        try:
            with pytest.raises(CallFailed, match="nothing was sent to /sim/step: the network did not list its nodes"):
                call_idempotent(transport, STEP, Steps(), 1.5)
        finally:
            network.router.signal(signal.SIGCONT)
        assert time.monotonic() - began >= 1.5
        with pytest.raises(CallFailed, match="no server for /sim/step, nothing was sent: is the process"):
            call_idempotent(transport, STEP, Steps(), 60.0)
