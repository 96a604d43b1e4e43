"""The mathematics of the page, run in a real browser's engine: histories, merging, CSV, the layout of the graph."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from playwright.sync_api import Page

from tests.panel.conftest import Pages


@pytest.fixture
def page(pages: Pages) -> Page:
    return pages.open("log")


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
