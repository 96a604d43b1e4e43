"""Plots in a real browser: the stretch of time that they show, what is saved of it, and which plots come back."""

from __future__ import annotations

import json

from playwright.sync_api import Locator, Page, expect

from tests.harness.waiting import wait_until
from tests.services.panel.conftest import WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import exported_csv

SHOWN = "() => [...document.querySelectorAll('.plot')].map(each => each.querySelectorAll('.chip').length)"


def times(page: Page, plot: Locator) -> tuple[float, float]:
    """First and last time of what the plot saves."""
    page.wait_for_timeout(500)  # Chromium refuses a page that offers many files at once
    rows = exported_csv(page, plot)[1:]
    return float(rows[0].split(",")[0]), float(rows[-1].split(",")[0])


def stands(page: Page, shown: Locator) -> bool:
    """Whether something has had its place for a while: what comes later on may still move it."""
    before = shown.bounding_box()
    page.wait_for_timeout(400)
    return before == shown.bounding_box()


def dragged(page: Page, over: Locator) -> bool:
    """Whether a drag over the middle half met the plot where it was when the drag began; if not, it is taken back.

    Like a hand, it rests before it presses: the plots go on meanwhile.
    """
    if not stands(page, over):
        return False
    box = over.bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.25 * box["width"], y)
    page.wait_for_timeout(1000)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], y, steps=5)
    drawn = page.evaluate("() => [...document.querySelectorAll('.u-select')].map(each => each.offsetWidth > 0)")
    page.mouse.up()
    if over.bounding_box() == box:
        assert drawn == [True, False], "the stretch is drawn where it is dragged, and there alone"
        return True
    over.dblclick()
    return False


def test_a_drag_zooms_the_wheel_widens_and_a_double_click_returns(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    page.select_option("#plots-window", "5")
    plot = page.locator(".plot").first
    over = plot.locator(".u-over")
    wait_until(
        lambda: (lambda t: t[1] - t[0] > 6)(times(page, plot)), 2 * WITHIN_S, "more samples than the window shows"
    )
    wait_until(lambda: dragged(page, over), 2 * WITHIN_S, "a drag over a layout that stands")
    first, last = times(page, plot)
    assert 2.0 < last - first <= 2.51, "half of the five seconds"
    over.hover()
    page.mouse.wheel(0, 100)
    wait_until(lambda: (lambda t: t[1] - t[0] > last - first + 0.2)(times(page, plot)), WITHIN_S, "a wider view")
    over.dblclick()
    expect(page.locator("button:has-text('Follow')")).to_be_disabled()
    wait_until(lambda: (lambda t: t[1] > last + 2 and t[1] - t[0] > 6)(times(page, plot)), WITHIN_S, "it follows again")


def test_plots_come_back_but_not_those_of_another_fleet(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    expect(page.locator(".chip")).to_have_count(6)
    remember = "plots => localStorage.setItem('elea.plots', plots)"
    page.evaluate(remember, json.dumps([[["/tb3_1/odom", "pose.pose.position.y"]], [["/gone", "data"]]]))
    page.reload()
    wait_until(lambda: page.evaluate(SHOWN) == [1, 1], WITHIN_S, "the plots of last time")
    page.evaluate(remember, json.dumps([[["/robot_control/reference", "data"]]]))
    page.reload()
    wait_until(lambda: page.evaluate(SHOWN) == [3, 3], WITHIN_S, "those that fit this fleet")
