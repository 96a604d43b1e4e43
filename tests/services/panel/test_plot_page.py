"""Plots in a real browser: the time range that they show, its export, and the plots restored on a reload."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from models.palette import COLOURS, Colour, colours
from tests.harness.processes import Process
from tests.services.panel.conftest import ROBOTS, WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import exported_csv, held_csv, wait_page

SHOWN = "() => [...document.querySelectorAll('.plot')].map(each => each.querySelectorAll('.chip').length)"


def times(plot: Locator) -> tuple[float, float]:
    """Return the first and last time [s] of the plot's CSV rows."""
    rows = held_csv(plot)[1:]
    return float(rows[0].split(",")[0]), float(rows[-1].split(",")[0])


def stands(page: Page, shown: Locator) -> bool:
    """Whether an element keeps its place for 0.4 s: what loads later may still move it."""
    before = shown.bounding_box()
    page.wait_for_timeout(400)
    return before == shown.bounding_box()


def dragged(page: Page, over: Locator) -> bool:
    """Drag over the middle half of a plot; return whether the plot was still there at the end, else undo the drag.

    It waits before it presses, as a user does: the plots keep moving meanwhile.
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


def test_plots_come_back_but_not_those_of_another_fleet(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    expect(page.locator(".chip")).to_have_count(6)
    remember = "plots => localStorage.setItem('elea.plots', plots)"
    page.evaluate(remember, json.dumps([[["/tb3_1/odom", "pose.pose.position.y"]], [["/gone", "data"]]]))
    page.reload()
    wait_page(lambda: page.evaluate(SHOWN) == [1, 1], WITHIN_S, "the plots of last time")
    page.evaluate(remember, json.dumps([[["/robot_control/reference", "data"]]]))
    page.reload()
    wait_page(lambda: page.evaluate(SHOWN) == [3, 3], WITHIN_S, "those that fit this fleet")


MAP_COLOUR = """ns => window.elea.map.colourOf(ns).match(/\\w\\w/g).map(each => parseInt(each, 16))"""
SWATCHES = """plot => [...plot.querySelectorAll(".chip .swatch")].map(each => {
  const { backgroundColor, backgroundImage } = getComputedStyle(each);
  const shown = backgroundImage === "none" ? backgroundColor : backgroundImage;
  return [...shown.match(/rgb\\((.*?)\\)/)[1].split(",").map(Number), backgroundImage];
})"""
"""Returns red, green, blue and the dash pattern of each line in the legend."""
AFTER_ROBOTS = f"""(plot, [robots, free]) => {{
  window.elea.link.emit("robots", {{ robots, free, all_stopped: false }});
  return ({SWATCHES})(plot);
}}"""
"""The same right after the page received a list of robots and the colours that are free."""


def legend(plot: Locator) -> list[tuple[Colour, str]]:
    """Return the colour and dash pattern of each line of a plot from its legend."""
    return swatches(plot.evaluate(SWATCHES))


def swatches(found: list[list[Any]]) -> list[tuple[Colour, str]]:
    return [((red, green, blue), dashes) for red, green, blue, dashes in found]


def test_lines_have_the_colours_of_their_robots_also_where_those_come_later(
    fleet: PanelFleet, pages: PageOpener
) -> None:
    robots = colours(each.strip("/") for each in ROBOTS)
    drawn = [
        ["/tb3_1/odom", "pose.pose.position.y"],
        ["/tb3_2/odom", "pose.pose.position.y"],
        *[["/tb3_1/ground_truth", f"pose.pose.position.{axis}"] for axis in "xyz"],
        *[["/tb3_1/odom", f"pose.pose.{part}"] for part in ("position.x", "orientation.z", "orientation.w")],
        ["/clock", "clock.sec"],
        ["/clock", "clock.nanosec"],
    ]
    page = pages.open("plots", plots=[drawn])
    plot = page.locator(".plot")
    expect(plot.locator(".chip")).to_have_count(len(drawn))
    wait_page(lambda: legend(plot)[0][0] == robots["tb3_1"], WITHIN_S, "the lines of a robot in its colour")
    lines = legend(plot)
    assert lines[1][0] == robots["tb3_2"]
    assert lines[1][0] == tuple(page.evaluate(MAP_COLOUR, "/tb3_2")), "as on the map"
    of_one = [lines[index] for index in (0, 2, 3, 4, 5)]
    assert {each for each, _ in of_one} == {robots["tb3_1"]}
    assert len(set(lines)) == len(lines), "every line is told apart"
    assert not {each for each, _ in lines[8:]} & set(robots.values()), "others have none of a robot's colours"
    assert {each for each, _ in lines[8:]} <= set(COLOURS)
    wait_page(lambda: plot.evaluate(DRAWN) > 0, WITHIN_S, "a line in the colour of the legend")
    told = page.evaluate("() => window.elea.map.robots")
    before = swatches(plot.evaluate(AFTER_ROBOTS, [[], ["#c10f27"]]))
    assert not {each for each, _ in before} & set(robots.values()), "no robots, and none of their colours"
    after = swatches(plot.evaluate(AFTER_ROBOTS, [told, ["#c10f27", "#c4ac26"]]))
    assert after[:8] == lines[:8], "painted again as the robots come"
    assert [each for each, _ in after[8:]] == [COLOURS[5], COLOURS[6]]


SCRIPT = """#!/usr/bin/env python
import math
import rospy
from probe_msgs.msg import Reading
from geometry_msgs.msg import Point

