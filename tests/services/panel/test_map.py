"""The map of a real page: bodies of the world, moving ones, and the selected robot's laser scan."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect

from tests.services.panel.conftest import WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import wait_page

pytestmark = pytest.mark.usefixtures("anew")

BODIES = [
    {"name": "wall", "kind": "fixed", "colour": "#ff0000ff", "outlines": [[2, -1, 3, -1, 3, 1, 2, 1]]},
    {"name": "trolley", "kind": "moving", "colour": "#0000ffff", "outlines": [[-3, -1, -2, -1, -2, 1, -3, 1]]},
]


def pixel(page: Page, x: float, y: float) -> list[int]:
    """Redraw the map and return red, green and blue at a point of the world [m]."""
    found: list[int] = page.evaluate(
        """([x, y]) => {
          const map = window.elea.map, [px, py] = map.camera.toScreen(x, y), ratio = devicePixelRatio;
          map.dirty = true;
          map.draw();
          return [...map.canvas.getContext("2d").getImageData(px * ratio, py * ratio, 1, 1).data].slice(0, 3);
        }""",
        [x, y],
    )
    return found


@contextmanager
def without_messages(page: Page) -> Iterator[None]:
    """Keep the panel's messages from a page; in its first two seconds they fit the view to the robots again."""
    page.evaluate("() => { window.elea.link.receive = () => {}; }")
    yield
    page.evaluate("() => { delete window.elea.link.receive; }")


def emit(page: Page, kind: str, message: object) -> None:
    page.evaluate("([kind, text]) => window.elea.link.emit(kind, JSON.parse(text))", [kind, json.dumps(message)])


def test_the_first_look_is_at_the_robots_also_with_a_goal_being_set(pages: PageOpener) -> None:
    page = pages.open("robots")
    wait_page(lambda: page.evaluate("window.elea.map.fitted"), WITHIN_S, "a map")
    with without_messages(page):
        before = "{ poses: {}, fitted: false, touched: false, startEnds: undefined }"
        page.evaluate(f"() => {{ Object.assign(window.elea.map, {before}); window.elea.map.camera.x = 1000; }}")
        page.click("#goal-mode")
    wait_page(lambda: page.evaluate("window.elea.map.fitted"), WITHIN_S, "a map")
    assert abs(page.evaluate("window.elea.map.camera.x")) < 10
    page.keyboard.press("Escape")


