"""The dead-man switch on timed events: taps, holds on various keyboards, releases, two keys."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from services.teleop.hold_detector import DELAY_MARGIN_S, MAX_DELAY_S, HoldDetector, pressed, reset
from tests.services.teleop.key_repeat import FIRST_TIMEOUT_S, key_repeat, timeouts

FRESH = HoldDetector(FIRST_TIMEOUT_S)


def test_a_tap_counts_for_the_first_time_out_and_no_longer() -> None:
    detector = pressed(FRESH, "i", 10.0)
    assert detector.is_held(10.0)
    assert detector.is_held(10.0 + FIRST_TIMEOUT_S)
    assert not detector.is_held(10.0 + FIRST_TIMEOUT_S + 1e-9)


def test_nothing_is_held_before_the_first_event() -> None:
    assert not FRESH.is_held(0.0)


@pytest.mark.parametrize("delay", [0.15, 0.25, 0.5, 0.59])
@pytest.mark.parametrize("interval", [1 / 60, 0.03, 0.04, 0.092])
def test_a_held_key_never_lapses_and_a_released_one_stops_soon(delay: float, interval: float) -> None:
    times = key_repeat(0.0, 3.0, delay, interval)
    detector, let_go = timeouts(FRESH, times)
    assert let_go == []
    assert detector.held_until - times[-1] == pytest.approx(max(0.1, 3 * interval))


def test_on_the_usual_keyboard_the_stop_comes_a_tenth_of_a_second_after_the_last_repeat() -> None:
    detector, _ = timeouts(FRESH, key_repeat(0.0, 1.0, 0.5, 0.03))
    assert detector.held_until - detector.last_time == pytest.approx(0.1)


def test_two_repeats_are_enough_to_tell() -> None:
    times = key_repeat(0.0, 0.53, 0.5, 0.03)
    assert times == pytest.approx([0.0, 0.5, 0.53])
    assert timeouts(FRESH, times)[0].held_until == pytest.approx(0.63)


def test_a_delay_beyond_the_first_time_out_lets_go_once_and_is_learned() -> None:
    detector, let_go = timeouts(FRESH, key_repeat(0.0, 3.0, 1.0, 0.03))
    assert let_go == [FIRST_TIMEOUT_S]
    detector, let_go = timeouts(detector, key_repeat(10.0, 3.0, 1.0, 0.03))
    assert let_go == []
    assert detector.first_timeout == pytest.approx(1.0 + DELAY_MARGIN_S)


def test_a_delay_is_learned_from_a_second_hold_of_the_key_soon_after_one_that_did_not_tell() -> None:
    """A repeat of the first hold comes so late that it may have been the delay itself."""
    detector, _ = timeouts(FRESH, [0.0, 1.0, 1.25, 1.28, 1.31])
    assert detector.first_timeout == FIRST_TIMEOUT_S
    detector, _ = timeouts(detector, key_repeat(2.8, 1.5, 1.0, 0.03))
    assert detector.first_timeout == pytest.approx(1.0 + DELAY_MARGIN_S)


def test_a_short_delay_is_learned_too_so_that_a_tap_is_short() -> None:
    detector = FRESH
    for turn in range(8):
        detector, let_go = timeouts(detector, key_repeat(10.0 * turn, 1.0, 0.25, 0.03))
        assert let_go == []
    assert detector.first_timeout == pytest.approx(0.25 + DELAY_MARGIN_S, abs=0.01)
    assert detector.first_timeout >= 0.25 + DELAY_MARGIN_S
    assert not pressed(detector, "l", 100.0).is_held(100.37)


def test_what_was_learned_outlasts_a_release_and_another_key() -> None:
    detector, _ = timeouts(FRESH, key_repeat(0.0, 3.0, 1.0, 0.03))
    assert pressed(reset(detector), "i", 5.0).held_until == pytest.approx(6.1)
    assert pressed(detector, "l", 5.0).held_until == pytest.approx(6.1)


def test_another_key_is_a_first_event() -> None:
    detector, _ = timeouts(FRESH, key_repeat(0.0, 1.0, 0.5, 0.03))
    other = pressed(detector, "l", detector.last_time + 0.03)
    assert other.held_until == pytest.approx(detector.last_time + 0.03 + detector.first_timeout)
    _, let_go = timeouts(other, key_repeat(other.last_time, 1.0, 0.5, 0.03)[1:], "l")
    assert let_go == []


def test_fast_fingers_are_not_taken_for_repeats() -> None:
    """Seven taps a second, then a hold: the hold must not begin with a repeat's short time-out."""
    taps = [0.14 * n for n in range(10)]
    detector, _ = timeouts(FRESH, taps)
    assert detector.held_until == pytest.approx(taps[-1] + FIRST_TIMEOUT_S)
    _, let_go = timeouts(detector, key_repeat(taps[-1] + 0.14, 1.0, 0.5, 0.03))
    assert let_go == []


