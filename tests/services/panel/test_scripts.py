"""The page's mathematics, run in a real browser's engine: histories, merging, CSV, the layout of the graph."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from tests.services.panel.conftest import page_opener
from tests.services.panel.server_harness import ServerHarness


@pytest.fixture(scope="module")
def page(browser: Browser, server: ServerHarness, kept_pages: list[Page]) -> Iterator[Page]:
    """One page for all tests, as none changes it permanently."""
    with page_opener(browser, server.url, kept_pages) as pages:
        yield pages.load()
        pages.end_test(failed=False)


def test_a_history_is_bounded_and_rises(page: Page) -> None:
    got: dict[str, Any] = page.evaluate(
        """async () => {
          const { Ring } = await import("/static/js/ring.js");
          const ring = new Ring(100);
          for (let i = 0; i < 1000; i++) ring.push([i * 0.01], [i]);
          ring.push([9.5, 9.99], [-1, -1]);
          const kept = [ring.length, ring.first, ring.last, ring.newest, ring.times[ring.at(9.5)], ring.times.length];
          ring.push([0.5], [7]);
          return { kept, anew: [ring.length, ring.first] };
        }"""
    )
    assert got["kept"][:5] == pytest.approx([100, 9.0, 9.99, 999, 9.5])
    assert got["kept"][5] <= 1024
    assert got["anew"] == [1, 0.5]


def test_what_rounds_to_zero_has_no_sign(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { twoDecimals } = await import("/static/js/dom.js");
          return [-0.0049, 0, -2.004, 0.996].map(twoDecimals);
        }"""
    )
    assert got == ["0.00", "0.00", "-2.00", "1.00"]


def test_lines_with_times_of_their_own_share_an_axis(page: Page) -> None:
    data, table = page.evaluate(
        """async () => {
          const { Ring } = await import("/static/js/ring.js");
          const { merged, csv } = await import("/static/js/merge.js");
          const a = new Ring(), b = new Ring();
          a.push([0, 1, 2, 10], [0, 10, 20, 100]);
          b.push([0.5, 1.5], [5, 6]);
          return [merged([a, b], 0, 20), csv(["a", 'b "quoted", too'], [a, b])];
        }"""
    )
    assert data[0] == [0, 0.5, 1, 1.5, 2, 10]
    assert data[1] == [0, 5, 10, 15, 20, 100], "between its samples, as it would be drawn alone"
    assert data[2] == [None, 5, 5.5, 6, None, None]
    assert table.split("\r\n")[:3] == ['time [s],a,"b ""quoted"", too"', "0.000000,0,", "0.500000,,5"]


def test_a_dense_line_is_thinned_for_the_screen_and_a_long_silence_is_a_gap(page: Page) -> None:
    rows, gap = page.evaluate(
        """async () => {
          const { Ring } = await import("/static/js/ring.js");
          const { merged } = await import("/static/js/merge.js");
          const dense = new Ring();
          for (let i = 0; i < 30000; i++) dense.push([i * 0.01], [i]);
          const a = new Ring(), b = new Ring();
          a.push([0, 10], [0, 1]);
          b.push([5], [3]);
          return [merged([dense], 0, 300)[0].length, merged([a, b], 0, 20)[1]];
        }"""
    )
    assert 1000 <= rows <= 3001
    assert gap == [0, None, 1]


def test_no_spike_is_thinned_away_and_a_line_that_moves_keeps_its_shape(page: Page) -> None:
    spikes, moved, quiet = page.evaluate(
        """async () => {
          const { Ring } = await import("/static/js/ring.js");
          const { merged } = await import("/static/js/merge.js");
          const ring = new Ring();
          for (let i = 0; i < 40000; i++) ring.push([i * 0.01], [i === 7777 ? 5 : i === 9000 ? -4 : Math.sin(i)]);
          const [, values] = merged([ring], 0, 400);
          const inside = ([times, values]) => times.flatMap((t, i) => (t > 210 && t < 290 ? [[t, values[i]]] : []));
          const before = inside(merged([ring], 100, 300)), after = inside(merged([ring], 103.33, 303.33));
          const silent = new Ring(), other = new Ring();
          for (let i = 0; i < 5000; i++) silent.push([i < 2500 ? i * 0.01 : 100 + i * 0.01], [1]);
          other.push([60], [1]);
          const [times, line] = merged([silent, other], 0, 300);
          const same = JSON.stringify(before) === JSON.stringify(after);
          return [[Math.max(...values), Math.min(...values)], same, line[times.indexOf(60)]];
        }"""
    )
    assert spikes == [5, -4]
    assert moved, "the parts are those of the series, wherever the view begins"
    assert quiet is None, "nothing is drawn across a silence, of a dense line either"


