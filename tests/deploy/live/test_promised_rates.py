"""In lockstep, ``topic hz`` gives exactly the promised rates, whatever the rate on the wall clock."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from deploy.interfaces import known_topic
from tests.harness.background_fleet import BackgroundFleet, background_fleet

LOCKSTEP = """
name = "rates"
description = "A burger on its way and a Pioneer with sonars, in lockstep"

[run]
mode = "lockstep"
ends = "never"

[[robot]]
name = "tb3_0"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[1, 0], [0, 0]], laps = 1000 } }]

[[robot]]
name = "p3dx"
model = "p3dx"
pose = { x = -2.0, y = 0.0 }
"""
BURGER = ("odom", "ground_truth", "joint_states", "imu", "scan", "base_status", "cmd_vel")
STAMPLESS = {"/tb3_0/cmd_vel"}
STEADY = ("/clock", "/tf", *(f"/tb3_0/{each}" for each in BURGER), "/p3dx/sonar")
RANGES, SONARS = "/p3dx/sonar/range", 16
"""A topic with sixteen messages at each instant."""
COUNT = 40


@pytest.fixture(scope="module")
def rates(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """The last report on each topic, all measured in one run."""
    with background_fleet(tmp_path_factory.mktemp("rates"), LOCKSTEP) as running:
        running.run("topic", "hz", "-n", "20", "/clock")  # a stamp of 0 means none: time must have started
        lines = measured(running)
        yield {each["topic"]: each for each in lines}


def measured(running: BackgroundFleet) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = running.run_json_lines("topic", "hz", "-n", str(COUNT), *STEADY, RANGES)
    return lines


@pytest.mark.parametrize("name", STEADY)
def test_the_rate_is_the_promised_one_to_the_message(rates: dict[str, Any], name: str) -> None:
    """This holds even if a busy router drops messages: their sequence numbers reveal them.

    Commands have no stamp. One is untimed if its clock message was dropped; at either end of the window it isn't
    counted.
    """
    found, topic = rates[name], known_topic(name)
    assert topic is not None
    simulated = found["simulated"]
    assert (found["received"], found["promised"]) == (COUNT, topic.rate)
    whole = COUNT - 1 + found["lost"]
    assert whole - found["untimed"] <= simulated["count"] <= whole
    assert found["untimed"] == 0 or name in STAMPLESS
    assert simulated["span"] == pytest.approx(simulated["count"] / topic.rate, abs=1e-9)
    assert simulated["hz"] == pytest.approx(topic.rate, abs=1e-6)
    assert simulated["min"] == pytest.approx(simulated["max"], abs=1e-9)


def test_bursts_are_counted_too(rates: dict[str, Any]) -> None:
    simulated = rates[RANGES]["simulated"]
    assert simulated["hz"] == pytest.approx(160, abs=1e-6)
    assert simulated["count"] % SONARS == 0