rospy.init_node("probe")
out, rate = rospy.Publisher("/probe/reading", Reading, queue_size=10), rospy.Rate(20)
while not rospy.is_shutdown():
    level = math.sin(8 * rospy.get_time())
    out.publish(Reading(None, level, [1, 2 * level], [Point(), Point(x=3)], [7, 8, 9], True, rospy.Time(2), "full"))
    rate.sleep()
"""
READING = """std_msgs/Header header
float64 level
float32[] cells
geometry_msgs/Point[] corners
uint8[3] raw
bool full
time due
string note
"""
DRAWN = """plot => {
  const [r, g, b] = getComputedStyle(plot.querySelector(".swatch")).backgroundColor.match(/\\d+/g).map(Number);
  const canvas = plot.querySelector("canvas");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const rows = new Set();
  for (let i = 0; i < data.length; i += 4)
    if (Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 24 && data[i + 3] > 200)
      rows.add(Math.floor(i / 4 / canvas.width));
  return rows.size;
}"""
"""Returns how many pixel rows have a pixel in the colour of the plot's first line."""


def complete_rows(plot: Locator) -> list[list[float]]:
    """Return the values of a plot's CSV rows that have one of each line."""
    rows = [row.split(",")[1:] for row in held_csv(plot)[1:]]
    return [[float(cell) for cell in row] for row in rows if "" not in row]


def test_numbers_that_only_a_script_has_a_type_for_are_drawn(
    fleet: PanelFleet, pages: PageOpener, tmp_path: Path
) -> None:
    package = tmp_path / "probe_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>probe_msgs</name></package>")
    (package / "msg/Reading.msg").write_text(READING)
    (package / "probe.py").write_text(SCRIPT)
    script = ["-m", "services.script", "--connect", fleet.endpoint, str(package / "probe.py")]
    with Process(script, tmp_path / "probe.log"):
        page = pages.open("plots", new=True)
        page.click("#add-plot")
        page.fill("input[placeholder='Filter topics']", "probe/reading")
        page.click("button.topic:has-text('reading')")
        fields = ("level", "cells[1]", "corners[1].x", "raw[2]", "full", "due.sec")
        for field in fields:
            page.click(f"button.leaf:has(span:text-is('{field}'))")
        plot = page.locator(".plot").last
        expect(plot.locator(".chip")).to_have_count(len(fields))
        wait_page(lambda: plot.evaluate(DRAWN) > 20, WITHIN_S, "a curve, which takes many rows of the picture")
        found = wait_page(lambda: complete_rows(plot), WITHIN_S, "a message with all fields, the last ones too")
        header = exported_csv(page, plot)[0]
        plot.locator("button[title='Remove this plot']").click()
    assert header == ",".join(["time [s]", *(f"/probe/reading {field}" for field in fields)])
    for level, second, *constant in found:
        assert second == pytest.approx(2 * level, abs=1e-5)
        assert constant == [3, 9, 1, 2]


def test_a_drag_zooms_the_wheel_widens_and_a_double_click_returns(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("plots")
    page.select_option("#plots-window", "5")
    plot = page.locator(".plot").first
    over = plot.locator(".u-over")
    wait_page(lambda: (lambda t: t[1] - t[0] > 6)(times(plot)), 2 * WITHIN_S, "more samples than the window shows")
    wait_page(lambda: dragged(page, over), 2 * WITHIN_S, "a drag over a layout that stands")
    first, last = times(plot)
    assert 2.0 < last - first <= 2.51, "half of the five seconds"
    over.hover()
    page.mouse.wheel(0, 100)
    wait_page(lambda: (lambda t: t[1] - t[0] > last - first + 0.2)(times(plot)), WITHIN_S, "a wider view")
    over.dblclick()
    expect(page.locator("button:has-text('Follow')")).to_be_disabled()
    wait_page(lambda: (lambda t: t[1] > last + 2 and t[1] - t[0] > 6)(times(plot)), WITHIN_S, "it follows again")
