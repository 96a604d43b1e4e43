"""The cost of an open page that plots eight fields at 50 Hz, and its memory over ten minutes."""

from __future__ import annotations

import time
from collections.abc import Callable

import psutil
import pytest
from playwright.sync_api import Page, expect

from deploy.bench.figures import Figure
from tests.services.panel.conftest import PageOpener, PanelFleet

FIELDS = [
    [f"/tb3_{robot}/odom", path]
    for robot in (0, 1)
    for path in ("pose.pose.position.x", "pose.pose.position.y", "pose.pose.orientation.yaw", "twist.twist.linear.x")
]
"""Eight fields at 25 Hz of simulation time: 50 Hz of wall time, as this fleet runs at real-time factor 2."""

SPELLS = 5
"""Number of intervals of two seconds; the figure is their median."""


def eight(pages: PageOpener) -> Page:
    """Open a page that draws two plots of four fields each."""
    page = pages.open("plots", plots=[FIELDS[:4], FIELDS[4:]])
    page.locator(".plot canvas").nth(1).wait_for()
    return page


@pytest.mark.bench
def test_eight_fields_at_50_hz_cost_the_panel_less_than_a_tenth_of_a_core(
    fleet: PanelFleet, pages: PageOpener, keeps_bound: Callable[[Figure], None]
) -> None:
    """Measures the process's processor time in each interval."""
    page = eight(pages)
    panel = psutil.Process(fleet.address.pid)
    page.evaluate("() => { window.frames_ = 0; window.elea.link.on('samples', () => { window.frames_++; }); }")
    shares = []
    for _ in range(SPELLS):
        before, begun = sum(panel.cpu_times()[:2]), time.monotonic()
        page.wait_for_timeout(2000)
        shares.append(100 * (sum(panel.cpu_times()[:2]) - before) / (time.monotonic() - begun))
    assert page.evaluate("window.frames_") > 8 * 10, "samples came meanwhile"
    about = "share of a core of the panel while a page plots eight fields at 50 Hz"
    keeps_bound(Figure("panel_cpu_percent", "%", about, tuple(shares), at_most=10.0))


@pytest.mark.bench
def test_the_page_draws_more_than_15_times_a_second_in_software(
    pages: PageOpener, keeps_bound: Callable[[Figure], None]
) -> None:
    """Counts how often each plot is cleared for redrawing, not the browser's frames."""
    page = eight(pages)
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
    rates = tuple(float(page.evaluate(count)) for _ in range(SPELLS))
    keeps_bound(Figure("page_drawings_per_s", "1/s", "drawings of each plot on that page", rates, at_least=15.0))


def test_ten_minutes_of_samples_grow_the_page_by_less_than_20_mb(pages: PageOpener) -> None:
    """The samples of ten minutes, passed to the page as by its socket, as fast as it accepts them."""
    page = eight(pages)
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
              window.elea.link.emit("samples", { id, times: [t, t + 0.02], values: [Math.sin(t), Math.sin(t + 0.02)] });
            }
            if (batch % 500 === 0) await new Promise(requestAnimationFrame);
          }
        }"""
    )
    grown = (held() - before) / 2**20
    page.click("#pause")
    assert 3.0 < grown < 20.0, f"{grown:.1f} MiB"
