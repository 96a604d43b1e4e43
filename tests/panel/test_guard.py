"""Who comes in, what every answer carries, and what becomes of senseless words: a real server, without a fleet."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http.client import HTTPConnection
from typing import Any, NamedTuple

import pytest
from starlette.types import Message
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from services.panel.board import Board
from services.panel.guard import Pass
from services.panel.server import Server, listen
from services.panel.web import application
from services.panel.words import LARGEST, Want
from tests.waiting import until

TOKEN = "a-token-of-this-run-that-is-long-enough"
SOON_S = 10.0


class Answer(NamedTuple):
    """Of the server; the names of ``headers`` are in lower case."""

    status: int
    headers: dict[str, str]
    text: str


class Desk:
    """The server, and the board that it fills. A ``{port}`` in a header stands for the server's."""

    def __init__(self, board: Board, port: int) -> None:
        self.board, self.port = board, port

    def get(self, path: str, **headers: str) -> Answer:
        """Ask for a path as it is written: no client tidies it up."""
        link = HTTPConnection("127.0.0.1", self.port, timeout=SOON_S)
        link.putrequest("GET", path, skip_host="host" in headers)
        for name, value in headers.items():
            link.putheader(name, self._filled(value))
        link.endheaders()
        with link.getresponse() as answer:
            return Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read().decode())

    @contextmanager
    def socket(self, host: str = "127.0.0.1:{port}", **headers: str) -> Iterator[ClientConnection]:
        """A socket with these headers, to this server whatever the host."""
        raw = socket.create_connection(("127.0.0.1", self.port), SOON_S)
        filled = {name: self._filled(value) for name, value in headers.items()}
        address = f"ws://{self._filled(host)}/socket"
        with connect(address, sock=raw, additional_headers=filled, compression=None, close_timeout=1) as made:
            yield made

    def mine(self) -> Any:
        """A socket of a page of this server."""
        return self.socket(origin="http://127.0.0.1:{port}", cookie="elea_panel_{port}=" + TOKEN)

    def _filled(self, text: str) -> str:
        return text.replace("{port}", str(self.port)).replace("{next}", str(self.port + 1))


@pytest.fixture(scope="module")
def server() -> Iterator[Desk]:
    board, listening = Board(lambda: None, 2), listen(0)
    port = listening.getsockname()[1]
    with Server(application(Pass(TOKEN, port), board), listening, lambda: None, lambda: 0.1):
        yield Desk(board, port)


@pytest.fixture
def desk(server: Desk) -> Iterator[Desk]:
    yield server
    until(lambda: server.board.pages == [], SOON_S, "all pages have left")
    server.board.heard()


def hear(page: ClientConnection) -> dict[str, Any]:
    told = json.loads(page.recv(timeout=SOON_S))
    assert isinstance(told, dict)
    return told


@pytest.mark.parametrize("path", ["/", f"/?token={TOKEN}", "/session", "/static/js/main.js", "/nothing", "/socket"])
def test_every_answer_carries_the_headers(desk: Desk, path: str) -> None:
    headers = desk.get(path).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-frame-options"] == "DENY"
    assert headers["cache-control"] == "no-store"
    assert "server" not in headers


@pytest.mark.parametrize(
    "path",
    [
        "/static/../guard.py",
        "/static/..%2fguard.py",
        "/static/%2e%2e/guard.py",
        "/static/js/../../guard.py",
        "/static//etc/passwd",
        "/static/%00",
        "/static/js",
        "/static/",
        "//etc/passwd",
    ],
)
def test_only_what_lies_in_the_folder_of_the_page_is_served(desk: Desk, path: str) -> None:
    answer = desk.get(path)
    assert answer.status in (400, 404)
    assert "compare_digest" not in answer.text
    assert "root:" not in answer.text


def test_the_page_has_nothing_inline(desk: Desk) -> None:
    text = desk.get(f"/?token={TOKEN}").text
    assert "<style" not in text
    assert " style=" not in text
    assert " onclick=" not in text
    assert all("src=" in tag for tag in text.split("<script")[1:])


def test_the_address_opens_the_page_and_leaves_a_cookie_that_other_sites_cannot_use(desk: Desk) -> None:
    answer = desk.get(f"/?token={TOKEN}")
    assert answer.status == 200
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"elea_panel_{desk.port}={TOKEN};")
    assert "httponly" in cookie.lower()
    assert "samesite=strict" in cookie.lower()
    kept = cookie.partition(";")[0]
    assert desk.get("/", cookie=kept).status == 200
    assert desk.get("/session", cookie=kept).text == "known"
    assert desk.get("/session").status == 401


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=forged", "/?token=%C3%A9", "/?token=%FF", "/?token[]=1"])
def test_without_the_token_the_page_stays_shut(desk: Desk, path: str) -> None:
    answer = desk.get(path)
    assert answer.status == 401
    assert "set-cookie" not in answer.headers
    assert "./elea panel" in answer.text


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:{port}.evil.example", ""]
)
def test_a_foreign_host_gets_nothing(desk: Desk, host: str) -> None:
    assert desk.get(f"/?token={TOKEN}", host=host).status == 403


