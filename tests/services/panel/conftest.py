"""One fleet with a panel and one headless Chromium, shared by the tests of this folder that need them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Error, Page, expect, sync_playwright

from messages.elea import BaseStatus, FleetState, ProcessState
from messages.geometry import Pose, PoseStamped
from messages.names import Identity
from messages.nav import Odometry
from messages.requests import RESET_WORLD, WORLD_PROPERTIES
from messages.std import Empty, Header
from messages.topics import BASE_STATUS, FLEET_STATE, GOAL_POSE, GROUND_TRUTH
from services.panel.address import Address, read_address
from services.panel.auth import Authenticator
from services.panel.pages import PageRegistry
from services.panel.server import Server, create_app, listen
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.ports import free_port
from tests.harness.processes import Process
from tests.harness.waiting import wait_until
from tests.services.panel.hub_harness import HubHarness, hub_harness
from tests.services.panel.page_actions import wait_page
from tests.services.panel.server_harness import TOKEN, ServerHarness

STARTS = {"/tb3_0": 0.0, "/tb3_1": 1.0, "/tb3_2": -1.0}
"""y of each robot's start [m]; x is 0 and all face along x."""
ROBOTS = tuple(STARTS)
FAR = 50.0
"""Distance [m] that no robot covers within a test, however slow the page is."""
START_S = 120.0
WITHIN_S = 60.0
"""Wall time limit for what takes a second or two on an idle machine."""


class PanelFleet:
    """A fleet, from a file beside this one, under the real supervisor, with its panel and a node of the test.

    ``robots``: namespaces of the robots that drive; ``size``: number of processes.
    """

    def __init__(self, folder: Path, file: str = "fleet.toml", robots: tuple[str, ...] = ROBOTS, size: int = 8) -> None:
        self.folder, self.port = folder, free_port()
        self._file, self._robots, self._size = Path(__file__).with_name(file), robots, size
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        command = [
            "-m",
            "deploy",
            "up",
            str(self._file),
            "--report",
            str(self.folder / "run"),
            "--port",
            str(self.port),
        ]
        state = {"XDG_STATE_HOME": str(self.folder / "state")}
        self.up = self._stack.enter_context(
            Process([*command, "--no-view", "--no-picture"], self.folder / "up.log", state)
        )
        self.node = self._stack.enter_context(self.join("tester"))
        self._state = self.node.subscribe(FLEET_STATE)
        self._truth = {robot: self.node.subscribe(GROUND_TRUTH, f"{robot}/ground_truth") for robot in self._robots}
        self._base = {robot: self.node.subscribe(BASE_STATUS, f"{robot}/base_status") for robot in self._robots}
        self.processes: dict[str, ProcessState] = {}
        self.truth: dict[str, Odometry] = {}
        self.base: dict[str, BaseStatus] = {}
        self.wait(self._all_ready, START_S)
        self.wait(lambda: len(self.truth) == len(self.base) == len(self._robots))
        wait_until(lambda: read_address(self.folder / "run" / "panel.json"), WITHIN_S, "the panel's address")
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    @contextmanager
    def join(self, name: str) -> Iterator[Node]:
        """Run a node on the fleet's network."""
        identity = Identity.of(name)
        with (
            ZenohTransport(configuration("direct", (self.endpoint,))) as transport,
            Node(transport, identity, "tester", Log(identity.node)) as node,
        ):
            yield node

    @property
    def endpoint(self) -> str:
        return router_endpoint(self.port)

    @property
    def address(self) -> Address:
        address = read_address(self.folder / "run" / "panel.json")
        assert address is not None
        return address

    def poll(self) -> None:
        """Read new messages."""
        assert self.up.status is None, self.up.text
        self.node.update_subscribers()
        for state, _ in self._state.messages:
            assert isinstance(state, FleetState)
            self.processes = {each.name: each for each in state.processes}
        for robot in self._robots:
            for truth, _ in self._truth[robot].messages:
                self.truth[robot] = truth
            for base, _ in self._base[robot].messages:
                self.base[robot] = base

    def wait(self, probe: object, within: float = WITHIN_S, what: str = "") -> None:
        """Poll the fleet until a condition holds."""
        assert callable(probe)

        def looked() -> object:
            self.poll()
            return probe()

        wait_until(looked, within, what)

    def speed(self, robot: str) -> float:
        return self.truth[robot].twist.twist.linear.x

    def is_standing(self, robot: str) -> bool:
        twist = self.truth[robot].twist.twist
        return abs(twist.linear.x) < 0.005 and abs(twist.angular.z) < 0.02

    def is_moving(self, robot: str) -> bool:
        return abs(self.speed(robot)) > 0.05

    @contextmanager
    def driving(self, robot: str) -> Iterator[None]:
        """Make a robot drive straight ahead during the block, and back to its start afterwards."""
        goals = self.node.advertise(GOAL_POSE, f"{robot}/goal_pose")
        wait_until(lambda: goals.has_subscribers, WITHIN_S, f"who takes the goals of {robot}")
        goals.publish(goal(FAR, STARTS[robot]))
        self.wait(lambda: self.is_moving(robot), what=f"{robot} sets out")
        try:
            yield
        finally:
            goals.publish(goal(0.0, STARTS[robot]))
            self.node.unregister(goals)

    @property
    def factor(self) -> float:
        """The factor of time that the simulation keeps to."""
        return self.node.call(WORLD_PROPERTIES, Empty(), WITHIN_S).factor

    def reset_world(self) -> None:
        """Reset all robots to their spawn poses and wait until they stand still."""
        self.node.call(RESET_WORLD, Empty(), WITHIN_S)
        self.wait(lambda: all(map(self.is_standing, self._robots)))

    def _all_ready(self) -> bool:
        return len(self.processes) == self._size and all(each.state == "ready" for each in self.processes.values())


