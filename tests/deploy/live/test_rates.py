"""Rates of synthetic samples are exact despite losses, bursts, several publishers and a reset of time."""

from __future__ import annotations

import pytest

from deploy.live.topic_statistics import RateSample, SampleWindow, compute_rate

MS = 1_000_000


def test_a_steady_topic() -> None:
    found = compute_rate([(40 * MS * each, 0) for each in range(26)])
    assert found is not None
    assert (found.hz, found.count) == (25.0, 25)
    assert (found.shortest, found.longest, found.span) == (0.04, 0.04, 1.0)
    assert found.deviation == pytest.approx(0, abs=1e-12)


def test_what_was_lost_counts_and_widens_no_interval() -> None:
    moments = [(40 * MS * each, 0) for each in (0, 1, 2)] + [(40 * MS * 12, 9)] + [(40 * MS * 13, 0)]
    found = compute_rate(moments)
    assert found is not None
    assert found.hz == pytest.approx(25.0)
    assert (found.count, found.longest) == (13, 0.04)


def test_bursts_count_whole_instants() -> None:
    """16 sonars at once at 10 Hz; the first burst lacks its start, the last its end."""
    moments = [(0, 0)] * 3 + [(100 * MS * burst, 0) for burst in range(1, 6) for _ in range(16)] + [(600 * MS, 0)] * 5
    found = compute_rate(moments)
    assert found is not None
    assert found.hz == 160.0


@pytest.mark.parametrize("missing", [{20}, {0, 17, 33, 50}, {15, 16, 31, 32}, {63, 64, 79}])
def test_bursts_of_which_some_are_lost_give_the_exact_rate(missing: set[int]) -> None:
    """The instants of lost messages are unknown: counting starts and ends at instants that are certain."""
    moments, lost = [], 0
    for number in range(16 * 8):
        if number in missing:
            lost += 1
        else:
            moments.append((100 * MS * (number // 16), lost))
            lost = 0
    found = compute_rate(moments)
    assert found is not None
    assert found.hz == pytest.approx(160.0, abs=1e-9)
    assert found.count % 16 == 0


def test_two_senders_on_one_topic() -> None:
    moments = [(20 * MS * each, 0) for each in range(50)]
    found = compute_rate(moments[1::2] + moments[::2])
    assert found is not None
    assert found.hz == 50.0


@pytest.mark.parametrize("moments", [[], [(5, 0)], [(5, 0), (5, 0)]])
def test_no_rate_without_a_span(moments: list[tuple[int, int]]) -> None:
    assert compute_rate(moments) is None


def test_a_window_keeps_the_newest_and_starts_anew_with_time() -> None:
    window = SampleWindow(10)
    for each in range(30):
        window.add(RateSample(40 * MS * (each + 1000), each, 1 if each == 5 else 0, 100))
    assert (len(window.samples), window.received, window.lost) == (10, 30, 1)
    assert window.sizes() == (100.0, 100, 100)
    window.add(RateSample(40 * MS, 31))
    assert len(window.samples) == 1
    assert window.sim_rate() is None
    assert SampleWindow(5).sizes() == (0.0, 0, 0)


def test_what_has_no_time_counts_between_its_neighbours() -> None:
    """At the ends of the window it isn't counted: it has only one neighbour."""
    window = SampleWindow(20)
    for each in range(12):
        time = None if each in (0, 4, 5, 9, 11) else 40 * MS * (each + 10)
        window.add(RateSample(time, each, 1 if each == 5 else 0))
    found = window.sim_rate()
    assert found is not None
    assert (window.untimed, found.count) == (5, 10)
    assert (found.shortest, found.longest) == (0.04, 0.04)
