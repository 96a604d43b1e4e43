"""The page in a real browser, before real processes: what is pressed there happens, and what happens is seen there."""

from __future__ import annotations

import itertools
import re
from time import monotonic

import pytest
from playwright.sync_api import Page, expect

from messages.topics import CLOCK
from tests.panel.conftest import ROBOTS, SOON_S, Pages, Watched
from tests.panel.widgets import drawn, parameter, saved, slide
from tests.processes import Process
from tests.waiting import until


@pytest.fixture(autouse=True)
def anew(fleet: Watched) -> None:
    fleet.begin_anew()


def point(page: Page, x: float, y: float) -> dict[str, float]:
    """Where a point of the world lies on the map."""
    at = page.evaluate("([x, y]) => window.elea.map.camera.toScreen(x, y)", [x, y])
    return {"x": at[0], "y": at[1]}


def test_a_clicked_goal_makes_the_robot_go(fleet: Watched, pages: Pages) -> None:
    page = pages.open("robots")
    page.click("[data-robot='/tb3_0']")
    until(lambda: page.evaluate("window.elea.map.fitted"), SOON_S, "a map")
    page.click("#goal-mode")
    page.locator("canvas.map").click(position=point(page, 0.6, 0.4))
    expect(page.locator(".note:has-text('/tb3_0 is sent to (0.60 m, 0.40 m)')")).to_be_visible()
    fleet.wait(lambda: fleet.moves("/tb3_0"), what="tb3_0 sets out")
    expect(page.locator("[data-robot='/tb3_0'] .state")).to_contain_text("driving 1 of 1")

    def there() -> bool:
        at = fleet.truth["/tb3_0"].pose.pose.position
        return abs(at.x - 0.6) < 0.05 and abs(at.y - 0.4) < 0.05

    fleet.wait(there, 2 * SOON_S, "tb3_0 at its goal")
    expect(page.locator("[data-robot='/tb3_0'] .state")).to_contain_text("finished")


def test_a_stop_stops_all_until_it_is_reset(fleet: Watched, pages: Pages) -> None:
    page = pages.open("robots")
    until(lambda: page.evaluate("window.elea.map.fitted"), SOON_S, "a map")
    page.click("[data-robot='/tb3_1']")
    page.click("#goal-mode")
    page.locator("canvas.map").click(position=point(page, 1.5, 1.0))
    fleet.wait(lambda: fleet.moves("/tb3_1"), what="tb3_1 sets out")
    page.click("#stop")
    fleet.wait(lambda: all(fleet.base[robot].e_stopped for robot in ROBOTS), what="all bases stopped")
    fleet.wait(lambda: all(map(fleet.stands, ROBOTS)), what="all robots at rest")
    expect(page.locator("#stop")).to_have_text("STOPPED")
    page.click("#stop-reset")
    fleet.wait(lambda: not any(fleet.base[robot].e_stopped for robot in ROBOTS), what="all bases free")
    fleet.wait(lambda: fleet.moves("/tb3_1"), what="tb3_1 goes on")
    page.click("[data-robot='/tb3_1'] .stop")
    fleet.wait(lambda: fleet.base["/tb3_1"].e_stopped and not fleet.base["/tb3_0"].e_stopped, what="one is stopped")
    expect(page.locator("#stop")).to_have_text("STOPPED 1/3")
    page.click("[data-robot='/tb3_1'] button:has-text('Reset')")
    fleet.wait(lambda: not fleet.base["/tb3_1"].e_stopped, what="it is free again")
    expect(page.locator("#stop")).to_have_text("STOP")