def goal(x: float, y: float) -> PoseStamped:
    """Return a goal in the world frame, facing along x."""
    return PoseStamped(header=Header(frame_id="world"), pose=Pose.planar(x, y, 0.0))


@pytest.fixture(scope="package")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PanelFleet]:
    with PanelFleet(tmp_path_factory.mktemp("panel")) as watched:
        yield watched


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    expect.set_options(timeout=WITHIN_S * 1000)
    # In a process of its own, what draws may crash without the browser.
    flags = ["--no-sandbox", "--disable-gpu"]
    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path="/usr/bin/chromium", args=flags)
        yield opened
        opened.close()


class PageOpener:
    """Opens pages at an address, each in a browser context of its own, and collects their errors.

    A test's first page is that of the previous test in its file, in the state in which that left it: loading the panel
    again takes two thirds of a second of processor time. With ``new`` it is loaded again with empty storage, with
    ``plots`` with only these stored; with ``own`` it is another page, for a test that closes it or leaves it busy.
    """

    def __init__(self, browser: Browser, url: str, kept: list[Page]) -> None:
        self._browser, self._url, self._kept = browser, url, kept
        parts = urlsplit(url)
        self._origin = f"{parts.scheme}://{parts.netloc}"
        self._first: Page | None = None
        self._is_loaded = self._is_taken = False
        self._contexts: list[BrowserContext] = []
        self._errors: list[str] = []

    def open(self, view: str, width: int = 1440, height: int = 900, **page: Any) -> Page:
        """Open one of the panel's tabs, connected; ``page`` is ``new``, ``own`` or ``plots``, as for ``load``."""
        opened = self.load(width, height, **page)
        opened.click(f"#tab-{view}")
        wait_page(lambda: ":" in opened.locator("#clock").inner_text(), WITHIN_S, "the clock of the fleet")
        return opened

    def load(
        self, width: int = 1440, height: int = 900, new: bool = False, own: bool = False, plots: object = None
    ) -> Page:
        """Return the panel's page: the previous test's, or a newly loaded one."""
        if own or self._is_taken:
            self._contexts.append(self._browser.new_context())
            page = self._watch(self._contexts[-1].new_page())
        else:
            if self._first is None:
                self._first = self._watch(self._kept.pop() if self._kept else self._browser.new_context().new_page())
            page, self._is_taken = self._first, True
        page.set_viewport_size({"width": width, "height": height})
        if page is self._first and self._is_loaded:
            if not new and plots is None:
                return page
            page.evaluate("localStorage.clear()")
        if plots is not None:
            if not page.url.startswith(self._origin):
                page.goto(self._url)
            page.evaluate("plots => localStorage.setItem('elea.plots', plots)", json.dumps(plots))
        page.goto(self._url)
        self._is_loaded = self._is_loaded or page is self._first
        return page

    def end_test(self, failed: bool) -> None:
        """Close the other pages; fail if any reported an error. After a failed test the kept page is loaded again."""
        self._close_others()
        self._is_taken, self._is_loaded = False, self._is_loaded and not failed
        errors, self._errors = self._errors, []
        assert errors == []

    def close(self) -> None:
        """Close all pages but the kept one, which leaves the panel with its storage cleared."""
        self._close_others()
        if (page := self._first) is None:
            return
        page.remove_listener("pageerror", self._note_error)
        page.remove_listener("console", self._note_line)
        # At another origin its renderer process would end. A file without a link to an icon would make the browser look
        # for /favicon.ico, and the answer might be noted as an error of the next page.
        page.goto(f"{self._origin}/static/locked.html")
        page.evaluate("localStorage.clear()")
        page.context.clear_cookies()
        self._kept.append(page)

    def _close_others(self) -> None:
        for context in self._contexts:
            context.close()
        self._contexts.clear()

    def _watch(self, page: Page) -> Page:
        page.set_default_timeout(WITHIN_S * 1000)
        page.on("pageerror", self._note_error)
        page.on("console", self._note_line)
        return page

    def _note_error(self, error: Error) -> None:
        self._errors.append(str(error))

    def _note_line(self, line: ConsoleMessage) -> None:
        self._errors += [f"{line.text} ({line.location['url']})"] if line.type == "error" else []


