"""Who comes in, and what every answer carries: a real server, without a fleet."""

from __future__ import annotations

import pytest
from websockets.exceptions import InvalidStatus

from tests.panel.desk import MINE, TOKEN, Desk


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
