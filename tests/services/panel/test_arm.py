"""The arm's gain in a real browser: a slider sets it, and a plot shows the simulated arm's response."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import radians, sin

import pytest
from playwright.sync_api import Page, expect

from messages.topics import JOINT_ANGLE
from services.arm import ArmParameters
from tests.harness.waiting import wait_until
from tests.services.panel.conftest import WITHIN_S, PageOpener, PanelFleet
from tests.services.panel.page_actions import held_csv, legend_value, parameter_selector, set_slider, wait_page

SET, REFERENCE = "/robot_control", 30.0
ARM = ArmParameters()
NEAR = 0.002
"""Tolerance [deg] between the error and that of static equilibrium."""
LINE = "robot_control/error"
STILL_S = 1.0
"""Simulation time [s] for which the error must stay there."""


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PanelFleet]:
    """Replaces the fleet of this folder's other tests."""
    with PanelFleet(tmp_path_factory.mktemp("arm"), "arm.toml", robots=(), size=7) as watched:
        yield watched


def left(gain: float) -> float:
    """Return the error [deg] at which ``gain`` [N m/deg] times the error carries the arm's weight."""
    error = 0.0
    for _ in range(20):
        error = ARM.gravity_torque * sin(radians(REFERENCE - error - ARM.gravity_rest)) / gain
    return error


def held(page: Page) -> list[float]:
    """Return the errors [deg] of the last STILL_S in the page's plot; none if it has less than that."""
    head, *rows = held_csv(page.locator(f".plot:has(.chip:has-text('{LINE}'))"))
    assert head == f"time [s],/{LINE} data"
    samples = [(float(time), float(error)) for time, error in (row.split(",") for row in rows)]
    if not samples or samples[-1][0] - samples[0][0] < STILL_S:
        return []
    return [error for time, error in samples if time > samples[-1][0] - STILL_S]


def stands(page: Page, error: float) -> bool:
    """Whether the plot recently shows only this error; reads its data only once the legend shows it."""
    shown = legend_value(page, LINE)
    if shown is None or abs(shown - error) > NEAR:
        return False
    errors = held(page)
    return len(errors) > 50 and all(abs(each - error) < NEAR for each in errors)


def test_a_slider_changes_the_gain_and_the_plot_shows_it(pages: PageOpener) -> None:
    page = pages.open("plots")
    gain = parameter_selector(page, SET, "ss_Kp")
    box = page.locator(f"{gain} input[type=number]")
    page.fill("input[placeholder='Filter parameters']", "ss_Kp")
    expect(box).to_have_value("37.5")
    assert left(37.5) == pytest.approx(0.374, abs=0.0005), "14.02 N m / 37.5 N m/deg"
    wait_page(lambda: stands(page, 0.374), WITHIN_S, "the plot holds the error that the usual gain leaves")

    unit, pane = (page.locator(each).bounding_box() for each in (f"{gain} .unit", ".pane.parameters"))
    assert unit is not None
    assert pane is not None
    assert unit["x"] + unit["width"] <= pane["x"] + pane["width"], "the unit is read whole"

    set_slider(page, gain, 0.276)  # the slider is finer at its low end: 1000 N m/deg times its position cubed
    expect(box).to_have_value("21")
    expect(page.locator(f"{gain} .origin")).to_have_text("run")
    wait_page(lambda: stands(page, left(21.0)), WITHIN_S, "the plot holds the error that the new gain leaves")
    assert left(21.0) == pytest.approx(14.02 / 21.0, rel=0.01)

    box.fill("1200")
    box.press("Enter")
    expect(page.locator(f"{gain} .reason")).to_contain_text(re.compile(r"ss_Kp.*1200.*0.*1000"))
    expect(box).to_have_value("21")
    wait_page(lambda: stands(page, left(21.0)), WITHIN_S, "what was refused has moved nothing for good")

    page.click(f"{gain} button[title='Return to the value of the fleet file or the default']")
    expect(box).to_have_value("37.5")
    expect(page.locator(f"{gain} .reason")).to_be_hidden()
    wait_page(lambda: stands(page, left(37.5)), WITHIN_S, "it is as it was")


def test_an_arm_is_stopped_and_reset_as_a_robot_that_drives(fleet: PanelFleet, pages: PageOpener) -> None:
    angles = fleet.node.subscribe(JOINT_ANGLE)

    def angle() -> float:
        wait_until(lambda: (angles.update(), angles.messages)[1], WITHIN_S, "an angle")
        return float(angles.messages[-1][0].data)

    page = pages.open("robots")
    row = page.locator("[data-robot='/arm']")
    expect(row.locator(".state")).to_have_text("does not drive")
    wait_until(lambda: abs(angle() - REFERENCE) < 1.0, WITHIN_S, "it is held")
    row.get_by_role("button", name="Stop arm").click()
    expect(row.locator(".state")).to_have_text("stopped")
    wait_until(lambda: abs(angle() - REFERENCE) > 5.0, WITHIN_S, "no effort holds it")
    row.get_by_role("button", name="Reset arm").click()
    expect(row.locator(".state")).to_have_text("does not drive")
    wait_until(lambda: abs(angle() - REFERENCE) < 1.0, WITHIN_S, "it is held again")
    fleet.node.unregister(angles)
