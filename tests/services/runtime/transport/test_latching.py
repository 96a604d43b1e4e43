"""Latched samples reach late subscribers, whatever other queries are under way and whichever peers hang."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh
from zenoh.handlers import Callback

from messages.topics import Quality
from services.runtime.process import PARENT, ROOT
from services.runtime.transport.latching import RECENT, RELEASE_S, LatchedPublisher, Latching
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration
from tests.harness.external_client import external_client
from tests.harness.ports import free_port
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until

TOPICS, BYTES = 60, 100_000
"""More than the sockets and queues between two processes hold: 0.4 MB."""

PEER = f"""
import sys
from messages.topics import Quality
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration

with ZenohTransport(configuration("direct", (sys.argv[1],), reliable=True)) as transport:
    kept = [transport.advertise(f"theirs/{{n}}", "test", Quality.LATCHED) for n in range({TOPICS})]
    for each in kept:
        each.put(bytes({BYTES}), attachment=b"")
    print("sent", flush=True)
    sys.stdin.readline()
    asked = [transport.subscribe(f"ours/{{n}}", 4, latched=True) for n in range({TOPICS})]
    print("asked", flush=True)
    missing = set(asked)
    while missing:
        missing = {{each for each in missing if each.recv() is None}}
    print("complete", flush=True)
    sys.stdin.readline()
"""


@contextmanager
def peer(router: str) -> Iterator[subprocess.Popen[str]]:
    """Another process that runs PEER."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid())}
    with subprocess.Popen(
        [sys.executable, "-P", "-c", PEER, router], stdin=-1, stdout=-1, text=True, env=environment
    ) as process:
        try:
            assert _said(process) == "sent"
            yield process
        finally:
            process.kill()