def test_the_world_of_the_fleet_is_on_the_map_and_its_cart_moves(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    bodies = "window.elea.map.world.bodies?.map(({ name, kind, colour }) => [name, kind, colour])"
    wait_page(
        lambda: page.evaluate(bodies) == [["crate", "fixed", "#cc331aff"], ["cart", "moving", "#999999ff"]],
        WITHIN_S,
        "the bodies of the world",
    )
    cart = "window.elea.map.world.moving.get('cart').outlines[0][0]"
    before = page.evaluate(cart)
    wait_page(lambda: abs(page.evaluate(cart) - before) > 0.3, WITHIN_S, "the cart has moved")
    page.click("button:has-text('Fit')")
    crate = pixel(page, 0.2, 5.3)
    assert crate[0] > crate[2] + 50


def test_bodies_are_drawn_in_their_colours_and_what_moves_moves(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    wait_page(
        lambda: page.evaluate("Object.keys(window.elea.map.poses).length === 3"), WITHIN_S, "the robots are there"
    )
    with without_messages(page):
        ground = pixel(page, 2.37, 0.63)
        emit(page, "world", {"bodies": BODIES})
        page.click("button:has-text('Fit')")
        # Drawn a moment ago for the view before, what stands is moved along, and drawn for this one in a later frame.
        wait_page(lambda: page.evaluate("!window.elea.map.dirty"), WITHIN_S, "a drawing for this view")
        red, blue = pixel(page, 2.37, 0.63), pixel(page, -2.37, 0.63)
        assert red[0] > red[1] + 80, "a body in its colour"
        assert blue[2] > blue[1] + 80
        copies = "() => { const { world } = window.elea.map; world.copy.getContext('2d').clearRect(0, 0, 9999, 9999); }"
        page.evaluate(copies)
        assert pixel(page, 2.37, 0.63) == ground, "what stands is copied from a drawing made once for this view"
        page.evaluate("() => { window.elea.map.camera.pan(1, 0); }")
        wait_page(lambda: pixel(page, 2.37, 0.63) == red, WITHIN_S, "another view is drawn")
        page.evaluate(
            "() => { const { camera } = window.elea.map; camera.zoom(0.9, camera.width / 2, camera.height / 2); }"
        )
        assert pixel(page, 2.37, 0.63) == red, "at once: the drawing that is there shrinks"
        page.click("button:has-text('Fit')")
        emit(page, "bodies", {"outlines": {"trolley": [[-3, 1.1, -2, 1.1, -2, 1.6, -3, 1.6]]}})
        assert pixel(page, -2.37, 0.63) == ground
        assert pixel(page, -2.37, 1.37) == blue
        page.click("#theme")
        wait_page(lambda: pixel(page, 2.37, 0.63) != red, WITHIN_S, "the theme shines through")
        near = "window.elea.map.world.cornersNear([[0, 0]], 2.5).length"
        assert page.evaluate(near) == 8, "a small world is shown whole"
        tower = {"name": "tower", "kind": "fixed", "colour": "#ff0000ff", "outlines": [[90, 0, 91, 0, 91, 1]]}
        emit(page, "world", {"bodies": [*BODIES, tower]})
        assert page.evaluate(near) == 4, "of a large one what is near"


def test_the_laser_of_the_chosen_robot_is_shown_while_it_is_wanted(fleet: PanelFleet, pages: PageOpener) -> None:
    """The other robots stand 1 m and 2 m beside it."""
    page = pages.open("robots")
    scan = "window.elea.map.world.scan"
    wait_page(lambda: page.evaluate(f"{scan}?.ns") == "/tb3_0", WITHIN_S, "what the first robot sees")
    points: list[float] = page.evaluate(f"{scan}.points")
    assert len(points) >= 20
    assert all(abs(abs(y) - 1) < 0.25 and abs(x) < 0.25 for x, y in zip(points[::2], points[1::2], strict=True))
    page.click("[data-robot='/tb3_2'] .pick")
    wait_page(lambda: page.evaluate(f"{scan}?.ns") == "/tb3_2", WITHIN_S, "what the third sees")
    page.click("#laser")
    expect(page.locator("#laser")).to_have_attribute("aria-pressed", "false")
    assert page.evaluate(scan) is None
    page.click("#laser")
    wait_page(lambda: page.evaluate(f"{scan}?.ns") == "/tb3_2", WITHIN_S, "and again")


def test_what_programs_draw_is_on_the_map(fleet: PanelFleet, pages: PageOpener) -> None:
    page = pages.open("robots")
    wait_page(
        lambda: page.evaluate("Object.keys(window.elea.map.poses).length === 3"), WITHIN_S, "the robots are there"
    )
    page.click("button:has-text('Fit')")
    ground = pixel(page, -2.37, 0.63)
    area = {"id": "/a area 0", "kind": "area", "colour": "#00ff00ff", "outlines": [[-3, 0, -2, 0, -2, 1, -3, 1]]}
    line = {"id": "/a line 0", "kind": "line", "colour": "#ff0000ff", "width": 0.2, "outlines": [[-3, 0.63, -2, 0.63]]}
    emit(page, "markers", {"first": True, "shapes": [line, area], "gone": []})
    assert pixel(page, -2.37, 0.63) == [255, 0, 0], "lines lie above areas"
    assert pixel(page, -2.37, 0.3) == [0, 255, 0]
    emit(page, "markers", {"first": False, "shapes": [], "gone": ["/a line 0"]})
    assert pixel(page, -2.37, 0.63) == [0, 255, 0]
    emit(page, "markers", {"first": True, "shapes": [], "gone": []})
    assert pixel(page, -2.37, 0.63) == ground
