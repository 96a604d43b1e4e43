"""The page in a real browser with real processes shows what happens: plots, graph, processes, log."""

from __future__ import annotations

import itertools
import re
from statistics import median

import pytest
from playwright.sync_api import expect

from tests.harness.processes import Process
from tests.services.panel.conftest import WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import (
    confirm,
    exported_csv,
    held_csv,
    legend_value,
    parameter_selector,
    set_slider,
    wait_page,
)

pytestmark = pytest.mark.usefixtures("anew")


def test_a_slider_changes_the_speed_and_the_plot_shows_it_on_both_pages(fleet: PanelFleet, pages: PageOpener) -> None:
    page, other = pages.open("plots"), pages.open("plots")
    line = "tb3_0/ground_truth twist.twist.linear.x"
    speed = parameter_selector(page, "/tb3_0/waypoint", "max_linear")
    for each in (page, other):
        each.fill("input[placeholder='Filter parameters']", "tb3_0/waypoint")
        expect(each.locator(f"{speed} input[type=number]")).to_have_value("0.22")
    with fleet.driving("/tb3_0"):
        fleet.wait(lambda: fleet.speed("/tb3_0") > 0.21, what="tb3_0 at its top speed")
        wait_page(lambda: (legend_value(page, line) or 0) > 0.21, WITHIN_S, "the plot shows it")
        set_slider(page, speed, 0.1)
        wait_page(
            lambda: abs((legend_value(page, line) or 0) - 0.1) < 0.005, WITHIN_S, "the plot shows the slower drive"
        )
    expect(other.locator(f"{speed} input[type=number]")).to_have_value("0.1")
    expect(other.locator(f"{speed} .origin")).to_have_text("run")

    box = other.locator(f"{speed} input[type=number]")
    box.fill("7")
    box.press("Enter")
    expect(other.locator(f"{speed} .reason")).to_contain_text(re.compile(r"max_linear.*7.*0\.02.*2"))
    expect(box).to_have_value("0.1")
    expect(page.locator(f"{speed} .reason")).to_be_hidden()

    page.click("details.set:has(.name:text-is('/tb3_0/waypoint')) button:has-text('Undo')")
    for each in (page, other):
        expect(each.locator(f"{speed} input[type=number]")).to_have_value("0.22")
    set_slider(other, speed, 0.15)
    expect(page.locator(f"{speed} input[type=number]")).to_have_value("0.15")
    page.click(f"{speed} button[title='Return to the value of the fleet file or the default']")
    expect(other.locator(f"{speed} input[type=number]")).to_have_value("0.22")