def test_boxes_of_the_graph_do_not_overlap(page: Page) -> None:
    columns = page.evaluate(
        """async () => {
          const { layout } = await import("/static/js/graph_layout.js");
          const nodes = Array.from({ length: 12 }, (_, i) => `/n${i}`);
          const topics = Array.from({ length: 5 }, (_, i) => ({ name: `/t${i}`, pubs: nodes, subs: nodes.slice(i) }));
          const { left, right, height } = layout(topics);
          return { left: [...left.values()], right: [...right.values()], height };
        }"""
    )
    for side in ("left", "right"):
        ys = columns[side]
        assert len(ys) == 12
        assert all(b - a >= 26 - 1e-9 for a, b in itertools.pairwise(ys))
        assert ys[0] >= 0
        assert ys[-1] <= columns["height"]


def test_a_wide_range_has_a_fine_slider_near_what_is_usual(page: Page) -> None:
    sent = page.evaluate(
        """async () => {
          const { Widget } = await import("/static/js/widget.js");
          const sent = [];
          const plain = { name: "kp", type: "float", default: 37.5, low: 0, high: 1000, choices: [], optional: false,
            unit: "", text: "", live: true, above: false, below: false };
          const widget = new Widget(plain, async ({ kp }) => { sent.push(kp); }, () => {});
          widget.update(37.5, "default");
          const slider = widget.element.querySelector("input[type=range]");
          const before = Number(slider.value);
          slider.value = String(before + 0.002);
          slider.dispatchEvent(new Event("change"));
          await new Promise((done) => setTimeout(done, 20));
          return [before, ...sent];
        }"""
    )
    assert 0.2 < sent[0] < 0.5
    assert 37.5 < sent[1] < 40


def test_a_button_asks_once_however_often_it_is_pressed_and_a_greyed_one_says_why(page: Page) -> None:
    got = page.evaluate(
        """async () => {
          const { el, setEnabled, whilePending } = await import("/static/js/dom.js");
          let asked = 0, answer;
          const button = el("button", { title: "Start it", onclick: () =>
            whilePending([button], new Promise((done) => { asked++; answer = done; })) });
          button.click(); button.click(); button.click();
          const during = [asked, button.disabled];
          setEnabled(button, "it runs already");
          answer();
          await new Promise((done) => setTimeout(done, 20));
          const refused = [button.disabled, button.title];
          setEnabled(button, "");
          return { during, refused, after: [button.disabled, button.title] };
        }"""
    )
    assert got == {"during": [1, True], "refused": [True, "it runs already"], "after": [False, "Start it"]}


def test_a_rounding_error_is_zero_and_small_values_stay(page: Page) -> None:
    shown = page.evaluate(
        """async () => {
          const { short } = await import("/static/js/plot.js");
          return [short(-9.52e-10, 0.4), short(-9.52e-10, 1e-8), short(0.22, 0.4), short(undefined)];
        }"""
    )
    assert shown == ["0", "-9.52e-10", "0.22", "–"]


def test_robots_and_the_users_own_come_before_the_house(page: Page) -> None:
    names = ["router", "/sim", "/tb3_0/waypoint", "/tf", "my_driver", "/health", "/robot_control", "panel"]
    ordered = page.evaluate(
        """async (names) => (await import("/static/js/store.js")).ownFirst(names, (each) => each)""", names
    )
    assert ordered == ["/tb3_0/waypoint", "my_driver", "/robot_control", "router", "/sim", "/tf", "/health", "panel"]
