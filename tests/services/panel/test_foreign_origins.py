"""Unauthorised pages in a real browser: another origin, a stale or forged token, one page too many."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State
from websockets.sync.client import ClientConnection

from messages.topics import E_STOP
from services.panel import PanelParameters
from services.panel.address import Address
from tests.harness.cases import case
from tests.harness.waiting import wait_until
from tests.services.panel.conftest import ROBOTS, WITHIN_S, PanelFleet
from tests.services.panel.page_actions import wait_page
from tests.services.panel.page_client import page_client

SPEAK = """async (address) => {
  const said = await new Promise((done) => {
    const socket = new WebSocket(address);
    socket.onopen = () => { socket.send(JSON.stringify({ k: "estop", id: 1, on: true })); done("open"); };
    socket.onerror = () => done("refused");
  });
  const read = await fetch(address.replace("ws:", "http:").replace("socket", "session"), { credentials: "include" })
    .then((answer) => answer.text(), () => "unreadable");
  const blind = await fetch(address.replace("ws:", "http:").replace("socket", ""),
    { mode: "no-cors", credentials: "include" }).then((answer) => answer.type, () => "blocked");
  return [said, read, blind];
}"""
"""The attempts of a page of another origin: a WebSocket, a read, and a request without reading the response."""


class ForeignSite(BaseHTTPRequestHandler):
    """A page of another server on this machine; browsers send cookies of 127.0.0.1 to it, whatever the port."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>elsewhere</title>")

    def log_message(self, *_: object) -> None:
        """Log nothing."""


@pytest.fixture
def elsewhere() -> Iterator[int]:
    """The port of another server than the panel's."""
    with ThreadingHTTPServer(("127.0.0.1", 0), ForeignSite) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_address[1]
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def context(browser: Browser, fleet: PanelFleet) -> Iterator[BrowserContext]:
    """A browser context that has the panel's cookie."""
    with browser.new_context() as made:
        made.set_default_timeout(WITHIN_S * 1000)
        page = made.new_page()
        page.goto(fleet.address.url)
        expect(page.locator("#clock")).to_contain_text(":")
        page.close()
        yield made


@pytest.fixture
def page(context: BrowserContext) -> Iterator[Page]:
    """A page in that context; its cookies are restored after each test."""
    cookies = context.cookies()
    with context.new_page() as made:
        yield made
    context.clear_cookies()
    context.add_cookies(cookies)  # type: ignore[arg-type]


def nobody_is_stopped(fleet: PanelFleet) -> None:
    """Assert that no robot is stopped; first stop and reset one, so that no earlier stop can still be under way."""
    output = fleet.node.advertise(E_STOP, f"{ROBOTS[0]}/{E_STOP.name}")
    for on in (True, False):
        output.publish(E_STOP.record(data=on))
        fleet.wait(lambda on=on: fleet.base[ROBOTS[0]].e_stopped is on)
    fleet.node.unregister(output)
    assert not any(fleet.base[robot].e_stopped for robot in ROBOTS)


def test_a_page_of_another_origin_changes_and_reads_nothing(fleet: PanelFleet, page: Page, elsewhere: int) -> None:
    for host in ("127.0.0.1", "localhost"):
        with case(host):
            page.goto(f"http://{host}:{elsewhere}/")
            said, read, blind = page.evaluate(SPEAK, f"ws://127.0.0.1:{fleet.address.port}/socket")
            assert (said, read) == ("refused", "unreadable")
            assert blind in ("opaque", "blocked")
            nobody_is_stopped(fleet)


def test_a_page_cannot_be_put_into_a_frame_of_another(fleet: PanelFleet, page: Page, elsewhere: int) -> None:
    page.goto(f"http://127.0.0.1:{elsewhere}/")
    page.evaluate("(url) => { document.body.innerHTML = `<iframe src='${url}'></iframe>`; }", fleet.address.url)
    page.wait_for_selector("iframe")

    def refused() -> bool:
        page.wait_for_timeout(20)
        return len(page.frames) == 2 and page.frames[1].url.startswith("chrome-error:")

    wait_page(refused, WITHIN_S, "the browser shows its own page of an error")