@pytest.mark.parametrize("end", ["key up", "page closes", "view changes", "page hangs"])
def test_a_held_key_drives_and_the_robot_stops_when_the_hand_is_gone(fleet: Watched, pages: Pages, end: str) -> None:
    page = pages.open("robots")
    page.click("[data-robot='/tb3_2']")
    page.keyboard.down("w")
    fleet.wait(lambda: fleet.moves("/tb3_2"), what="tb3_2 drives")
    fleet.wait(lambda: fleet.base["/tb3_2"].source == "/panel", what="the base obeys the panel")
    if end == "key up":
        page.keyboard.up("w")
    elif end == "page closes":
        page.context.close()
    elif end == "view changes":
        page.click("#tab-log")
    else:
        page.evaluate("setTimeout(() => { const end = Date.now() + 4000; while (Date.now() < end); }, 0)")
    fleet.wait(lambda: fleet.stands("/tb3_2"), 3.5, "tb3_2 stands, long before a page that hangs comes back")


def test_the_stick_drives_while_it_is_held(fleet: Watched, pages: Pages) -> None:
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
    fleet.wait(lambda: fleet.stands("/tb3_0"), what="tb3_0 stands")


def test_a_slider_changes_the_speed_and_the_plot_shows_it_on_both_pages(fleet: Watched, pages: Pages) -> None:
    page, other = pages.open("plots"), pages.open("plots")
    line = "tb3_0/ground_truth twist.twist.linear.x"
    speed = parameter(page, "/tb3_0/waypoint", "max_linear")
    for each in (page, other):
        each.fill("input[placeholder='Filter parameters']", "tb3_0/waypoint")
        expect(each.locator(f"{speed} input[type=number]")).to_have_value("0.22")
    page.click("#tab-robots")
    page.click("[data-robot='/tb3_0']")
    until(lambda: page.evaluate("window.elea.map.fitted"), SOON_S, "a map")
    page.click("#goal-mode")
    page.locator("canvas.map").click(position=point(page, 2.5, 0.0))
    fleet.wait(lambda: fleet.speed("/tb3_0") > 0.21, what="tb3_0 at its top speed")
    page.click("#tab-plots")
    until(lambda: (drawn(page, line) or 0) > 0.21, SOON_S, "the plot shows it")
    slide(page, speed, 0.1)
    until(lambda: abs((drawn(page, line) or 0) - 0.1) < 0.005, SOON_S, "the plot shows the slower drive")
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
    slide(other, speed, 0.15)
    expect(page.locator(f"{speed} input[type=number]")).to_have_value("0.15")
    page.click(f"{speed} button[title='Take back what was set']")
    expect(other.locator(f"{speed} input[type=number]")).to_have_value("0.22")


def test_a_field_is_chosen_held_and_saved(fleet: Watched, pages: Pages) -> None:
    page = pages.open("plots")
    page.click("#add-plot")
    page.fill("input[placeholder='Filter topics']", "/tb3_1/odom")
    page.click("button.topic")
    page.click("button.leaf:has-text('pose.pose.position.y')")
    page.click("button.leaf:has-text('pose.pose.orientation.yaw')")
    plot = page.locator(".plot").last
    expect(plot.locator(".chip")).to_have_count(2)
    expect(plot.locator(".chip .value").first).to_have_text(re.compile("^(1|0.99999|1.0000)"))
    until(lambda: plot.locator("canvas").count() == 1, SOON_S, "it is drawn")
    fleet.look()
    began = fleet.truth["/tb3_1"].header.stamp.ns
    fleet.wait(lambda: fleet.truth["/tb3_1"].header.stamp.ns > began + 2_000_000_000, what="two seconds of samples")
    page.click("#plots-pause")
    rows = saved(page, plot)
    assert rows[0] == "time [s],/tb3_1/odom pose.pose.position.y,/tb3_1/odom pose.pose.orientation.yaw"
    assert len(rows) > 10
    times = [float(row.split(",")[0]) for row in rows[1:]]
    assert times == sorted(times)
    gaps = {round(b - a, 3) for a, b in itertools.pairwise(times)}
    assert gaps == {0.04}, "25 Hz of simulation time, none left out"


