"""Robots on the page, mostly a hundred, from messages of the test without a fleet: drawing, lists, keys."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from deploy.bench.figures import Figure
from tests.services.panel.conftest import PageOpener, page_opener
from tests.services.panel.server_harness import ServerHarness

ROBOTS = 100

TELL = """([count, turns]) => {
  const names = Array.from({ length: count }, (_, i) => `/tb3_${i}`);
  window.robots = names.map((ns, i) => ({ ns, model: "burger", radius: 0.105, drives: true, stops: true, goals: true,
    source: `${ns}/waypoint`, timed_out: false, stopped: i === 42, stopped_by: i === 42 ? ["/judge"] : [], asked: false,
    colliding: i === 17, collisions: 0, state: "driving", index: 0, colour: `hsl(${(i * 137) % 360} 60% 50%)`,
    plan: [[4.5 - (i % 10), Math.floor(i / 10) - 4.5]] }));
  window.told = 0;
  window.tell = () => {
    const t = 0.04 * window.told++;
    const at = {};
    names.forEach((ns, i) => {
      const x = (i % 10) - 4.5 + 0.4 * Math.cos(t + i) + 0.01 * t, y = Math.floor(i / 10) - 4.5 + 0.4 * Math.sin(t + i);
      at[ns] = [x, y, t + i + 1.57, x, y, t + i + 1.57, 0.22, 1];
    });
    window.elea.link.emit("poses", { at });
  };
  window.elea.link.emit("robots", { robots: window.robots, all_stopped: false });
  for (let turn = 0; turn < turns; turn++) window.tell();
}"""

DRAW = """() => {
  const map = window.elea.map, counts = { texts: 0, fills: 0, strokes: 0, points: 0, draws: 0 };
  const own = CanvasRenderingContext2D.prototype, kept = {};
  for (const [verb, count] of [["fillText", "texts"], ["fill", "fills"], ["stroke", "strokes"], ["lineTo", "points"]]) {
    kept[verb] = own[verb];
    own[verb] = function (...given) {
      if (this.canvas === map.canvas) counts[count]++;
      return kept[verb].apply(this, given);
    };
  }
  map.dirty = true;
  map.draw();
  Object.assign(own, kept);
  return counts;
}"""


@pytest.fixture(scope="module")
def opener(browser: Browser, server: ServerHarness, kept_pages: list[Page]) -> Iterator[PageOpener]:
    """Replaces the pages of a fleet with those of a server without one."""
    with page_opener(browser, server.url, kept_pages) as made:
        yield made


@pytest.fixture
def page(pages: PageOpener) -> Page:
    opened = pages.load()
    opened.click("#tab-robots")
    return opened


def test_what_a_drawing_takes_is_bounded_and_names_do_not_overlap(page: Page) -> None:
    page.evaluate(TELL, [ROBOTS, 20])
    few = page.evaluate(DRAW)
    page.evaluate("() => { for (let turn = 0; turn < 3000; turn++) window.tell(); }")
    many = page.evaluate(DRAW)
    assert many["fills"] == few["fills"], "one for each robot and point of a plan"
    assert many["fills"] < 2 * ROBOTS
    assert many["points"] < 2 * ROBOTS, "trails are kept in a picture of their own"
    lengths = "[...window.elea.map.trails.trails.values()].map((each) => each.length / 2)"
    assert page.evaluate(f"{lengths}.reduce((sum, each) => sum + each, 0)") <= 16_000, "of which the points are bounded"
    assert page.evaluate(f"Math.min(...{lengths})") > 80
    page.evaluate(
        """() => {
          const { map } = window.elea;
          map.camera.fit([[-300, -300], [300, 300]]);
          map.dirty = true;
          map.draw();
        }"""
    )
    assert page.evaluate("window.elea.map.named") < ROBOTS / 2, "names that would overlap are left out"
    page.evaluate("() => { const { map } = window.elea; map.fit(); map.draw(); }")
    assert page.evaluate("window.elea.map.named") == ROBOTS, "and are there where they have room"


def test_a_message_of_poses_causes_no_change_of_the_list(page: Page) -> None:
    page.evaluate(TELL, [ROBOTS, 5])
    changes = page.evaluate(
        """async () => {
          let changes = 0;
          const watched = new MutationObserver((seen) => { changes += seen.length; });
          await new Promise(requestAnimationFrame);
          const all = { subtree: true, childList: true, attributes: true, characterData: true };
          watched.observe(document.getElementById("robots"), all);
          window.elea.link.emit("robots", { robots: window.robots, all_stopped: false });
          window.tell();
          await new Promise((done) => setTimeout(done, 0));
          watched.disconnect();
          return changes;
        }"""
    )
    assert changes <= 2, "at most the pose of the selected robot"


def test_lists_of_a_hundred_are_filtered(page: Page) -> None:
    page.evaluate(TELL, [ROBOTS, 1])
    shown = page.locator("#robots .robot:visible")
    expect(shown).to_have_count(ROBOTS)
    assert page.locator("#robots .robot").nth(2).get_attribute("data-robot") == "/tb3_2"
    for text, count in (("tb3_4", 11), ("stopped", 1), ("touches", 1), ("TB3_99", 1), ("nothing", 0), ("", ROBOTS)):
        page.fill("input[placeholder='Filter robots']", text)
        expect(shown).to_have_count(count)
    page.click("#tab-processes")
    page.evaluate(
        """() => {
          const names = Array.from({ length: 100 }, (_, i) => `tb3_${i}/waypoint`);
          const processes = [...names, "sim", "router", "params", "panel", "grader"].map((name, i) => (
            { name, state: i === 7 ? "failed" : "ready", pid: 100 + i, restarts: 0, reason: "" }));
          window.elea.link.emit("fleet", { usage: {}, state: { fleet: "swarm", mode: "lockstep", processes } });
        }"""
    )
    listed = page.locator("[data-process]:visible")
    for text, count in (("failed", 1), ("tb3_1", 11), ("sim", 1), ("", 105)):
        page.fill("input[placeholder='Filter processes']", text)
        expect(listed).to_have_count(count)
    expect(page.locator("#view-processes .toolbar")).to_contain_text("105 processes")


def test_a_held_key_and_a_goal_do_not_pass_to_another_robot_when_theirs_is_gone(page: Page) -> None:
    page.evaluate(TELL, [2, 1])
    page.evaluate(
        """() => {
          window.sent = [];
          window.elea.link.send = (message) => window.sent.push(message);
        }"""
    )
    page.click("[data-robot='/tb3_0'] .pick")
    page.keyboard.down("w")
    assert page.evaluate("[window.sent.at(-1).k, window.sent.at(-1).robot]") == ["drive", "/tb3_0"]
    last, aim, chosen, count = page.evaluate(
        """() => {
          const { link, map } = window.elea;
          map.aim = { x: 1, y: 0, yaw: 0, px: 0, py: 0 };
          link.emit("robots", { robots: window.robots.slice(1), all_stopped: false });
          return [window.sent.at(-1).k, map.aim, map.selected, window.sent.length];
        }"""
    )
    assert (last, aim, chosen) == ("release", None, "/tb3_1")
    page.keyboard.up("w")
    assert page.evaluate("window.sent.length") == count, "the key has to be pressed again"
    page.evaluate("delete window.elea.link.send")


@pytest.mark.bench
def test_the_map_of_a_hundred_robots_is_drawn_15_times_a_second(
    page: Page, keeps_bound: Callable[[Figure], None]
) -> None:
    """Poses arrive at 25 Hz, as from the panel; counts drawings, in Chromium without a graphics card."""
    page.evaluate(TELL, [ROBOTS, 1500])
    count = """() => new Promise((done) => {
      const { map } = window.elea, draw = map.draw, begun = performance.now();
      let drawn = 0;
      map.draw = function () { if (this.dirty) drawn++; return draw.call(this); };
      const told = setInterval(window.tell, 40);
      setTimeout(() => {
        clearInterval(told);
        delete map.draw;
        done(1000 * drawn / (performance.now() - begun));
      }, 2000);
    })"""
    rates = tuple(float(page.evaluate(count)) for _ in range(5))
    about = "drawings of the map with a hundred robots that move"
    keeps_bound(Figure("map_drawings_per_s", "1/s", about, rates, at_least=15.0))
