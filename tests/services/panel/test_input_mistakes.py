"""Input mistakes and unusual input on the page: wrong mouse buttons, keyboard instead of mouse, all screen sizes."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from messages.topics import GOAL_POSE, ODOM
from tests.harness.cases import case
from tests.harness.waiting import wait_until
from tests.services.panel.conftest import WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import wait_page, wait_text, watch_notes


@pytest.fixture(autouse=True)
def anew(fleet: PanelFleet) -> None:
    fleet.reset_world()


def on_map(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the screen position [pixels] of a point of the world [m]."""
    wait_page(lambda: page.evaluate("window.elea.map.fitted"), WITHIN_S, "a map")
    at = page.evaluate("([x, y]) => window.elea.map.camera.toScreen(x, y)", [x, y])
    box = page.locator("canvas.map").bounding_box()
    assert box is not None
    return box["x"] + at[0], box["y"] + at[1]


def test_the_first_button_alone_sends_a_goal_and_a_drag_says_its_heading(fleet: PanelFleet, pages: PageOpener) -> None:
    goals = fleet.node.subscribe(GOAL_POSE, "/tb3_0/goal_pose")
    page = pages.open("robots")
    page.click("[data-robot='/tb3_0']")
    page.click("#goal-mode")
    page.mouse.click(*on_map(page, 1.0, 0.5), button="right")
    page.mouse.click(*on_map(page, 1.0, 0.5), button="middle")
    notes = watch_notes(page)
    at, away = on_map(page, 0.2, -0.1), on_map(page, 0.2, 0.6)
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(*away, steps=5)
    page.mouse.up()
    [_] = wait_page(lambda: [each for each in notes() if "/tb3_0 is sent to" in each], WITHIN_S, "the reply")
    wait_until(lambda: (goals.update(), goals.messages)[1], WITHIN_S, "a goal")
    [(goal, _)] = goals.messages
    assert (goal.pose.position.x, goal.pose.position.y) == pytest.approx((0.2, -0.1), abs=0.02)
    assert goal.pose.orientation.yaw == pytest.approx(1.57, abs=0.1)
    fleet.node.unregister(goals)


def test_the_factor_of_time_is_set_and_seen(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    box = page.locator("#factor-set")
    expect(box).to_have_value("2")
    wait_text(page.locator("#factor"), r"^×(1\.[89]|2\.[01])", WITHIN_S)
    box.fill("0.5")
    box.press("Enter")
    wait_until(lambda: fleet.factor == 0.5, WITHIN_S, "the simulation is slower")
    wait_text(page.locator("#factor"), r"^×0\.[45]", WITHIN_S)
    box.fill("-1")
    box.press("Enter")
    expect(page.locator(".note.bad")).to_contain_text("factor")
    expect(box).to_have_value("0.5")
    box.fill("2")
    box.press("Enter")
    wait_until(lambda: fleet.factor == 2.0, WITHIN_S, "it is as it was")


def test_robots_and_graph_are_reached_by_keys(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    name = page.locator("[data-robot='/tb3_1'] .pick")
    name.focus()
    page.keyboard.press("Enter")
    expect(name).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".drive b")).to_have_text("Drive tb3_1")
    page.click("#tab-graph")
    page.locator("g.topic[data-topic='/tb3_1/odom']").focus()
    with fleet.join("passer_by") as node:  # the graph is redrawn, and the keyboard focus stays
        node.subscribe(ODOM, "/tb3_1/odom")
        expect(page.locator("g.node[data-node='/passer_by']").first).to_be_visible()
    page.keyboard.press("Enter")
    expect(page.locator(".details h2")).to_have_text("/tb3_1/odom")