@pytest.fixture(scope="package")
def kept_pages(browser: Browser) -> Iterator[list[Page]]:
    """The page that a PageOpener keeps for the next one, if any."""
    kept = list[Page]()
    yield kept
    for page in kept:
        page.context.close()


@contextmanager
def page_opener(browser: Browser, url: str, kept: list[Page]) -> Iterator[PageOpener]:
    """Yield an opener whose pages are closed at the end."""
    made = PageOpener(browser, url, kept)
    try:
        yield made
    finally:
        made.close()


@contextmanager
def one_test(opener: PageOpener, request: pytest.FixtureRequest) -> Iterator[PageOpener]:
    """Yield the opener to one of the tests that share it; fail if a page reported an error."""
    before = request.session.testsfailed
    yield opener
    opener.end_test(request.session.testsfailed > before)


@pytest.fixture(scope="module")
def opener(browser: Browser, fleet: PanelFleet, kept_pages: list[Page]) -> Iterator[PageOpener]:
    with page_opener(browser, fleet.address.url, kept_pages) as made:
        yield made


@pytest.fixture
def pages(opener: PageOpener, request: pytest.FixtureRequest) -> Iterator[PageOpener]:
    """Pages of the fleet's panel; the first is as the previous test left it, unless a new one is requested."""
    with one_test(opener, request) as made:
        yield made


@pytest.fixture
def anew(fleet: PanelFleet) -> None:
    """Start with all robots at their spawn poses."""
    fleet.reset_world()


@pytest.fixture
def at() -> Iterator[HubHarness]:
    """The panel's hub between pages and a robot, all in memory."""
    with hub_harness() as made:
        made.spin(0.1, tell=True)
        yield made


@pytest.fixture(scope="module")
def server() -> Iterator[ServerHarness]:
    registry, listening = PageRegistry(lambda: None, 2), listen(0)
    port = listening.getsockname()[1]
    gate = Authenticator(TOKEN, port)
    with Server(create_app(gate, registry), gate, listening, lambda: None, lambda: 0.1):
        yield ServerHarness(registry, port)


@pytest.fixture
def panel(server: ServerHarness) -> Iterator[ServerHarness]:
    yield server
    wait_until(lambda: server.registry.pages == [], WITHIN_S, "all pages have left")
    server.registry.drain()
