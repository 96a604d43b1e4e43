"""A node's request handling: bounded per turn and in size, failing handlers, deferred replies, several servers."""

from __future__ import annotations

import io
import time

import pytest

from messages.base import decoder, encode
from messages.requests import PAUSE, RESUME, STEP, Refusal
from messages.simulation import SimTime, Steps
from messages.std import Empty
from messages.topics import HEALTH
from services.runtime.errors import BadInput, CallFailed, SeveralServers, nearest, unknown_name
from services.runtime.node import Node
from services.runtime.parameters.client import call_idempotent
from services.runtime.requests import MAX_PER_TURN, DeferredReply
from services.runtime.transport.api import PendingReplies
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.request_queue import MAX_WAITING
from tests.harness.memory_node import memory_node, spinning
from tests.harness.waiting import wait_until

STEP_KEY, PAUSE_KEY = STEP.name[1:], PAUSE.name[1:]


def reason_of(pending: PendingReplies) -> str:
    """Return the reason for which a request was rejected."""
    replies = pending.poll()
    assert replies is not None
    return decoder(Refusal)(replies[0].payload).reason


def log_of(made: Node) -> str:
    out = made.log._out
    assert isinstance(out, io.StringIO)
    return out.getvalue()


def test_a_turn_answers_some_of_a_flood_and_lets_the_other_requests_through(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.requests.MAX_TURN_S", 60.0)  # their number alone ends the turn
    with memory_node(bus, "sim") as server, MemoryTransport(bus) as stranger:
        steps = 0

        def step(asked: Steps) -> SimTime:
            nonlocal steps
            steps += 1
            return SimTime(tick=steps)

        server.serve(STEP, step)
        server.serve(PAUSE, lambda _: SimTime(tick=5))
        flood = [stranger.query_async(STEP_KEY, encode(Steps()), 60.0) for _ in range(MAX_WAITING + 1)]
        assert reason_of(flood[-1]).startswith(f"busy: {MAX_WAITING} requests wait already")
        pause = stranger.query_async(PAUSE_KEY, encode(Empty()), 60.0)
        server.spin_once()
        replies = pause.poll()
        assert replies is not None
        assert replies[0].ok
        assert 0 < steps < MAX_PER_TURN
        assert server.transport._woken, "the rest waits for no sample"  # type: ignore[attr-defined]
        wait_until(lambda: server.spin_once() or steps == MAX_WAITING, what="the rest of the flood")
        assert server.request_server.refusals.count == 1


def test_slow_requests_take_one_turn_each(bus: MemoryBus) -> None:
    with memory_node(bus, "sim") as server, MemoryTransport(bus) as stranger:
        server.serve(STEP, lambda _: time.sleep(0.05) or SimTime())
        pending = [stranger.query_async(STEP_KEY, encode(Steps()), 60.0) for _ in range(3)]
        for answered in (1, 2, 3):
            server.spin_once()
            assert sum(each.poll() is not None for each in pending) == answered


def test_what_is_too_large_is_refused_unread_and_shown_in_the_heartbeat(bus: MemoryBus) -> None:
    with memory_node(bus, "sim") as server, memory_node(bus, "observer") as observer, MemoryTransport(bus) as stranger:
        health = observer.subscribe(HEALTH)
        server.serve(STEP, lambda _: SimTime())
        server.serve(PAUSE, lambda _: SimTime())
        large = stranger.query_async(STEP_KEY, bytes(STEP.largest + 1), 60.0)
        assert reason_of(large) == f"a request of {STEP.largest + 1} bytes, the limit is {STEP.largest}"
        kept = [stranger.query_async(STEP_KEY, bytes(STEP.largest), 60.0) for _ in range(65)]
        assert reason_of(kept[-1]).startswith("busy: 64 requests wait already")
        stranger.query_async(PAUSE_KEY, b"\xc1", 60.0)
        server.spin_once()

        def beat() -> bool:
            server.heartbeat.request_now()
            server.spin_once()
            health.update()
            return bool(health.messages) and health.messages[-1][0].refused_requests == 67

        wait_until(beat, what="66 refused of the one, 1 of the other")
        assert health.messages[-1][0].request_reason


def test_a_handler_that_fails_is_told_logged_and_counted_and_ends_nothing(bus: MemoryBus) -> None:
    def fail(_: object) -> SimTime:
        raise ZeroDivisionError("of ours")

    with memory_node(bus, "sim") as server, memory_node(bus, "client") as client:
        server.serve(STEP, fail)
        server.serve(PAUSE, lambda _: SimTime(tick=10**30))  # a reply that cannot be encoded
        server.serve(RESUME, lambda _: SimTime(tick=7))
        with spinning(server):
            with pytest.raises(CallFailed, match="/sim/step: internal error: ZeroDivisionError: of ours; see the log"):
                client.call(STEP, Steps(), timeout=60.0)
            with pytest.raises(CallFailed, match="/sim/pause: internal error: OverflowError"):
                client.call(PAUSE, Empty(), timeout=60.0)
            assert client.call(RESUME, Empty(), timeout=60.0).tick == 7
        assert server.request_server.refusals.count == 2
        assert "/sim/step failed:\nTraceback" in log_of(server)
        assert 'raise ZeroDivisionError("of ours")' in log_of(server)


def test_a_deferred_reply_holds_its_query_alone_and_comes_once(bus: MemoryBus) -> None:
    deferred: list[DeferredReply[SimTime]] = []

    def defer(_: object) -> DeferredReply[SimTime]:
        deferred.append(DeferredReply())
        return deferred[-1]

    def fail() -> SimTime:
        raise BadInput("it cannot be done now")

    with MemoryTransport(bus) as stranger:
        with memory_node(bus, "sim") as server:
            server.serve(STEP, defer)
            server.serve(PAUSE, lambda _: SimTime(tick=5))
            first, second, third, last = (stranger.query_async(STEP_KEY, encode(Steps()), 60.0) for _ in range(4))
            pause = stranger.query_async(PAUSE_KEY, encode(Empty()), 60.0)
            server.spin_once()
            assert [each.poll() is None for each in (first, second, third, last, pause)] == [True] * 4 + [False]
            later: DeferredReply[SimTime] = DeferredReply()
            deferred[1].answer(lambda: SimTime(tick=2))
            deferred[0].answer(fail)
            deferred[2].answer(lambda: later)
            assert third.poll() is None
            later.answer(lambda: SimTime(tick=3))
            deferred[1].answer(lambda: SimTime(tick=4))
            assert reason_of(first) == "it cannot be done now"
            ticks = [decoder(SimTime)(reply.payload).tick for each in (second, third) for reply in each.poll() or ()]
            assert ticks == [2, 3]
        assert reason_of(last) == "the process ended before this was done"


def test_who_asks_two_servers_is_told_of_both_and_one_that_has_gone_is_none(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.requests.DUPLICATE_S", 0.0)
    monkeypatch.setattr("services.runtime.parameters.client.TRY_TIMEOUT_S", 60.0)
    with memory_node(bus, "sim") as server, memory_node(bus, "client") as client:
        server.serve(STEP, lambda _: SimTime(tick=1))
        with spinning(server):
            with memory_node(bus, "rogue", "/other") as rogue:
                rogue.serve(STEP, lambda _: SimTime(tick=2))
                with spinning(rogue):
                    for ask in (client.call, lambda *asked: call_idempotent(client.transport, *asked)):
                        with pytest.raises(SeveralServers, match="2 processes serve /sim/step") as caught:
                            ask(STEP, Steps(), 60.0)
                        for who in (server, rogue):
                            assert f"{who.identity.node} (session {who.transport.session[:8]})" in str(caught.value)
                    wait_until(lambda: "/other/rogue" in log_of(server), what="a word in the log")
                rogue.transport._servers.clear()  # type: ignore[attr-defined]
                bus.servers[:] = [each for each in bus.servers if each.owner is not rogue.transport]
                assert client.call(STEP, Steps(), timeout=60.0).tick == 1, (
                    "its token is still in sight, and no server behind it"
                )
            assert client.call(STEP, Steps(), timeout=60.0).tick == 1
    assert log_of(server).count("serves /sim/step as this node does") == 1


def test_a_silent_second_server_costs_the_deadline_and_no_more(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    with memory_node(bus, "sim") as server, memory_node(bus, "client") as client, MemoryTransport(bus) as hung:
        server.serve(STEP, lambda _: SimTime(tick=1))
        hung.serve(STEP_KEY)
        monkeypatch.setattr(server.transport, "wake", server.spin_once)  # it answers before the deadline begins
        assert client.call(STEP, Steps(), timeout=0.2).tick == 1


def test_a_long_name_is_compared_with_none_and_long_lists_are_cut() -> None:
    known = [f"{'ab' * 49}{number:04}" for number in range(1000)]
    assert nearest("x" * 8_000_000, known) == []
    assert nearest("tb3_9", ["tb3_0", "arm"]) == ["tb3_0"]
    error = str(unknown_name("model", "m" * 8_000_000, (f"m{number}" for number in range(1000))))
    assert len(error) < 2000
    assert error.endswith("and 900 more)")
    assert str(unknown_name("model", "", ())) == "unknown model '' (known: none)"