def test_a_double_tap_is_no_repeat() -> None:
    detector = pressed(pressed(FRESH, "i", 0.0), "i", 0.09)
    assert detector.held_until == pytest.approx(0.09 + FIRST_TIMEOUT_S)


def test_repeats_that_come_in_bursts_hold() -> None:
    """Three at once every 90 ms, as over a network."""
    whole = key_repeat(0.0, 3.0, 0.5, 0.03)
    times = [whole[0], *(whole[1 + 3 * (n // 3)] for n in range(len(whole) - 1))]
    _, let_go = timeouts(FRESH, times)
    assert let_go == []


def test_events_read_at_once_after_a_stall_are_not_taken_for_repeats() -> None:
    detector = pressed(pressed(FRESH, "i", 1.0), "i", 1.0)
    assert detector.held_until == pytest.approx(1.0 + FIRST_TIMEOUT_S)


def test_a_stall_does_not_spoil_what_was_learned() -> None:
    """The first event is read 0.15 s late, so the delay appears too short."""
    detector, _ = timeouts(FRESH, key_repeat(0.0, 2.0, 0.5, 0.03))
    late = key_repeat(10.0, 2.0, 0.5, 0.03)
    detector, let_go = timeouts(detector, [10.15, *late[1:]])
    assert let_go == []
    _, let_go = timeouts(detector, key_repeat(20.0, 2.0, 0.5, 0.03))
    assert let_go == []


def test_a_stall_of_the_reader_does_not_make_the_delay_shorter() -> None:
    """The first event of a hold is read 0.2 s late, and the reader knows it."""
    first, *repeats = key_repeat(0.0, 3.0, 1.0, 0.03)
    detector, _ = timeouts(pressed(FRESH, "i", first + 0.2, stall=0.25), repeats)
    assert 1.0 + DELAY_MARGIN_S <= detector.first_timeout <= 1.05 + DELAY_MARGIN_S + 1e-9
    _, let_go = timeouts(reset(detector), key_repeat(10.0, 3.0, 1.0, 0.03))
    assert let_go == []


def test_a_late_repeat_is_not_taken_for_the_delay() -> None:
    """The second repeat is 0.085 s late; the gap before it isn't the keyboard's delay."""
    detector, _ = timeouts(FRESH, key_repeat(0.0, 2.0, 0.5, 0.03))
    whole = key_repeat(10.0, 2.0, 0.5, 0.03)
    detector, let_go = timeouts(
        reset(detector), [*whole[:2], whole[1] + 0.115, *(each for each in whole if each > 10.64)]
    )
    assert let_go == []
    _, let_go = timeouts(reset(detector), key_repeat(20.0, 2.0, 0.5, 0.03))
    assert let_go == []


def test_a_late_repeat_of_a_slow_keyboard_is_not_taken_for_the_delay() -> None:
    """The gaps after the delay are 0.09, 0.12 and 0.06 s, then 0.09 s."""
    first, *repeats = key_repeat(0.0, 2.0, 0.5, 0.09)
    repeats[2] += 0.03
    detector, let_go = timeouts(FRESH, [first, *repeats])
    assert let_go == []
    assert detector.first_timeout == FIRST_TIMEOUT_S, "which gap was the delay is not known"
    _, let_go = timeouts(reset(detector), key_repeat(10.0, 2.0, 0.5, 0.09))
    assert let_go == []


@pytest.mark.parametrize("late", [0.035, 0.05, 0.07, 0.075])
@pytest.mark.parametrize("repeat", [1, 2, 3])
def test_the_delay_is_learned_though_a_repeat_is_read_late(late: float, repeat: int) -> None:
    """Those that follow within this time are read with it."""
    whole = key_repeat(0.0, 3.0, 1.0, 0.03)
    read = whole[repeat] + late
    times = [*whole[:repeat], *(max(each, read) for each in whole[repeat:])]
    detector, _ = timeouts(FRESH, times)
    assert 1.0 + DELAY_MARGIN_S <= detector.first_timeout <= 1.0 + late + DELAY_MARGIN_S + 1e-9
    _, let_go = timeouts(reset(detector), key_repeat(10.0, 3.0, 1.0, 0.03))
    assert let_go == []


def test_a_repeat_that_is_read_late_is_a_repeat_all_the_same() -> None:
    """The reader was held up for 0.15 s; meanwhile the key was released after one more repeat."""
    detector, _ = timeouts(FRESH, key_repeat(0.0, 1.0, 0.5, 0.03))
    late = detector.last_time + 0.16
    assert pressed(detector, "i", late, stall=0.15).held_until == pytest.approx(late + 0.1)
    assert pressed(detector, "i", late).held_until == pytest.approx(late + FIRST_TIMEOUT_S)


def test_the_fixed_time_out_is_that_of_teleop_twist_keyboard() -> None:
    detector, let_go = timeouts(HoldDetector(0.5, adaptive=False), key_repeat(0.0, 2.0, 0.4, 0.03))
    assert let_go == []
    assert detector.held_until - detector.last_time == pytest.approx(0.5)


@given(
    delay=st.floats(0.15, FIRST_TIMEOUT_S - 0.01),
    interval=st.floats(0.017, 0.09),
    jitter=st.floats(0.0, 0.3),
    seconds=st.floats(0.0, 4.0),
    seed=st.integers(0, 2**32),
)
def test_any_keyboard_is_smooth_while_held_and_soon_over(
    delay: float, interval: float, jitter: float, seconds: float, seed: int
) -> None:
    assume(delay + jitter * interval < FIRST_TIMEOUT_S)  # the second event is at most this late
    times = key_repeat(0.0, seconds, delay, interval, jitter, seed)
    detector, let_go = timeouts(FRESH, times)
    assert let_go == []
    if len(times) > 4:
        assert detector.held_until - times[-1] <= max(0.1, 3 * interval * (1 + jitter)) + 1e-9
    detector, let_go = timeouts(detector, key_repeat(100.0, seconds, delay, interval, jitter, seed + 1))
    assert let_go == []


@given(delay=st.floats(FIRST_TIMEOUT_S, 1.8), interval=st.floats(0.017, 0.09), seconds=st.floats(2.2, 4.0))
def test_any_delay_is_smooth_once_it_is_known(delay: float, interval: float, seconds: float) -> None:
    detector, let_go = timeouts(FRESH, key_repeat(0.0, seconds, delay, interval))
    assert len(let_go) <= 1
    _, let_go = timeouts(detector, key_repeat(100.0, seconds, delay, interval))
    assert let_go == []


@given(st.lists(st.tuples(st.sampled_from("ilq"), st.floats(0.0, 3.0)), max_size=60))
def test_whatever_is_struck_nothing_is_held_for_long_after(events: list[tuple[str, float]]) -> None:
    detector, now = FRESH, 0.0
    for key, pause in events:
        now += pause
        detector = pressed(detector, key, now)
        assert detector.is_held(now)
        assert now + 0.1 <= detector.held_until <= now + MAX_DELAY_S + DELAY_MARGIN_S
    assert not reset(detector).is_held(now)