def _said(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def _tell(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()


@pytest.fixture
def router() -> Iterator[str]:
    endpoint = router_endpoint(free_port())
    with ZenohTransport(configuration("router", listen=(endpoint,), reliable=True)):
        yield endpoint


def test_two_peers_with_much_for_each_other_ask_at_once(router: str) -> None:
    with ZenohTransport(configuration("direct", (router,), reliable=True)) as transport, peer(router) as other:
        ours = [transport.advertise(f"ours/{n}", "test", Quality.LATCHED) for n in range(TOPICS)]
        for each in ours:
            each.put(bytes(BYTES), attachment=b"")
        _tell(other)
        missing = {transport.subscribe(f"theirs/{n}", 4, latched=True) for n in range(TOPICS)}

        def complete() -> bool:
            nonlocal missing
            missing = {each for each in missing if each.recv() is None}
            return not missing

        wait_until(complete, 20.0, "their samples")
        assert [_said(other), _said(other)] == ["asked", "complete"]


def test_a_question_is_kept_after_its_answer(router: str) -> None:
    """Releasing the query's last reference sends the end of the reply, which the receiving thread must not do."""
    later: list[tuple[float, Callable[[], None]]] = []
    ended = threading.Event()
    answers: list[bytes] = []

    def on_reply(reply: zenoh.Reply) -> None:
        assert reply.ok is not None
        answers.append(reply.ok.payload.to_bytes())

    with external_client(router) as session, external_client(router) as other:
        publisher = LatchedPublisher(
            session.declare_publisher("theirs"),
            session,
            0,
            lambda work: work(),
            lambda seconds, work: later.append((seconds, work)),
        )
        publisher.put(b"kept", attachment=b"")
        wait_until(lambda: list(other.liveliness().get("theirs/@adv/**", timeout=1.0)), 20.0, "the token")
        other.get(
            "theirs/@adv/**",
            Callback(on_reply, ended.set),
            timeout=120.0,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            consolidation=zenoh.ConsolidationMode.NONE,  # other modes wait for the end
        )
        wait_until(lambda: answers, 20.0, "the answer")
        assert answers == [b"kept"]
        assert not ended.is_set()
        ((seconds, release),) = later
        assert seconds == RELEASE_S
        release()
        assert ended.wait(60.0)
        publisher.close()


class UndeclaredPublisher:
    """A publisher that another thread is undeclaring from the first sample on: what it has cannot be read."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        self.publisher, self.is_undeclaring = publisher, False

    def put(self, payload: bytes, **options: Any) -> None:
        self.publisher.put(payload, **options)
        self.is_undeclaring = True

    def undeclare(self) -> None:
        self.publisher.undeclare()

    @property
    def key_expr(self) -> zenoh.KeyExpr:
        return self._read().key_expr

    @property
    def encoding(self) -> zenoh.Encoding:
        return self._read().encoding

    def _read(self) -> zenoh.Publisher:
        if self.is_undeclaring:
            raise RuntimeError("Already mutably borrowed")
        return self.publisher


def test_a_question_while_the_publication_is_being_closed_does_not_end_the_thread_that_answers(router: str) -> None:
    with (
        external_client(router) as session,
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
    ):
        publisher = UndeclaredPublisher(session.declare_publisher("theirs", encoding="test"))
        latching = Latching(session)
        latched = latching.publisher(publisher)
        latched.put(b"kept", attachment=b"")
        late = transport.subscribe("theirs", 4, latched=True)
        sample = wait_until(late.recv, 20.0, "the answer")
        assert (sample[0], late.encoding(sample[2])) == (b"kept", "test")
        latched.close()
        latching.close(20.0)


def test_a_publisher_is_asked_again_whose_token_came_before_the_way_to_it(router: str) -> None:
    with (
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
        external_client(router) as session,
    ):
        late = transport.subscribe("theirs", 4, latched=True)
        key = f"theirs/@adv/pub/{session.zid()}/uhlc/0"
        token = session.liveliness().declare_token(key)
        wait_until(lambda: transport.tokens("theirs/@adv/**"), 20.0, "the token")

        def answer(query: zenoh.Query) -> None:
            query.reply("theirs", b"kept")
            query.drop()

        queryable = session.declare_queryable(key, answer)
        sample = wait_until(late.recv, 20.0, "what is kept")
        assert sample is not None
        assert sample[0] == b"kept"
        queryable.undeclare()
        token.undeclare()


def test_a_publisher_that_hangs_keeps_nobody_elses_samples_back(router: str) -> None:
    with (
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
        ZenohTransport(configuration("direct", (router,), reliable=True)) as third,
        peer(router) as other,
    ):
        kept = third.advertise("theirs/0", "test", Quality.LATCHED)
        kept.put(b"kept", attachment=b"")
        wait_until(lambda: len(transport.tokens("theirs/0/@adv/**")) == 2, 20.0, "both publishers")
        stop_process(other.pid)
        try:
            late = transport.subscribe("theirs/0", 4, latched=True)
            got: list[bytes] = []

            def has(payload: bytes) -> bool:
                while (sample := late.recv()) is not None:
                    got.append(sample[0])
                return payload in got

            wait_until(lambda: has(b"kept"), 20.0, "what was kept")
            kept.put(b"new", attachment=b"")
            wait_until(lambda: has(b"new"), 20.0, "what is sent")
            assert got == [b"kept", b"new"], "each once, and nothing of the one that hangs"
        finally:
            os.kill(other.pid, signal.SIGCONT)
        wait_until(lambda: has(bytes(BYTES)), 20.0, "what it keeps, as soon as it goes on")


def test_a_strangers_sample_with_its_timestamp_does_not_silence_what_is_kept(router: str) -> None:
    with (
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
        external_client(router) as stranger,
        peer(router) as other,
    ):
        keys = wait_until(lambda: stranger_tokens(stranger), 20.0, "the publisher")
        answers = stranger.get(keys[0], accept_replies=zenoh.ReplyKeyExpr.ANY)
        kept = next(reply.ok for reply in answers if reply.ok is not None)
        stop_process(other.pid)
        try:
            late = transport.subscribe("theirs/0", 4, latched=True)
            forger = stranger.declare_publisher("theirs/0", congestion_control=zenoh.CongestionControl.BLOCK)
            wait_until(lambda: forger.matching_status.matching, 20.0, "the subscription")
            forger.put(b"forged", attachment=b"", timestamp=kept.timestamp)
            first = wait_until(late.recv, 20.0, "what is forged")
            assert first is not None
            assert first[0] == b"forged"
        finally:
            os.kill(other.pid, signal.SIGCONT)
        second = wait_until(late.recv, 20.0, "what is kept")
        assert second is not None
        assert second[0] == bytes(BYTES)


def stranger_tokens(session: zenoh.Session) -> list[str]:
    """Return the tokens of the publishers that latch the topic theirs/0, as any program sees them."""
    return [str(each.ok.key_expr) for each in session.liveliness().get("theirs/0/@adv/**") if each.ok is not None]


def test_an_answer_without_an_end_takes_no_memory(router: str) -> None:
    with (
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
        external_client(router) as stranger,
    ):
        answered = threading.Event()

        def answer(query: zenoh.Query) -> None:
            with query:
                for number in range(10 * RECENT):
                    query.reply("theirs", b"%d" % number, timestamp=stranger.new_timestamp())
            answered.set()

        key = f"theirs/@adv/pub/{stranger.zid()}/uhlc/0"
        stranger.declare_queryable(key, answer)
        token = stranger.liveliness().declare_token(key)
        late = transport.subscribe("theirs", 4, latched=True)
        assert answered.wait(60.0)
        sender = stranger.declare_publisher("theirs", congestion_control=zenoh.CongestionControl.BLOCK)
        wait_until(lambda: sender.matching_status.matching, 20.0, "the subscription")
        sender.put(b"last", timestamp=stranger.new_timestamp())  # after the answers, on the same link
        found: list[bytes] = []

        def all_read() -> bool:
            found.extend(sample[0] for sample in iter(late.recv, None))
            return b"last" in found

        wait_until(all_read, 20.0, "the last sample")
        assert found == [*(b"%d" % number for number in range(RECENT)), b"last"]
        token.undeclare()


@pytest.mark.parametrize("role", ["direct", "star"])
def test_zenohs_own_latched_programs_understand_ours(router: str, role: Role) -> None:
    with (
        ZenohTransport(configuration(role, (router,), reliable=True)) as transport,
        ZenohTransport(configuration(role, (router,), reliable=True)) as foreign,
    ):
        ours = transport.advertise("ours", "test", Quality.LATCHED)
        ours.put(b"ours", attachment=b"beside")
        cache = zenoh.ext.CacheConfig(1)
        theirs = zenoh.ext.declare_advanced_publisher(foreign._zenoh, "theirs", cache=cache, publisher_detection=True)
        theirs.put(b"theirs")

        heard: list[tuple[bytes, bytes]] = []
        past = zenoh.ext.HistoryConfig(detect_late_publishers=True)
        late = zenoh.ext.declare_advanced_subscriber(
            foreign._zenoh,
            "ours",
            lambda sample: heard.append((sample.payload.to_bytes(), sample.attachment.to_bytes())),
            history=past,
        )
        wait_until(lambda: bool(heard), 20.0, "ours")
        assert heard == [(b"ours", b"beside")]
        late.undeclare()

        inlet = transport.subscribe("theirs", 4, latched=True)
        found: list[bytes] = []

        def look() -> bool:
            while (sample := inlet.recv()) is not None:
                found.append(sample[0])
            return bool(found)

        wait_until(look, 20.0, "theirs")
        assert found == [b"theirs"]


def test_what_waits_is_read_in_the_order_of_its_sending(router: str) -> None:
    """One sample was sent, a later one fetched: they must stay in order."""
    with (
        ZenohTransport(configuration("direct", (router,), reliable=True)) as transport,
        ZenohTransport(configuration("direct", (router,), reliable=True)) as foreign,
    ):
        arrivals = threading.Semaphore(0)
        inlet = transport.subscribe("topic", 4, latched=True, notify=arrivals.release)
        session = foreign._zenoh
        sender = session.declare_publisher("topic", congestion_control=zenoh.CongestionControl.BLOCK)
        wait_until(lambda: sender.matching_status.matching, 20.0, "the subscription")
        sender.put(b"first", attachment=b"", timestamp=session.new_timestamp())
        assert arrivals.acquire(timeout=60.0)
        key = f"topic/@adv/pub/{session.zid()}/uhlc/9"
        stamp = session.new_timestamp()

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply("topic", b"second", attachment=b"", timestamp=stamp)

        session.declare_queryable(key, answer)
        token = session.liveliness().declare_token(key)
        assert arrivals.acquire(timeout=60.0)
        sender.put(b"third", attachment=b"", timestamp=session.new_timestamp())
        assert arrivals.acquire(timeout=60.0)
        found = [sample[0] for sample in iter(inlet.recv, None)]
        assert found == [b"first", b"second", b"third"]
        token.undeclare()
