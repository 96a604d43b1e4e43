"""What an open page costs: eight fields at 50 Hz, and ten minutes of them."""

from __future__ import annotations

import json
import time

import psutil
import pytest
from playwright.sync_api import Page, expect

from tests.harness.waiting import wait_until
from tests.services.panel.conftest import PageOpener, PanelFleet

FIELDS = [
    [f"/tb3_{robot}/odom", path]
    for robot in (0, 1)
    for path in ("pose.pose.position.x", "pose.pose.position.y", "pose.pose.orientation.yaw", "twist.twist.linear.x")
]
"""Eight fields at 25 Hz of simulation time, which is 50 Hz on the wall at the factor 2 of this fleet."""


def eight(pages: PageOpener, fleet: PanelFleet) -> Page:
    """A page with two plots of four fields each, drawing."""
    page = pages.open("plots")
    page.evaluate("fields => localStorage.setItem('elea.plots', fields)", json.dumps([FIELDS[:4], FIELDS[4:]]))
    page.reload()
    page.locator(".plot canvas").nth(1).wait_for()
    return page


def test_eight_fields_at_50_hz_cost_the_panel_less_than_a_tenth_of_a_core(fleet: PanelFleet, pages: PageOpener) -> None:
    """Processor time of the process, in the best of several spells: the others on the machine are not its cost."""
    page = eight(pages, fleet)
    panel = psutil.Process(fleet.address.pid)
    frames = page.evaluate("() => { window.frames_ = 0; window.elea.link.on('samples', () => { window.frames_++; }); }")
    assert frames is None

    def spell() -> bool:
        before, begun = sum(panel.cpu_times()[:2]), time.monotonic()
        page.wait_for_timeout(2000)
        return (sum(panel.cpu_times()[:2]) - before) / (time.monotonic() - begun) < 0.10

    wait_until(spell, 30.0, "a spell of two seconds below a tenth of a core")
    assert page.evaluate("window.frames_") > 8 * 10, "samples came meanwhile"


@pytest.mark.timeout(240)
def test_the_page_draws_more_than_15_times_a_second_in_software(fleet: PanelFleet, pages: PageOpener) -> None:
    """Of both plots: how often each is wiped to be drawn anew, not how often the browser would have had time for it.

    In the best of many spells: a browser that shares its processors with other tests draws when it gets one.
    """
    page = eight(pages, fleet)
    count = """() => new Promise((done) => {
      const wipe = CanvasRenderingContext2D.prototype.clearRect, begun = performance.now();
      let drawn = 0;
      CanvasRenderingContext2D.prototype.clearRect = function (...area) {
        if (this.canvas.closest(".plot")) drawn++;
        return wipe.apply(this, area);
      };
      setTimeout(() => {
        CanvasRenderingContext2D.prototype.clearRect = wipe;
        done(1000 * drawn / 2 / (performance.now() - begun));
      }, 2000);
    })"""
    wait_until(
        lambda: page.evaluate(count) >= 15, 150.0, "a spell of two seconds with 15 drawings per second of each plot"
    )


def test_ten_minutes_of_samples_grow_the_page_by_less_than_20_mb(fleet: PanelFleet, pages: PageOpener) -> None:
    """The samples of ten minutes, handed to the page as its socket does, in the time that this takes."""
    page = eight(pages, fleet)
    session = page.context.new_cdp_session(page)

    def held() -> float:
        session.send("HeapProfiler.collectGarbage")
        usage = session.send("Runtime.getHeapUsage")
        return float(usage["usedSize"] + usage.get("backingStorageSize", 0) + usage.get("embedderHeapUsedSize", 0))

    page.click("#pause")
    expect(page.locator("#pause")).to_have_text("Resume")
    before = held()
    page.evaluate(
        """async () => {
          const from = performance.now() + 1e6;
          for (let batch = 0; batch < 15000; batch++) {
            for (let id = 1; id <= 8; id++) {
              const t = from + batch * 0.04;
              window.elea.link.emit("samples", { id, times: [t, t + 0.02], values: [Math.sin(t), Math.cos(t)] });
            }
            if (batch % 500 === 0) await new Promise(requestAnimationFrame);
          }
        }"""
    )
    grown = (held() - before) / 2**20
    page.click("#pause")
    assert 3.0 < grown < 20.0, f"{grown:.1f} MiB"