def test_without_its_token_the_page_says_what_opens_it(fleet: PanelFleet, browser: Browser) -> None:
    parts = urlsplit(fleet.address.url)
    with browser.new_context() as context:
        page = context.new_page()
        for query in ("", "?token=forged-token-of-another-run-000000"):
            page.goto(f"{parts.scheme}://{parts.netloc}/{query}")
            expect(page.locator("body")).to_contain_text("./elea panel")
            assert page.locator("#stop").count() == 0
        assert context.cookies() == []


def test_a_token_that_no_longer_counts_changes_nothing_and_says_so(
    fleet: PanelFleet, context: BrowserContext, page: Page
) -> None:
    page.goto(f"http://127.0.0.1:{fleet.address.port}/")
    expect(page.locator("#clock")).to_contain_text(":")
    [cookie] = context.cookies()
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
    assert fleet.address.token not in page.url
    old = {"name": cookie["name"], "value": "a-token-of-an-earlier-run-0000000", "url": page.url.partition("#")[0]}
    context.add_cookies([old])  # type: ignore[list-item]
    page.evaluate("window.elea.link.socket.close()")
    expect(page.locator("#trouble")).to_contain_text("This page's token is no longer valid")
    page.click("#stop")
    expect(page.locator(".note.bad")).to_contain_text("not connected")
    nobody_is_stopped(fleet)
    page.goto(fleet.address.url)
    expect(page.locator("#trouble")).to_be_hidden()
    expect(page.locator("#clock")).to_contain_text(":")


class ClientCrowd:
    """As many pages as the panel accepts; pages dropped on a busy machine are replaced by ``fill``."""

    def __init__(self, stack: ExitStack, address: Address) -> None:
        self._stack, self._address = stack, address
        self._all: list[ClientConnection] = []

    @property
    def open(self) -> list[ClientConnection]:
        """The connected pages."""
        return [each for each in self._all if each.state is State.OPEN]

    @property
    def full(self) -> bool:
        """Whether the panel's limit of pages is reached."""
        return len(self.open) == PanelParameters().pages

    def fill(self) -> None:
        """Open pages up to the limit, also in place of earlier tests' pages that are still closing."""

        def filled() -> bool:
            while not self.full:
                self._all = [*self.open, self._stack.enter_context(page_client(self._address))]
            for each in self.open:
                with suppress(ConnectionClosed):
                    answered = each.ping()
                    wait_until(lambda a=answered, e=each: a.is_set() or e.state is not State.OPEN, WITHIN_S, "a pong")  # type: ignore[misc]
            return self.full

        wait_until(filled, WITHIN_S, "a full house")


def refused(page: Page) -> None:
    """Assert that the page shows why it was rejected, retries at growing intervals, and shows no data."""
    expect(page.locator("#trouble")).to_have_text("too many pages are open")
    wait_page(lambda: page.evaluate("window.elea.link.retry") > 1000, WITHIN_S, "it asks more and more seldom")
    expect(page.locator("#trouble")).to_have_text("too many pages are open")
    assert page.locator("#clock").inner_text() == "–"


def test_a_page_too_many_is_told_so_waits_and_comes_in_when_there_is_room(fleet: PanelFleet, page: Page) -> None:
    with ExitStack() as stack:
        crowd = ClientCrowd(stack, fleet.address)
        for last in (False, False, True):
            page.goto("about:blank")  # it may have come in, and would take one of their places
            crowd.fill()
            page.goto(fleet.address.url)
            try:
                refused(page)
                break
            except AssertionError:
                if last or crowd.full:
                    raise
    expect(page.locator("#clock")).to_have_text(re.compile(r"\d\d:\d\d"))
    expect(page.locator("#trouble")).to_be_hidden()