def test_a_foreign_page_reads_nothing(desk: Desk) -> None:
    assert desk.get(f"/?token={TOKEN}", origin="http://127.0.0.1:{next}").status == 403
    assert desk.get(f"/?token={TOKEN}", origin="http://127.0.0.1:{port}").status == 200


MINE = {"origin": "http://127.0.0.1:{port}", "cookie": "elea_panel_{port}=" + TOKEN}


@pytest.mark.parametrize(
    ("headers", "reason"),
    [
        ({}, "from elsewhere"),
        ({"origin": MINE["origin"]}, "the token is missing or old"),
        ({"cookie": MINE["cookie"]}, "from elsewhere"),
        ({**MINE, "origin": "http://evil.example"}, "from elsewhere"),
        ({**MINE, "origin": "null"}, "from elsewhere"),
        ({**MINE, "origin": "https://127.0.0.1:{port}"}, "from elsewhere"),
        ({**MINE, "origin": "http://127.0.0.1:{next}"}, "from elsewhere"),
        ({**MINE, "host": "evil.example"}, "this host is not mine"),
        ({**MINE, "cookie": "elea_panel_{port}=forged"}, "the token is missing or old"),
        ({**MINE, "cookie": "elea_panel_{next}=" + TOKEN}, "the token is missing or old"),
        ({**MINE, "cookie": 'elea_panel_{port}="\\'}, "the token is missing or old"),
    ],
)
def test_a_socket_needs_host_origin_and_token(desk: Desk, headers: dict[str, str], reason: str) -> None:
    with pytest.raises(InvalidStatus) as refused, desk.socket(**headers):
        pass
    response = refused.value.response
    assert response.status_code == 403
    assert reason in response.body.decode()
    assert desk.board.pages == []
    assert desk.board.heard() == []


WRONG = [
    "",
    "x",
    "[]",
    "null",
    '{"k":"want"',
    '{"k":"explode"}',
    '{"k":"want","channels":["secrets"]}',
    '{"k":"want","more":1}',
    json.dumps({"k": "want", "series": [{"id": 1, "topic": "/a", "path": "__class__"}]}),
    json.dumps({"k": "want", "series": [{"id": 1, "topic": "no slash", "path": "x"}]}),
    json.dumps({"k": "want", "series": [{"id": n, "topic": "/a", "path": "x"} for n in range(33)]}),
    json.dumps({"k": "want", "fields": ["/a/*"]}),
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


def test_senseless_words_are_refused_with_a_reason_and_counted(desk: Desk) -> None:
    with desk.mine() as page:
        for count, text in enumerate(WRONG, 1):
            page.send(text)
            error = hear(page)
            assert (error["k"], bool(error["reason"])) == ("error", True), text
            assert desk.board.pages[0].refused == count
        page.send(b"\x00\xff")
        assert "only text" in hear(page)["reason"]
        assert desk.board.heard() == [], "none of it reached the loop"
        page.send('{"k":"want","channels":["log"]}')
        page.send("?")
        hear(page)
        assert [said for _, said in desk.board.heard()] == [Want(channels=("log",))]


def consume(page: ClientConnection) -> None:
    while True:
        page.recv(timeout=SOON_S)


def closed(page: ClientConnection) -> int:
    """The code with which the server closes, whatever it says before."""
    with pytest.raises(ConnectionClosed) as ended:
        consume(page)
    assert ended.value.rcvd is not None
    return ended.value.rcvd.code


def test_a_word_that_is_too_large_ends_the_page(desk: Desk) -> None:
    with desk.mine() as page:
        page.send("x" * (LARGEST + 1))
        assert closed(page) == 1009


def test_a_page_that_makes_no_sense_is_closed(desk: Desk) -> None:
    with desk.mine() as page:
        for _ in range(51):
            page.send("?")
        assert closed(page) == 1008


def test_a_page_that_talks_without_end_is_not_heard_out(desk: Desk) -> None:
    with desk.mine() as page:
        for _ in range(210):
            page.send('{"k":"release"}')
        assert "messages a second" in hear(page)["reason"]


def test_only_so_many_pages(desk: Desk) -> None:
    with desk.mine(), desk.mine():
        until(lambda: len(desk.board.pages) == 2, SOON_S, "two are in")
        with desk.mine() as third:
            assert closed(third) == 1013
    until(lambda: desk.board.pages == [], SOON_S, "they have left")
    with desk.mine() as again:
        again.send("?")
        assert hear(again)["k"] == "error", "their places are free"


def test_a_page_that_goes_before_it_is_let_in_takes_no_place(server: Desk) -> None:
    async def receive() -> Message:
        return {"type": "websocket.connect"}

    async def send(_: Message) -> None:
        raise OSError("the connection is gone")

    board, pass_ = Board(lambda: None, 2), Pass(TOKEN, server.port)
    headers = [(b"host", b"127.0.0.1:{port}"), *((k.encode(), v.encode()) for k, v in MINE.items())]
    scope = {
        "type": "websocket",
        "path": "/socket",
        "query_string": b"",
        "subprotocols": [],
        "headers": [(name, value.replace(b"{port}", str(server.port).encode())) for name, value in headers],
    }
    with ThreadPoolExecutor() as beside:  # the browser of other tests has the main thread's event loop
        beside.submit(lambda: asyncio.run(application(pass_, board)(scope, receive, send))).result(SOON_S)
    assert board.pages == []
