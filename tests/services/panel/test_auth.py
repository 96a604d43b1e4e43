"""Access control and the headers of every response, on a real server without a fleet."""

from __future__ import annotations

import socket
from contextlib import ExitStack, suppress

import psutil
import pytest
from websockets.exceptions import InvalidStatus

from services.panel.address import Address, one_time_url
from services.panel.auth import MAX_UNAUTHENTICATED
from tests.harness.waiting import wait_until
from tests.services.panel.server_harness import PAGE_HEADERS, TOKEN, ServerHarness


@pytest.mark.parametrize("path", ["/", f"/?token={TOKEN}", "/session", "/static/js/main.js", "/nothing", "/socket"])
def test_every_answer_carries_the_headers(panel: ServerHarness, path: str) -> None:
    headers = panel.get(path).headers
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
def test_only_what_lies_in_the_folder_of_the_page_is_served(panel: ServerHarness, path: str) -> None:
    answer = panel.get(path)
    assert answer.status in (400, 404)
    assert "compare_digest" not in answer.text
    assert "root:" not in answer.text


def test_the_page_has_nothing_inline(panel: ServerHarness) -> None:
    text = panel.get("/", cookie=PAGE_HEADERS["cookie"]).text
    assert "<style" not in text
    assert " style=" not in text
    assert " onclick=" not in text
    assert all("src=" in tag for tag in text.split("<script")[1:])


def test_the_address_opens_the_page_and_leaves_a_cookie_that_other_sites_cannot_use(panel: ServerHarness) -> None:
    answer = panel.get(f"/?token={TOKEN}")
    assert (answer.status, answer.headers["location"]) == (303, "/"), "the token stays in no history"
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"elea_panel_{panel.port}={TOKEN};")
    assert "httponly" in cookie.lower()
    assert "samesite=strict" in cookie.lower()
    kept = cookie.partition(";")[0]
    assert panel.get("/", cookie=kept).status == 200
    assert panel.get("/session", cookie=kept).text == "known"
    assert panel.get("/session").status == 401


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=forged", "/?token=%C3%A9", "/?token=%FF", "/?token[]=1"])
def test_without_the_token_the_page_stays_shut(panel: ServerHarness, path: str) -> None:
    answer = panel.get(path)
    assert answer.status == 401
    assert "set-cookie" not in answer.headers
    assert "./elea panel" in answer.text


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:{port}.evil.example", ""]
)
def test_a_foreign_host_gets_nothing(panel: ServerHarness, host: str) -> None:
    assert panel.get(f"/?token={TOKEN}", host=host).status == 403


def test_a_foreign_page_reads_nothing(panel: ServerHarness) -> None:
    assert panel.get(f"/?token={TOKEN}", origin="http://127.0.0.1:{next}").status == 403
    assert panel.get(f"/?token={TOKEN}", origin="http://127.0.0.1:{port}").status == 303


@pytest.mark.parametrize(
    ("headers", "reason"),
    [
        ({}, "of another origin"),
        ({"origin": PAGE_HEADERS["origin"]}, "the token is missing or old"),
        ({"cookie": PAGE_HEADERS["cookie"]}, "of another origin"),
        ({**PAGE_HEADERS, "origin": "http://evil.example"}, "of another origin"),
        ({**PAGE_HEADERS, "origin": "null"}, "of another origin"),
        ({**PAGE_HEADERS, "origin": "https://127.0.0.1:{port}"}, "of another origin"),
        ({**PAGE_HEADERS, "origin": "http://127.0.0.1:{next}"}, "of another origin"),
        ({**PAGE_HEADERS, "host": "evil.example"}, "this host name is not accepted"),
        ({**PAGE_HEADERS, "cookie": "elea_panel_{port}=forged"}, "the token is missing or old"),
        ({**PAGE_HEADERS, "cookie": "elea_panel_{next}=" + TOKEN}, "the token is missing or old"),
        ({**PAGE_HEADERS, "cookie": 'elea_panel_{port}="\\'}, "the token is missing or old"),
    ],
)
def test_a_socket_needs_host_origin_and_token(panel: ServerHarness, headers: dict[str, str], reason: str) -> None:
    with pytest.raises(InvalidStatus) as refused, panel.socket(**headers):
        pass
    response = refused.value.response
    assert response.status_code == 403
    assert reason in response.body.decode()
    assert panel.registry.pages == []
    assert panel.registry.drain() == []


def test_a_ticket_opens_the_page_once_and_the_token_is_not_in_it(
    panel: ServerHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    for headers in ({}, {"cookie": "elea_panel_{port}=forged"}, {**PAGE_HEADERS, "origin": "http://evil.example"}):
        assert panel.get("/ticket", "POST", **headers).status in (401, 403)
    assert panel.get("/ticket", cookie=PAGE_HEADERS["cookie"]).status == 405, "no page, picture or link asks by POST"
    address = Address(port=panel.port, token=TOKEN, pid=0)
    first, second = one_time_url(address), one_time_url(address)
    assert first != second
    assert TOKEN not in first
    assert first.startswith(f"http://127.0.0.1:{panel.port}/?once=")
    path = first[first.index("/?") :]
    opened = panel.get(path)
    assert (opened.status, opened.headers["location"]) == (303, "/")
    assert opened.headers["set-cookie"].startswith(f"elea_panel_{panel.port}={TOKEN};")
    assert panel.get(path).status == 401, "it counted once"
    monkeypatch.setattr("services.panel.auth.TICKET_S", -1.0)
    late = one_time_url(address)
    assert panel.get(late[late.index("/?") :]).status == 401, "it counted for a while"
    assert panel.get(second[second.index("/?") :]).status == 303
    with pytest.raises(OSError, match="rejected its own token"):
        one_time_url(Address(port=panel.port, token="another", pid=0))


def test_strangers_that_say_nothing_or_half_a_word_keep_nobody_out(
    panel: ServerHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.panel.auth.AUTH_TIMEOUT_S", 2.0)
    before = psutil.Process().num_fds()
    with ExitStack() as stack:
        strangers = [stack.enter_context(socket.create_connection(("127.0.0.1", panel.port))) for _ in range(200)]
        for each in strangers[::2]:
            with suppress(OSError):
                each.send(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
        assert panel.get("/session", cookie=PAGE_HEADERS["cookie"]).text == "known"
        with panel.page_socket() as page:
            wait_until(lambda: len(panel.registry.pages) == 1, 10.0, "a page among them")
            # Both ends of the strangers' and the page's connections are in this process.
            wait_until(
                lambda: psutil.Process().num_fds() <= before + 200 + 2 + MAX_UNAUTHENTICATED, 10.0, "few are kept"
            )
            wait_until(lambda: all(closed(each) for each in strangers), 12.0, "none is kept for long")
            assert panel.get("/session", cookie=PAGE_HEADERS["cookie"]).text == "known"
            assert page.ping().wait(60.0), "the page stays"


def closed(link: socket.socket) -> bool:
    """Whether the peer has closed a connection."""
    link.setblocking(False)
    try:
        return link.recv(1 << 16) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True
