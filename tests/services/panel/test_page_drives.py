"""Controls of the page in a real browser with real processes: drive and stop robots; pause, step and reset time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect

from messages.topics import CLOCK
from tests.harness.cases import case
from tests.harness.waiting import wait_until
from tests.services.panel.conftest import ROBOTS, WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import confirm, map_point, wait_page, wait_text, watch_notes

pytestmark = pytest.mark.usefixtures("anew")


def test_a_clicked_goal_makes_the_robot_go(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    page.click("[data-robot='/tb3_0']")
    wait_page(lambda: page.evaluate("window.elea.map.fitted"), WITHIN_S, "a map")
    with slow_time(fleet, page):  # the drive takes three seconds of simulation time, in which its state is to be seen
        page.click("#goal-mode")
        notes = watch_notes(page)
        page.locator("canvas.map").click(position=map_point(page, 0.6, 0.4))
        wait_page(lambda: "/tb3_0 is sent to (0.60 m, 0.40 m)" in notes(), WITHIN_S, "the reply")
        fleet.wait(lambda: fleet.is_moving("/tb3_0"), what="tb3_0 sets out")
        expect(page.locator("[data-robot='/tb3_0'] .state")).to_contain_text("driving 1 of 1")

    def there() -> bool:
        at = fleet.truth["/tb3_0"].pose.pose.position
        return abs(at.x - 0.6) < 0.05 and abs(at.y - 0.4) < 0.05

    fleet.wait(there, 2 * WITHIN_S, "tb3_0 at its goal")
    wait_text(page.locator("[data-robot='/tb3_0'] .state"), "finished", WITHIN_S)


@contextmanager
def slow_time(fleet: PanelFleet, page: Page) -> Iterator[None]:
    """Have simulation time go on at an eighth of this fleet's factor during the block."""
    set_factor(fleet, page, 0.25)
    try:
        yield
    finally:
        set_factor(fleet, page, 2.0)


def set_factor(fleet: PanelFleet, page: Page, factor: float) -> None:
    """Set the factor of time, and wait until the simulation keeps to it."""
    box = page.locator("#factor-set")
    box.fill(f"{factor:g}")
    box.press("Enter")
    wait_until(lambda: fleet.factor == factor, WITHIN_S, "another factor of time")


def test_a_stop_stops_all_until_it_is_reset(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    wait_page(lambda: page.evaluate("window.elea.map.fitted"), WITHIN_S, "a map")
    with fleet.driving("/tb3_1"):
        page.click("#stop")
        fleet.wait(lambda: all(fleet.base[robot].e_stopped for robot in ROBOTS), what="all bases stopped")
        fleet.wait(lambda: all(map(fleet.is_standing, ROBOTS)), what="all robots at rest")
        wait_text(page.locator("#stop"), "^STOPPED$", WITHIN_S)
        page.click("#stop-reset")
        fleet.wait(lambda: not any(fleet.base[robot].e_stopped for robot in ROBOTS), what="all bases free")
        fleet.wait(lambda: fleet.is_moving("/tb3_1"), what="tb3_1 goes on")
        page.click("[data-robot='/tb3_1'] .stop")
        fleet.wait(lambda: fleet.base["/tb3_1"].e_stopped and not fleet.base["/tb3_0"].e_stopped, what="one is stopped")
        expect(page.locator("#stop")).to_have_text("STOPPED 1/3")
        page.click("[data-robot='/tb3_1'] button:has-text('Reset')")
        fleet.wait(lambda: not fleet.base["/tb3_1"].e_stopped, what="it is free again")
        expect(page.locator("#stop")).to_have_text("STOP")


def hold(fleet: PanelFleet, page: Page, key: str) -> None:
    """Press and hold a key that drives the third robot, ahead or back, and wait until the base obeys."""
    ahead = -1 if key == "," else 1
    page.keyboard.down(key)
    fleet.wait(lambda: ahead * fleet.speed("/tb3_2") > 0.05, what="tb3_2 drives")
    fleet.wait(lambda: fleet.base["/tb3_2"].source == "/panel", what="the base obeys the panel")


def test_a_held_key_drives_and_the_robot_stops_when_the_hand_is_gone(fleet: PanelFleet, pages: PageOpener) -> None:
    """A key may come up as another (comma as semicolon), or a system key or a menu may swallow its release."""
    page = pages.open("robots")
    for end, key in (("key up", "w"), ("Shift", ","), ("view changes", "w"), ("Meta", ",")):
        with case(end):
            page.click("#tab-robots")
            page.click("[data-robot='/tb3_2']")
            hold(fleet, page, key)
            if end == "key up":
                page.keyboard.up(key)
            elif end == "view changes":
                page.click("#tab-log")
            else:
                page.keyboard.down(end)
                page.keyboard.up(key) if end == "Shift" else page.keyboard.up(end)
            fleet.wait(lambda: fleet.is_standing("/tb3_2"), what="tb3_2 stands")
            for each in (end, key) if end in ("Shift", "Meta") else (key,):
                page.keyboard.up(each)


def test_a_held_key_drives_no_more_when_its_page_is_gone(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots", own=True)
    session, paused = page.context.new_cdp_session(page), list[object]()
    session.on("Debugger.paused", lambda event: paused.append(event))
    page.click("[data-robot='/tb3_2']")
    for end, key in (("menu", ","), ("page hangs", "w"), ("page closes", ",")):
        with case(end):
            hold(fleet, page, key)
            if end == "menu":
                page.click("#views", button="right", position={"x": 400, "y": 300})
            elif end == "page hangs":
                session.send("Debugger.enable")
                session.send("Debugger.pause")  # at the page's next statement; each call receives events
                wait_until(lambda: session.send("Debugger.enable") and paused, what="a page that hangs")
            else:
                page.context.close()
            fleet.wait(lambda: fleet.is_standing("/tb3_2"), what="tb3_2 stands")
            if end == "page hangs":
                session.send("Debugger.resume")
            if end != "page closes":
                page.keyboard.up(key)


def test_the_stick_drives_while_it_is_held(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    page.click("[data-robot='/tb3_0']")
    box = page.locator("#stick").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0], box["y"] + box["height"] - 4, steps=4)
    fleet.wait(lambda: fleet.speed("/tb3_0") < -0.1, what="tb3_0 goes back")
    page.mouse.up()
    fleet.wait(lambda: fleet.is_standing("/tb3_0"), what="tb3_0 stands")


def test_time_is_paused_stepped_and_reset(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    clocks = fleet.node.subscribe(CLOCK)

    def clock() -> tuple[int, int, bool]:
        wait_until(lambda: (clocks.update(), clocks.messages)[1], WITHIN_S, "a clock")
        now = clocks.messages[-1][0]
        return now.tick, now.epoch, now.paused

    page.click("#pause")
    wait_until(lambda: clock()[2], WITHIN_S, "a pause")
    expect(page.locator("#pause")).to_have_text("Resume")
    expect(page.locator("#step")).to_be_enabled()
    before = clock()[0]
    page.select_option("#steps", "10")
    page.click("#step")
    wait_until(lambda: clock()[0] == before + 10, WITHIN_S, "ten steps")
    epoch = clock()[1]
    confirm(page.locator("#reset"))
    wait_until(lambda: clock()[1] == epoch + 1, WITHIN_S, "another epoch")
    page.click("#pause")
    wait_until(lambda: not clock()[2], WITHIN_S, "time goes on")
    fleet.node.unregister(clocks)
