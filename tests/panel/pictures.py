"""The panel's pictures for the README, taken of a running lab by ``python -m tests.panel.pictures URL FOLDER``."""

from __future__ import annotations

import io
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

WIDE, PHONE = (1440, 900), (390, 844)
SHARP = 1.5
"""Of a phone's picture: its pixels for each of the page's."""
SETTLE_MS = 6000
"""Wall time for trails to grow and plots to fill."""


def take(url: str, folder: Path) -> None:
    """Write panel.png, panel-plots.png and panel-phone.png."""
    with sync_playwright() as play, play.chromium.launch(executable_path="/usr/bin/chromium") as browser:
        page = opened(browser, url, WIDE)
        page.wait_for_timeout(SETTLE_MS)
        page.click("button:has-text('Fit')")
        save(page, folder / "panel.png")
        page.click("#tab-plots")
        page.fill("input[placeholder='Filter parameters']", "p3dx/square")
        page.wait_for_timeout(SETTLE_MS)
        save(page, folder / "panel-plots.png")
        page = opened(browser, url, PHONE, SHARP)
        page.wait_for_timeout(SETTLE_MS)
        save(page, folder / "panel-phone.png")


def opened(browser: Browser, url: str, size: tuple[int, int], sharp: float = 1.0) -> Page:
    """The page, dark, of a size."""
    made = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, device_scale_factor=sharp, color_scheme="dark"
    )
    page = made.new_page()
    page.goto(url)
    expect(page.locator("#clock")).to_contain_text(":", timeout=20_000)
    return page


def save(page: Page, file: Path) -> None:
    """Write the picture with 256 colours: it looks the same, in half of the bytes."""
    page.mouse.move(1, 1)
    with Image.open(io.BytesIO(page.screenshot())) as whole:
        whole.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(file, optimize=True)


if __name__ == "__main__":
    take(sys.argv[1], Path(sys.argv[2]))
