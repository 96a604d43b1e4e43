"""Who comes in, what every answer carries, and what becomes of senseless words."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from starlette.testclient import TestClient, WebSocketDenialResponse, WebSocketTestSession
from starlette.websockets import WebSocketDisconnect

from services.panel.board import Board
from services.panel.guard import Pass
from services.panel.web import application
from services.panel.words import LARGEST, Want

TOKEN = "a-token-of-this-run-that-is-long-enough"
PORT = 8600
HERE = f"http://127.0.0.1:{PORT}"
HOST = {"host": f"127.0.0.1:{PORT}"}
MINE = {**HOST, "origin": HERE, "cookie": f"elea_panel_{PORT}={TOKEN}"}


class Desk:
    """The application, and the board that it fills."""

    def __init__(self) -> None:
        self.board = Board(lambda: None, 2)
        self.web = TestClient(application(Pass(TOKEN, PORT), self.board), base_url=HERE)


@pytest.fixture
def desk() -> Iterator[Desk]:
    made = Desk()
    with made.web:
        yield made


@pytest.mark.parametrize(
    "path", ["/", f"/?token={TOKEN}", "/session", "/static/js/main.js", "/nothing", "/static/../guard.py"]
)
def test_every_answer_carries_the_headers(desk: Desk, path: str) -> None:
    headers = desk.web.get(path).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-frame-options"] == "DENY"
    assert "server" not in headers


def test_the_page_has_nothing_inline(desk: Desk) -> None:
    text = desk.web.get(f"/?token={TOKEN}").text
    assert "<style" not in text
    assert " style=" not in text
    assert " onclick=" not in text
    assert all("src=" in tag for tag in text.split("<script")[1:])


def test_the_address_opens_the_page_and_leaves_a_cookie_that_other_sites_cannot_use(desk: Desk) -> None:
    answer = desk.web.get(f"/?token={TOKEN}")
    assert answer.status_code == 200
    cookie = answer.headers["set-cookie"].lower()
    assert cookie.startswith(f"elea_panel_{PORT}=")
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert desk.web.get("/").status_code == 200
    assert desk.web.get("/session").text == "known"


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=forged", "/?token=%C3%A9"])
def test_without_the_token_the_page_stays_shut(desk: Desk, path: str) -> None:
    answer = desk.web.get(path)
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers
    assert "./elea panel" in answer.text


@pytest.mark.parametrize("host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", "127.0.0.1:80", ""])
def test_a_foreign_host_gets_nothing(desk: Desk, host: str) -> None:
    assert desk.web.get(f"/?token={TOKEN}", headers={"host": host}).status_code == 403


@pytest.mark.parametrize(
    ("headers", "reason"),
    [
        ({}, "from elsewhere"),
        ({"origin": HERE}, "the token is missing or old"),
        ({"cookie": MINE["cookie"]}, "from elsewhere"),
        ({**MINE, "origin": "http://evil.example"}, "from elsewhere"),
        ({**MINE, "origin": "null"}, "from elsewhere"),
        ({**MINE, "origin": f"https://127.0.0.1:{PORT}"}, "from elsewhere"),
        ({**MINE, "origin": "http://127.0.0.1:8601"}, "from elsewhere"),
        ({**MINE, "host": "evil.example"}, "this host is not mine"),
        ({**MINE, "cookie": f"elea_panel_{PORT}=forged"}, "the token is missing or old"),
        ({**MINE, "cookie": f"elea_panel_8601={TOKEN}"}, "the token is missing or old"),
        ({**MINE, "cookie": 'elea_panel_8600="\\'}, "the token is missing or old"),
    ],
)
def test_a_socket_needs_host_origin_and_token(desk: Desk, headers: dict[str, str], reason: str) -> None:
    with (
        pytest.raises(WebSocketDenialResponse) as refused,
        desk.web.websocket_connect("/socket", headers={**HOST, **headers}),
    ):
        pass
    assert refused.value.status_code == 403
    assert reason in refused.value.text
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
    "[" * 2000,
    "\ud800".encode("utf-16", "surrogatepass").decode("utf-16", "replace"),
]


def test_senseless_words_are_refused_with_a_reason_and_counted(desk: Desk) -> None:
    with desk.web.websocket_connect("/socket", headers=MINE) as socket:
        for count, text in enumerate(WRONG, 1):
            socket.send_text(text)
            error = json.loads(socket.receive_text())
            assert error["k"] == "error"
            assert error["reason"]
            assert desk.board.pages[0].refused == count
        socket.send_bytes(b"\x00\xff")
        assert "only text" in json.loads(socket.receive_text())["reason"]
        socket.send_text("x" * (LARGEST + 1))
        assert "the limit is" in json.loads(socket.receive_text())["reason"]
        assert desk.board.heard() == [], "none of it reached the loop"
        socket.send_text('{"k":"want","channels":["log"]}')
        socket.send_text("?")
        socket.receive_text()
        assert [said for _, said in desk.board.heard()] == [Want(channels=("log",))]


def consume(socket: WebSocketTestSession) -> None:
    while True:
        socket.receive_text()


def test_a_page_that_makes_no_sense_is_closed(desk: Desk) -> None:
    with desk.web.websocket_connect("/socket", headers=MINE) as socket:
        for _ in range(51):
            socket.send_text("?")
        with pytest.raises(WebSocketDisconnect) as closed:
            consume(socket)
    assert closed.value.code == 1008


def test_a_page_that_talks_without_end_is_not_heard_out(desk: Desk) -> None:
    with desk.web.websocket_connect("/socket", headers=MINE) as socket:
        for _ in range(210):
            socket.send_text('{"k":"release"}')
        assert "messages a second" in json.loads(socket.receive_text())["reason"]


def test_only_so_many_pages(desk: Desk) -> None:
    with (
        desk.web.websocket_connect("/socket", headers=MINE),
        desk.web.websocket_connect("/socket", headers=MINE),
        desk.web.websocket_connect("/socket", headers=MINE) as third,
        pytest.raises(WebSocketDisconnect) as closed,
    ):
        third.receive_text()
    assert closed.value.code == 1013