def test_a_button_beside_figures_that_change_stays_the_same_button(fleet: PanelFleet, pages: PageOpener) -> None:
    """A button pressed while figures beside it are updated must still exist when it is released."""
    page = pages.open("graph")
    page.locator("g.topic[data-topic='/tb3_0/odom']").click()
    button = page.locator(".details button.link:has-text('/tb3_0/waypoint')")
    sent = page.locator(".fact:has-text('sent')")
    wait_text(sent, r"^sent\d+$", WITHIN_S)
    held, before = button.element_handle(), sent.inner_text()
    wait_page(lambda: sent.inner_text() != before, WITHIN_S, "other figures")
    assert held is not None
    assert held.evaluate("(each) => each.isConnected")
    button.click()
    expect(page.locator(".details h2")).to_have_text("/tb3_0/waypoint")


BACKGROUND = "(each) => getComputedStyle(each).backgroundColor"
ASKED = f"(each) => {{ each.click(); return [each.textContent, ({BACKGROUND})(each)]; }}"
"""Presses a button that asks once more, and returns its text and colour before it is as before, after 3 s."""
THEME = """(name) => {
  const probe = document.createElement("i");
  probe.style.backgroundColor = `var(--${name})`;
  document.body.append(probe);
  const colour = getComputedStyle(probe).backgroundColor;
  probe.remove();
  return colour;
}"""


def test_a_button_under_the_pointer_keeps_the_colours_that_its_words_are_read_on(pages: PageOpener) -> None:
    page = pages.open("plots")
    pressed = page.locator("#show-parameters")
    expect(pressed).to_have_attribute("aria-pressed", "true")
    pressed.hover()
    assert pressed.evaluate(BACKGROUND) == page.evaluate(THEME, "accent")
    page.hover("#reset")
    assert page.locator("#reset").evaluate(ASKED) == ["Sure?", page.evaluate(THEME, "warn")]


def test_on_a_phone_the_chosen_robot_is_in_sight(pages: PageOpener) -> None:
    page = pages.open("robots", 390, 844)
    for robot in ("/tb3_2", "/tb3_0"):
        page.evaluate("(robot) => window.elea.map.actions.select(robot)", robot)
        expect(page.locator(f"[data-robot='{robot}']")).to_be_in_viewport(ratio=0.95)


def test_what_stops_robots_is_whole_on_every_screen_also_when_they_are_stopped(pages: PageOpener) -> None:
    page = pages.open("robots")
    page.click("[data-robot='/tb3_1'] .stop")
    for text in ("STOPPED 1/3", "STOPPED"):
        expect(page.locator("#stop")).to_have_text(text)
        for width, height in ((390, 844), (800, 600), (1280, 720)):
            page.set_viewport_size({"width": width, "height": height})
            for button in ("#stop", "#stop-reset", "#pause", "#stick"):
                with case(width, height, button):
                    expect(page.locator(button)).to_be_in_viewport(ratio=1)
        page.click("#stop")
    page.click("#stop-reset")
    expect(page.locator("#stop")).to_have_text("STOP")


def test_the_first_look_is_at_everything(pages: PageOpener) -> None:
    page = pages.open("robots", 390, 844, new=True)
    shown = """() => {
      const { camera, robots, poses, fitted } = window.elea.map;
      return fitted && robots.map(({ ns }) => {
        const [x, y] = camera.toScreen(...poses[ns]);
        return x > 0 && y > 0 && x < camera.width && y < camera.height;
      });
    }"""
    wait_page(lambda: page.evaluate(shown) == [True] * 3, WITHIN_S, "all robots, also when the list has taken its room")
    scale = page.evaluate("window.elea.map.camera.scale")
    page.locator("canvas.map").hover()
    page.mouse.wheel(0, -200)
    wait_page(lambda: page.evaluate("window.elea.map.camera.scale") > scale, WITHIN_S, "nearer")
    near = page.evaluate("window.elea.map.camera.scale")
    page.evaluate("window.elea.map.setRobots(window.elea.map.robots)")
    assert page.evaluate("window.elea.map.camera.scale") == near, "what a hand has moved stays"