def test_axes_have_units_and_what_cannot_be_used_says_why(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    for index, unit in enumerate(("m/s", "rad/s")):
        expect(page.locator(".plot .ground").nth(index)).to_have_attribute("data-unit", unit)
    expect(page.locator("#step")).to_be_disabled()
    expect(page.locator("#step")).to_have_attribute("title", re.compile("Pause first"))
    page.click("#pause")
    expect(page.locator("#step")).to_be_enabled()
    page.click("#pause")
    expect(page.locator("#step")).to_be_disabled()


def test_processes_show_what_they_use_the_robots_own_first(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("processes")
    rows = page.locator("tr[data-process]")
    expect(rows.first).to_have_attribute("data-process", "tb3_0/waypoint")
    expect(rows.first.locator("td").nth(4)).to_have_text(re.compile(r"^\d+(\.\d)? %$"))
    expect(rows.first.locator("td").nth(5)).to_have_text(re.compile(r"^\d+ MiB$"))


def test_a_field_is_chosen_held_and_saved(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    page.click("#add-plot")
    page.fill("input[placeholder='Filter topics']", "/tb3_1/odom")
    page.click("button.topic")
    page.click("button.leaf:has-text('pose.pose.position.y')")
    page.click("button.leaf:has-text('pose.pose.orientation.yaw')")
    plot = page.locator(".plot").last
    expect(plot.locator(".chip")).to_have_count(2)
    expect(plot.locator(".chip .value").first).to_have_text(re.compile("^(1|0.99999|1.0000)"))
    wait_page(lambda: plot.locator("canvas").count() == 1, WITHIN_S, "it is drawn")
    wait_page(lambda: len(held_csv(plot)) > 50, WITHIN_S, "two seconds of samples")
    page.click("#plots-pause")
    rows = exported_csv(page, plot)
    assert rows[0] == "time [s],/tb3_1/odom pose.pose.position.y,/tb3_1/odom pose.pose.orientation.yaw"
    assert len(rows) > 50
    times = [float(row.split(",")[0]) for row in rows[1:]]
    assert times == sorted(times)
    periods = [(b - a) / 0.04 for a, b in itertools.pairwise(times)]
    assert periods == pytest.approx([round(each) for each in periods], abs=0.01)
    assert (min(map(round, periods)), median(map(round, periods))) == (1, 1), "25 Hz, but for what was lost on the way"


def test_who_dies_disappears(fleet: PanelFleet, pages: PageOpener, tmp_path: object) -> None:
    page = pages.open("graph")
    stray = Process(
        ["-m", "services", "waypoint", "--namespace", "/stray", "--connect", fleet.endpoint], fleet.folder / "stray.log"
    )
    with stray:
        node = page.locator("g.node[data-node='/stray/waypoint']")
        wait_page(lambda: node.first.is_visible(), WITHIN_S, "the node is on the graph")
        page.click("#tab-plots")
        page.click("#tab-graph")
        stray.kill()
        expect(node).to_have_count(0)


def test_rates_and_details_of_a_topic(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("graph")
    topic = page.locator("g.topic[data-topic='/tb3_0/odom']")
    topic.click()

    def agrees() -> bool:
        """Whether the rate is shown, after the count of lost messages if there are any."""
        lost = sum(int(each) for each in re.findall(r"(\d+) lost", page.locator(".details").inner_text()))
        before = f"{lost} lost · " if lost else ""
        return re.fullmatch(f"{before}2[3-7] Hz", topic.locator("text.num").text_content() or "") is not None

    wait_page(agrees, WITHIN_S, "25 Hz, and what was lost")
    expect(page.locator(".details")).to_contain_text("nav_msgs/Odometry")
    expect(page.locator(".details")).to_contain_text("25 promised")
    expect(page.locator(".details")).to_contain_text("/tb3_0/waypoint")


def test_a_process_is_stopped_started_and_restarted(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("processes")
    row = page.locator("[data-process='tb3_1/waypoint']")
    before = fleet.processes["tb3_1/waypoint"].pid
    confirm(row.locator("button:has-text('Restart')"))

    def reborn() -> bool:
        now = fleet.processes["tb3_1/waypoint"]
        return now.state == "ready" and now.pid != before

    fleet.wait(reborn, what="a new life")
    expect(row.locator(".badge")).to_have_text("ready")
    confirm(row.locator("button:has-text('Stop')"))
    expect(row.locator(".badge")).to_have_text("stopped")
    row.get_by_role("button", name="Start", exact=True).click()
    expect(row.locator(".badge")).to_have_text("ready")


def test_the_log_shows_what_was_said(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("log")
    expect(page.locator(".lines")).to_contain_text("the page is on")
    fleet.node.log.warn("a word for the panel")
    expect(page.locator(".lines .line.warn")).to_contain_text(["a word for the panel"])
    page.fill("input[placeholder='Filter by text or node']", "word for")
    expect(page.locator(".lines .line")).to_have_count(1)
    page.select_option(".log select", "8")
    expect(page.locator(".lines .line")).to_have_count(0)


def test_nothing_sticks_out_of_the_screen(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots", 390, 844, new=True)
    for width, height in ((390, 844), (1280, 720)):
        page.set_viewport_size({"width": width, "height": height})
        for view in ("robots", "plots", "graph", "processes", "log"):
            page.click(f"#tab-{view}")
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, view
            expect(page.locator("#stop")).to_be_in_viewport()
