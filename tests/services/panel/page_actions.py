"""What a person does with the widgets and plots of the page, and reads off them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from playwright.sync_api import Locator, Page

from tests.harness.waiting import wait_until

T = TypeVar("T")
ASK_S = 0.05
"""Wall time between two questions to a page: each takes it and the browser milliseconds of processor time. Playwright's
``expect`` asks after 0.1, 0.25 and 0.5 s and then each second, which is for what is so at once.
"""


def wait_page(probe: Callable[[], T], within: float, what: str) -> T:
    """The first true value of ``probe``, which asks a page; fails after ``within`` [s]."""
    return wait_until(probe, within, what, ASK_S)


def wait_text(shown: Locator, pattern: str, within: float) -> None:
    """Until the text of an element has the pattern in it; fails after ``within`` [s]."""
    wait_page(lambda: re.search(pattern, shown.text_content() or ""), within, f"{pattern} in {shown}")


def legend_value(page: Page, line: str) -> float | None:
    """The newest value of a line, as its plot's legend shows it."""
    text = page.locator(f".chip:has-text('{line}') .value").first.inner_text()
    return float(text) if text != "–" else None


def parameter_selector(page: Page, set_: str, name: str) -> str:
    return f"details.set:has(.name:text-is('{set_}')) [data-name='{name}']"


def set_slider(page: Page, widget: str, value: float) -> None:
    """Drag a slider there."""
    page.locator(f"{widget} input[type=range]").fill(str(value))


def exported_csv(page: Page, plot: Locator) -> list[str]:
    """All that a plot holds: the rows of its CSV, the first with the names."""
    with page.expect_download() as saving:
        plot.locator("button:has-text('CSV')").click()
    return saving.value.path().read_text().splitlines()


HELD = """plot => new Promise((done) => {
  const { createObjectURL } = URL, { click } = HTMLAnchorElement.prototype;
  URL.createObjectURL = (blob) => { blob.text().then(done); return ""; };
  HTMLAnchorElement.prototype.click = () => {};
  [...plot.querySelectorAll("button")].find((each) => each.textContent === "CSV").click();
  Object.assign(URL, { createObjectURL });
  Object.assign(HTMLAnchorElement.prototype, { click });
})"""


def held_csv(plot: Locator) -> list[str]:
    """The same as often as is wanted: without a file, of which Chromium takes two in a second from a page."""
    text: str = plot.evaluate(HELD)
    return text.splitlines()


def map_point(page: Page, x: float, y: float) -> dict[str, float]:
    """Where a point of the world lies on the map."""
    at = page.evaluate("([x, y]) => window.elea.map.camera.toScreen(x, y)", [x, y])
    return {"x": at[0], "y": at[1]}