def test_who_dies_disappears_within_three_seconds(fleet: Watched, pages: Pages, tmp_path: object) -> None:
    page = pages.open("graph")
    stray = Process(
        ["-m", "services.waypoint", "--namespace", "/stray", "--connect", fleet.endpoint], fleet.folder / "stray.log"
    )
    with stray:
        node = page.locator("g.node[data-node='/stray/waypoint']")
        expect(node.first).to_be_visible()
        page.click("#tab-plots")
        page.click("#tab-graph")
        stray.kill()
        killed = monotonic()
        expect(node).to_have_count(0, timeout=3000)
        assert monotonic() - killed < 3.0


def test_rates_and_details_of_a_topic(fleet: Watched, pages: Pages) -> None:
    page = pages.open("graph")
    topic = page.locator("g.topic[data-topic='/tb3_0/odom']")
    expect(topic.locator("text.num")).to_have_text(re.compile(r"^2[3-7] Hz$"))
    topic.click()
    expect(page.locator(".details")).to_contain_text("nav_msgs/Odometry")
    expect(page.locator(".details")).to_contain_text("25 promised")
    expect(page.locator(".details")).to_contain_text("/tb3_0/waypoint")


def test_a_process_is_stopped_started_and_restarted(fleet: Watched, pages: Pages) -> None:
    page = pages.open("processes")
    row = page.locator("[data-process='tb3_1/waypoint']")
    before = fleet.processes["tb3_1/waypoint"].pid
    row.locator("button:has-text('Restart')").click()
    row.locator("button:has-text('Sure?')").click()

    def reborn() -> bool:
        now = fleet.processes["tb3_1/waypoint"]
        return now.state == "ready" and now.pid != before

    fleet.wait(reborn, what="a new life")
    expect(row.locator(".badge")).to_have_text("ready")
    row.locator("button:has-text('Stop')").click()
    row.locator("button:has-text('Sure?')").click()
    expect(row.locator(".badge")).to_have_text("stopped")
    row.get_by_role("button", name="Start", exact=True).click()
    expect(row.locator(".badge")).to_have_text("ready")


def test_time_is_paused_stepped_and_reset(fleet: Watched, pages: Pages) -> None:
    page = pages.open("robots")
    clocks = fleet.node.read(CLOCK)

    def clock() -> tuple[int, int, bool]:
        until(lambda: (clocks.admit(), clocks.batch)[1], SOON_S, "a clock")
        now = clocks.batch[-1][0]
        return now.tick, now.epoch, now.paused

    page.click("#pause")
    until(lambda: clock()[2], SOON_S, "a pause")
    expect(page.locator("#pause")).to_have_text("Resume")
    expect(page.locator("#step")).to_be_enabled()
    before = clock()[0]
    page.select_option("#steps", "10")
    page.click("#step")
    until(lambda: clock()[0] == before + 10, SOON_S, "ten steps")
    epoch = clock()[1]
    page.click("#reset")
    page.click("#reset")
    until(lambda: clock()[1] == epoch + 1, SOON_S, "another epoch")
    page.click("#pause")
    until(lambda: not clock()[2], SOON_S, "time goes on")
    fleet.node.forget(clocks)


def test_the_log_shows_what_was_said(fleet: Watched, pages: Pages) -> None:
    page = pages.open("log")
    expect(page.locator(".lines")).to_contain_text("the page is on")
    fleet.node.log.warn("a word for the panel")
    expect(page.locator(".lines .line.warn")).to_contain_text(["a word for the panel"])
    page.fill("input[placeholder='Filter: words or a node']", "word for")
    expect(page.locator(".lines .line")).to_have_count(1)
    page.select_option(".log select", "8")
    expect(page.locator(".lines .line")).to_have_count(0)


@pytest.mark.parametrize("size", [(390, 844), (1280, 720)])
def test_nothing_sticks_out_of_the_screen(fleet: Watched, pages: Pages, size: tuple[int, int]) -> None:
    page = pages.open("robots", *size)
    for view in ("robots", "plots", "graph", "processes", "log"):
        page.click(f"#tab-{view}")
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size[0], view
        expect(page.locator("#stop")).to_be_in_viewport()
