"""Invalid messages and pages that break the protocol, on a real server without a fleet."""

from __future__ import annotations

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from starlette.types import Message
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from services.panel.auth import Authenticator
from services.panel.pages import PageRegistry
from services.panel.protocol import MAX_MESSAGE_SIZE, Subscribe
from services.panel.server import RateLimit, create_app
from tests.harness.waiting import wait_until
from tests.services.panel.server_harness import PAGE_HEADERS, TOKEN, WITHIN_S, ServerHarness, receive

WRONG = [
    "",
    "x",
    "[]",
    "null",
    '{"k":"subscribe"',
    '{"k":"explode"}',
    '{"k":"subscribe","channels":["secrets"]}',
    '{"k":"subscribe","more":1}',
    json.dumps({"k": "subscribe", "series": [{"id": 1, "topic": "/a", "path": "a..b"}]}),
    json.dumps({"k": "subscribe", "series": [{"id": 1, "topic": "no slash", "path": "x"}]}),
    json.dumps({"k": "subscribe", "series": [{"id": n, "topic": "/a", "path": "x"} for n in range(33)]}),
    json.dumps({"k": "subscribe", "fields": ["/a/*"]}),
    '{"k":"drive","robot":"/a","v":1e999}',
    '{"k":"drive","robot":"/a","v":"fast"}',
    '{"k":"drive","robot":"/a","v":NaN}',
    '{"k":"drive","robot":"/**","v":1}',
    '{"k":"goal","id":1,"robot":"/a","x":1e9,"y":0}',
    '{"k":"estop","id":1}',
    '{"k":"step","id":1,"count":0}',
    '{"k":"process","id":1,"verb":"kill","name":"sim"}',
    '{"k":"set","id":1,"set":"/a","values":{}}',
    '{"k":"set","id":1,"set":"/a","values":{"x":{"y":1}}}',
    '{"k":"set","id":1,"set":"/a","values":{"x":"\\ud800"}}',
    "[" * 2000,
]


def test_senseless_words_are_refused_with_a_reason_and_counted(panel: ServerHarness) -> None:
    with panel.page_socket() as page:
        for count, text in enumerate(WRONG, 1):
            page.send(text)
            error = receive(page)
            assert (error["k"], bool(error["reason"])) == ("error", True), text
            assert panel.registry.pages[0].rejected == count
        page.send(b"\x00\xff")
        assert "UTF-8 text" in receive(page)["reason"]
        assert panel.registry.drain() == [], "none of it reached the loop"
        page.send('{"k":"subscribe","channels":["log"]}')
        page.send("?")
        receive(page)
        assert [said for _, said in panel.registry.drain()] == [Subscribe(channels=("log",))]


def test_text_that_is_not_utf8_is_refused_and_counted_as_any_other_bad_word(
    panel: ServerHarness, caplog: pytest.LogCaptureFixture
) -> None:
    with panel.page_socket() as page:
        page.send(b'{"k":"estop","id":1,"on":true}\xff', text=True)
        assert "messages must be UTF-8 text" in receive(page)["reason"]
        page.send(iter([b'{"k":"log', b"\xc3"]), text=True)  # in two frames, the last of which ends inside a character
        assert "messages must be UTF-8 text" in receive(page)["reason"]
        assert panel.registry.pages[0].rejected == 2
        page.send('{"k":"subscribe","fields":["/größe"]}'.encode(), text=True)
        assert "größe" in receive(page)["reason"], "a name that no topic has, in good UTF-8, is read"
        page.send('{"k":"release"}')
        wait_until(panel.registry.drain, WITHIN_S, "what comes after it to be read")
    assert [each.message for each in caplog.records] == []


def consume(page: ClientConnection) -> None:
    while True:
        page.recv(timeout=WITHIN_S)


def closed(page: ClientConnection) -> int:
    """Return the code with which the server closes, after any other messages."""
    with pytest.raises(ConnectionClosed) as ended:
        consume(page)
    assert ended.value.rcvd is not None
    return ended.value.rcvd.code


def test_a_word_that_is_too_large_ends_the_page(panel: ServerHarness) -> None:
    with panel.page_socket() as page:
        page.send("x" * (MAX_MESSAGE_SIZE + 1))
        assert closed(page) == 1009


def test_a_page_that_makes_no_sense_is_closed(panel: ServerHarness) -> None:
    with panel.page_socket() as page:
        for _ in range(51):
            page.send("?")
        assert closed(page) == 1008


def test_a_page_that_talks_without_end_is_not_heard_out(panel: ServerHarness, monkeypatch: pytest.MonkeyPatch) -> None:
    pace = RateLimit()
    assert [pace.allows(5.0 + number / 300) for number in range(210)] == [True] * 200 + [False] * 10
    assert pace.allows(6.1), "in the next second"
    monkeypatch.setattr("services.panel.server.MAX_MESSAGES_PER_S", 0)
    with panel.page_socket() as page:
        page.send('{"k":"release"}')
        assert "messages a second" in receive(page)["reason"]
        assert panel.registry.drain() == []


def test_only_so_many_pages(panel: ServerHarness) -> None:
    with panel.page_socket(), panel.page_socket():
        wait_until(lambda: len(panel.registry.pages) == 2, WITHIN_S, "two are in")
        with panel.page_socket() as third:
            assert closed(third) == 1013
    wait_until(lambda: panel.registry.pages == [], WITHIN_S, "they have left")
    with panel.page_socket() as again:
        again.send("?")
        assert receive(again)["k"] == "error", "their places are free"


def test_a_page_that_goes_before_it_is_let_in_takes_no_place(server: ServerHarness) -> None:
    async def receive() -> Message:
        return {"type": "websocket.connect"}

    async def send(_: Message) -> None:
        raise OSError("the connection is gone")

    registry, pass_ = PageRegistry(lambda: None, 2), Authenticator(TOKEN, server.port)
    headers = [(b"host", b"127.0.0.1:{port}"), *((k.encode(), v.encode()) for k, v in PAGE_HEADERS.items())]
    scope = {
        "type": "websocket",
        "path": "/socket",
        "query_string": b"",
        "subprotocols": [],
        "headers": [(name, value.replace(b"{port}", str(server.port).encode())) for name, value in headers],
    }
    with ThreadPoolExecutor() as beside:  # the main thread's event loop belongs to the browser of other tests
        beside.submit(lambda: asyncio.run(create_app(pass_, registry)(scope, receive, send))).result(WITHIN_S)
    assert registry.pages == []
