"""User actions on the page's widgets and plots, and the values that they show."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from playwright.sync_api import Locator, Page, expect

from tests.harness.waiting import wait_until

T = TypeVar("T")
ASK_S = 0.05
"""Wall time between two polls of a page: each takes milliseconds of processor time in the test and in the browser.
Playwright's ``expect`` polls after 0.1, 0.25 and 0.5 s and then each second, which suits what holds almost at once.
"""


def wait_page(probe: Callable[[], T], within: float, what: str) -> T:
    """Poll a page with ``probe`` and return its first true value; fail after ``within`` [s]."""
    return wait_until(probe, within, what, ASK_S)


def wait_text(shown: Locator, pattern: str, within: float) -> None:
    """Wait until an element's text matches a pattern; fail after ``within`` [s]."""
    wait_page(lambda: re.search(pattern, shown.text_content() or ""), within, f"{pattern} in {shown}")


CONFIRM = """button => { button.click(); const asked = button.textContent; button.click(); return asked; }"""


def confirm(button: Locator) -> None:
    """Press a button that asks once more, and press it again within the 3 s for which it asks."""
    expect(button).to_be_enabled()
    assert button.evaluate(CONFIRM) == "Sure?"


WATCH_NOTES = """() => {
  const seen = [];
  new MutationObserver((changes) => {
    for (const { addedNodes } of changes) seen.push(...[...addedNodes].map((each) => each.textContent));
  }).observe(document.getElementById("notes"), { childList: true });
  return seen;
}"""


def watch_notes(page: Page) -> Callable[[], list[str]]:
    """Return a function that returns the notes shown since now; the page removes each after some seconds."""
    seen = page.evaluate_handle(WATCH_NOTES)
    return seen.json_value


def legend_value(page: Page, line: str) -> float | None:
    """Return the latest value of a line from its plot's legend, None without one."""
    text = page.locator(f".chip:has-text('{line}') .value").first.inner_text()
    return float(text) if text != "–" else None


def parameter_selector(page: Page, set_: str, name: str) -> str:
    return f"details.set:has(.name:text-is('{set_}')) [data-name='{name}']"


def set_slider(page: Page, widget: str, value: float) -> None:
    """Set a widget's slider to a value."""
    page.locator(f"{widget} input[type=range]").fill(str(value))


def exported_csv(page: Page, plot: Locator) -> list[str]:
    """Export a plot as CSV and return its rows; the first has the names."""
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
    """Return a plot's CSV rows without a download; Chromium allows a page only two per second."""
    text: str = plot.evaluate(HELD)
    return text.splitlines()


def map_point(page: Page, x: float, y: float) -> dict[str, float]:
    """Return the map's pixel for a point of the world [m]."""
    at = page.evaluate("([x, y]) => window.elea.map.camera.toScreen(x, y)", [x, y])
    return {"x": at[0], "y": at[1]}
