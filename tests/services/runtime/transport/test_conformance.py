"""The behaviour required of all transports."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from messages.topics import Quality
from services.runtime.graph import Entity, token_pattern
from services.runtime.transport.api import TIMEOUT, RawSubscriber, Sample, Transport
from tests.harness.waiting import wait_until

Connect = Callable[[], Transport]
TEXT = "application/msgpack;std_msgs/String"


def _take(inlet: RawSubscriber, count: int) -> list[Sample]:
    got: list[Sample] = []

    def enough() -> bool:
        while (sample := inlet.recv()) is not None:
            got.append(sample)
        return len(got) >= count

    wait_until(enough, what=f"{count} samples, got {len(got)}")
    return got


def _linked(a: Transport, b: Transport) -> None:
    """Wait until a put of ``a`` reaches ``b``, which is so once ``a`` sees a token of ``b``."""
    key = f"test/{b.session}"
    token = b.declare_token(key)
    wait_until(lambda: key in a.tokens("test/*"), what="tokens")
    token.close()


def test_a_sample_arrives_whole_and_in_order(connect: Connect) -> None:
    reader, writer = connect(), connect()
    inlet = reader.subscribe("tb3_0/text", 64)
    _linked(writer, reader)
    outlet = writer.advertise("tb3_0/text", TEXT, Quality.EVENT)
    for number in range(20):
        outlet.put(bytes([number]), attachment=b"x" * 33)
    got = _take(inlet, 20)
    assert [each[0] for each in got] == [bytes([number]) for number in range(20)]
    assert {inlet.encoding(each[2]) for each in got} == {TEXT}
    assert {each[1] for each in got} == {b"x" * 33}
    assert {inlet.key(each[2]) for each in got} == {"tb3_0/text"}


def test_what_is_sent_reaches_a_subscription_whose_token_has_arrived(connect: Connect) -> None:
    reader, writer = connect(), connect()
    for number in range(20):
        outlet = writer.advertise(f"tb3_0/late{number}", TEXT, Quality.EVENT)
        inlet = reader.subscribe(f"tb3_0/late{number}", 4)
        token = Entity(reader.session, "sub", "/reader", f"/tb3_0/late{number}")
        assert token.key not in writer.arrived_tokens(token_pattern("sub"))
        kept = reader.declare_token(token.key)
        pattern = token_pattern("sub", name=token.name)
        wait_until(lambda only=[token.key], p=pattern: [*writer.arrived_tokens(p)] == only, every=0.0, what="the token")
        outlet.put(b"first", attachment=b"")
        assert _take(inlet, 1)[0][0] == b"first"
        kept.close()


def test_the_type_of_the_sender_is_told(connect: Connect) -> None:
    reader, writer = connect(), connect()
    inlet = reader.subscribe("tb3_0/text", 64)
    _linked(writer, reader)
    writer.advertise("tb3_0/text", "application/msgpack;std_msgs/Bool", Quality.EVENT).put(b"\xc3", attachment=b"")
    (sample,) = _take(inlet, 1)
    assert inlet.encoding(sample[2]) == "application/msgpack;std_msgs/Bool"
    assert sample[1] == b""


def test_wildcards_name_the_key(connect: Connect) -> None:
    reader, writer = connect(), connect()
    inlet = reader.subscribe("*/text", 64)
    _linked(writer, reader)
    for robot in ("tb3_0", "tb3_1"):
        writer.advertise(f"{robot}/text", TEXT, Quality.EVENT).put(b"", attachment=b"")
    assert {inlet.key(each[2]) for each in _take(inlet, 2)} == {"tb3_0/text", "tb3_1/text"}


@pytest.mark.parametrize("quality", list(Quality))
def test_every_quality_carries(connect: Connect, quality: Quality) -> None:
    reader, writer = connect(), connect()
    inlet = reader.subscribe("a", 8, latched=quality is Quality.LATCHED)
    _linked(writer, reader)
    writer.advertise("a", TEXT, quality).put(b"payload", attachment=b"")
    assert _take(inlet, 1)[0][0] == b"payload"


def test_the_newest_survive_a_reader_that_sleeps(connect: Connect) -> None:
    reader, writer = connect(), connect()
    inlet = reader.subscribe("a", 4)
    end = reader.subscribe("end", 4)
    _linked(writer, reader)
    outlet = writer.advertise("a", TEXT, Quality.EVENT)
    for number in range(50):
        outlet.put(bytes([number]), attachment=b"")
    writer.advertise("end", TEXT, Quality.EVENT).put(b"", attachment=b"")
    _take(end, 1)
    kept = _take(inlet, 4)
    assert [each[0][0] for each in kept] == [46, 47, 48, 49]


def test_the_last_of_each_latched_publisher_reaches_who_comes_late(connect: Connect) -> None:
    first, second = connect(), connect()
    one = first.advertise("tf_static", TEXT, Quality.LATCHED)
    one.put(b"old", attachment=b"")
    one.put(b"from the first", attachment=b"")
    other = second.advertise("tf_static", TEXT, Quality.LATCHED)
    other.put(b"from the second", attachment=b"")
    late = connect()
    inlet = late.subscribe("tf_static", 8, latched=True)
    assert {each[0] for each in _take(inlet, 2)} == {b"from the first", b"from the second"}


def test_a_latched_publisher_that_comes_late_is_heard(connect: Connect) -> None:
    reader = connect()
    inlet = reader.subscribe("tf_static", 8, latched=True)
    writer = connect()
    outlet = writer.advertise("tf_static", TEXT, Quality.LATCHED)
    outlet.put(b"hello", attachment=b"")
    assert _take(inlet, 1)[0][0] == b"hello"
    outlet.close()


def test_wanted_follows_the_readers(connect: Connect) -> None:
    writer, reader = connect(), connect()
    outlet = writer.advertise("a", TEXT, Quality.SENSOR)
    assert not outlet.has_subscribers
    before = writer.readers_version
    inlet = reader.subscribe("a", 8)
    wait_until(lambda: outlet.has_subscribers)
    wait_until(lambda: writer.readers_version != before)
    during = writer.readers_version
    inlet.close()
    wait_until(lambda: not outlet.has_subscribers)
    wait_until(lambda: writer.readers_version not in (before, during))


def test_wait_wakes_for_a_sample_a_nudge_and_in_any_case(connect: Connect) -> None:
    transport, writer = connect(), connect()
    inlet = transport.subscribe("a", 8)
    _linked(writer, transport)
    outlet = writer.advertise("a", TEXT, Quality.EVENT)
    transport.wait(inlet)
    transport.wait(inlet)
    assert inlet.recv() is None

    threading.Timer(0.02, transport.wake).start()
    transport.wait(inlet)
    assert inlet.recv() is None

    outlet.put(b"x", attachment=b"")

    def arrived() -> Sample | None:
        transport.wait(inlet)
        return inlet.recv()

    assert wait_until(arrived)[0] == b"x"


def _answer(transport: Transport, key: str, done: threading.Event, refuse: bool = False) -> threading.Thread:
    server = transport.serve(key)
    inlet = transport.subscribe(f"{key}/rest", 8)

    def loop() -> None:
        while not done.is_set():
            transport.wait(inlet)
            while (query := server.recv()) is not None:
                if refuse:
                    query.refuse(b"no: " + query.payload)
                else:
                    query.reply(b"re: " + query.payload + query.attachment)

    thread = threading.Thread(target=loop)
    thread.start()
    return thread


@pytest.mark.parametrize("refuse", [False, True])
def test_a_query_is_answered_or_refused(connect: Connect, refuse: bool) -> None:
    server, client = connect(), connect()
    done = threading.Event()
    thread = _answer(server, "ask", done, refuse)
    try:
        _linked(client, server)
        (reply,) = client.query("ask", b"hello", 60.0)
        assert (reply.ok, reply.payload) == ((False, b"no: hello") if refuse else (True, b"re: hello"))
        pending = client.query_async("ask", b"hello", 60.0, b" from me")
        (reply,) = wait_until(pending.poll)
        assert (reply.ok, reply.payload) == ((False, b"no: hello") if refuse else (True, b"re: hello from me"))
    finally:
        done.set()
        server.wake()
        thread.join()


def test_an_answer_has_come_before_the_last_one_has(connect: Connect) -> None:
    server, silent, client = connect(), connect(), connect()
    done = threading.Event()
    silent.serve("ask")
    thread = _answer(server, "ask", done, False)
    try:
        _linked(client, server)
        _linked(client, silent)
        pending = client.query_async("ask", b"hello", 120.0)
        (reply,) = wait_until(pending.received)
        assert (reply.ok, reply.payload, reply.session) == (True, b"re: hello", server.session)
        assert pending.poll() is None
    finally:
        done.set()
        server.wake()
        thread.join()


def test_a_query_to_nobody_is_empty_at_once(connect: Connect) -> None:
    assert list(connect().query("nobody", b"", 60.0)) == []


def test_a_query_that_is_not_answered_ends_at_its_deadline(connect: Connect) -> None:
    server, client = connect(), connect()
    server.serve("ask")
    _linked(client, server)
    replies = client.query("ask", b"", 0.3)
    assert [(each.ok, each.payload) for each in replies] == [(False, TIMEOUT)]


def test_sessions_have_ids_of_their_own(connect: Connect) -> None:
    assert len({connect().session for _ in range(3)}) == 3


def test_closing_twice_does_no_harm(connect: Connect) -> None:
    transport = connect()
    transport.close()
    transport.close()
