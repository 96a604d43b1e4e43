"""``topic hz``, ``bw`` and ``delay`` on a running fleet."""

from __future__ import annotations

import pytest

from tests.harness.background_fleet import WEATHER, BackgroundFleet, external_publisher


def test_hz_counts_what_was_lost(running: BackgroundFleet) -> None:
    """Every fourth sequence number is missing: the rate counts all 4, not the 3 that arrive."""
    with external_publisher(running.endpoint, "lab/numbers", {"a": 1}, numbers=True):
        *_, last = running.run_json_lines("topic", "hz", "lab/numbers", "-n", "30", "--wait")
    assert last["received"] == 30
    assert 9 <= last["lost"] < 20
    assert last["wall"]["count"] == 29 + last["lost"]
    assert last["wall"]["hz"] == pytest.approx((29 + last["lost"]) / last["wall"]["span"])


def test_hz_over_a_window_and_of_several_topics(running: BackgroundFleet) -> None:
    shown = running.run("topic", "hz", "tb3_0/odom", "/clock", "-n", "20", "-w", "10").out
    assert "/tb3_0/odom\naverage rate: 25.000 by simulation time, promised 25\n\tmin: 0.040s max: 0.040s" in shown
    assert "/clock\naverage rate: 50.000 by simulation time, promised 50\n" in shown
    assert "\twindow: 10 received: 20 lost: " in shown


def test_bw(running: BackgroundFleet) -> None:
    *_, last = running.run_json_lines("topic", "bw", "tb3_0/scan", "-n", "4", "--window", "3")
    size = last["size"]["mean"]
    assert 2 * 1440 < last["size"]["min"] <= size <= last["size"]["max"] < 2 * 1440 + 500
    assert last["bytes_per_simulated_s"] == pytest.approx(5 * size)
    assert (last["received"], last["window"]) == (4, 3)
    assert (
        "KB/s by simulation time, from 2 messages\n\tMessage size mean: 3."
        in running.run("topic", "bw", "tb3_0/scan", "-n", "2").out
    )


def test_delay(running: BackgroundFleet) -> None:
    """A message that arrives before the clock of its own tick counts as one clock, 20 ms, younger than it is."""
    *_, last = running.run_json_lines("topic", "delay", "tb3_0/odom", "-n", "10")
    assert 0 <= last["since_sent"]["min"] <= last["since_sent"]["mean"] <= last["since_sent"]["max"] < 60
    assert -0.021 < last["since_stamp"]["mean"] < 60
    assert "average delay since it was sent" in running.run("topic", "delay", "tb3_0/odom", "-n", "2").out
    with external_publisher(running.endpoint, "lab/weather", WEATHER):
        shown = running.run("topic", "delay", "lab/weather", "-n", "2", "--wait").out
    assert "no delay since its stamp, by simulation time: the messages have no stamp" in shown
