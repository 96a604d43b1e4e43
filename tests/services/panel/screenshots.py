"""Takes the README's pictures of a running lab's panel: ``python -m tests.services.panel.screenshots URL FOLDER``."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

WIDE, PHONE = (1440, 900), (390, 844)
SHARP = 1.5
"""Device pixels per CSS pixel of the phone's picture."""
SETTLE_MS = 12_000
"""Wall time [ms] for trails to grow and plots to fill."""
TURN_MS, TURNED_MS = 60_000, 5000
"""Wall times [ms] in which the robots reach their next point, and turn there."""
ROBOTS = ("p3dx", "tb3_0", "tb3_1", "tb3_2", "tb3_3")
PLOTS = [
    [[f"/{robot}/ground_truth", f"twist.twist.{field}"] for robot in ROBOTS] for field in ("linear.x", "angular.z")
]
"""Topic and field of each line of each plot."""


def take_screenshots(url: str, folder: Path) -> None:
    """Write panel.png, panel-plots.png and panel-phone.png."""
    with sync_playwright() as play, play.chromium.launch(executable_path="/usr/bin/chromium") as browser:
        page = open_page(browser, url, WIDE)
        page.wait_for_timeout(SETTLE_MS)
        page.click("button:has-text('Fit')")
        save(page, folder / "panel.png")
        page = open_page(browser, url, PHONE, SHARP)
        page.wait_for_timeout(SETTLE_MS)
        save(page, folder / "panel-phone.png")
        page = open_page(browser, url, WIDE, light=True)
        page.evaluate("plots => localStorage.setItem('elea.plots', plots)", json.dumps(PLOTS))
        page.reload()
        page.click("#tab-plots")
        page.fill("input[placeholder='Filter parameters']", "tb3_0/waypoint max")
        page.wait_for_timeout(SETTLE_MS)
        state = page.locator("[data-robot='/tb3_0'] .state")
        expect(state).not_to_have_text(state.text_content() or "", timeout=TURN_MS)
        page.wait_for_timeout(TURNED_MS)
        save(page, folder / "panel-plots.png")


def open_page(browser: Browser, url: str, size: tuple[int, int], sharp: float = 1.0, light: bool = False) -> Page:
    """Open the page at a size [pixels], dark or light."""
    made = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        device_scale_factor=sharp,
        color_scheme="light" if light else "dark",
    )
    page = made.new_page()
    page.goto(url)
    expect(page.locator("#clock")).to_contain_text(":", timeout=20_000)
    return page


def save(page: Page, file: Path) -> None:
    """Save a screenshot with 256 colours, which looks the same at half the file size."""
    page.mouse.move(1, 1)
    with Image.open(io.BytesIO(page.screenshot())) as whole:
        whole.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(file, optimize=True)


if __name__ == "__main__":
    take_screenshots(sys.argv[1], Path(sys.argv[2]))
