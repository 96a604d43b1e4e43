"""The dead-man's switch over timed events: taps, holds on every sort of keyboard, releases, two keys."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop.dead_man import LONGEST_DELAY_S, MARGIN_S, DeadMan, released, struck
from tests.teleop.keyboards import FIRST, held, lapses

FRESH = DeadMan(FIRST)


def test_a_tap_counts_for_the_first_time_out_and_no_longer() -> None:
    man = struck(FRESH, "i", 10.0)
    assert man.holds(10.0)
    assert man.holds(10.0 + FIRST)
    assert not man.holds(10.0 + FIRST + 1e-9)


def test_nothing_is_held_before_the_first_event() -> None:
    assert not FRESH.holds(0.0)


@pytest.mark.parametrize("delay", [0.15, 0.25, 0.5, 0.59])
@pytest.mark.parametrize("interval", [1 / 60, 0.03, 0.04, 0.092])
def test_a_held_key_never_lapses_and_a_released_one_stops_soon(delay: float, interval: float) -> None:
    times = held(0.0, 3.0, delay, interval)
    man, let_go = lapses(FRESH, times)
    assert let_go == []
    assert man.until - times[-1] == pytest.approx(max(0.1, 3 * interval))


def test_on_the_usual_keyboard_the_stop_comes_a_tenth_of_a_second_after_the_last_repeat() -> None:
    man, _ = lapses(FRESH, held(0.0, 1.0, 0.5, 0.03))
    assert man.until - man.last == pytest.approx(0.1)


def test_two_repeats_are_enough_to_tell() -> None:
    times = held(0.0, 0.53, 0.5, 0.03)
    assert times == pytest.approx([0.0, 0.5, 0.53])
    assert lapses(FRESH, times)[0].until == pytest.approx(0.63)


def test_a_delay_beyond_the_first_time_out_lets_go_once_and_is_learned() -> None:
    man, let_go = lapses(FRESH, held(0.0, 3.0, 1.0, 0.03))
    assert let_go == [FIRST]
    man, let_go = lapses(man, held(10.0, 3.0, 1.0, 0.03))
    assert let_go == []
    assert man.first == pytest.approx(1.0 + MARGIN_S)


def test_a_short_delay_is_learned_too_so_that_a_tap_is_short() -> None:
    man = FRESH
    for turn in range(8):
        man, let_go = lapses(man, held(10.0 * turn, 1.0, 0.25, 0.03))
        assert let_go == []
    assert man.first == pytest.approx(0.25 + MARGIN_S, abs=0.01)
    assert man.first >= 0.25 + MARGIN_S
    assert not struck(man, "l", 100.0).holds(100.37)


def test_what_was_learned_outlasts_a_release_and_another_key() -> None:
    man, _ = lapses(FRESH, held(0.0, 3.0, 1.0, 0.03))
    assert struck(released(man), "i", 5.0).until == pytest.approx(6.1)
    assert struck(man, "l", 5.0).until == pytest.approx(6.1)


def test_another_key_is_a_first_event() -> None:
    man, _ = lapses(FRESH, held(0.0, 1.0, 0.5, 0.03))
    other = struck(man, "l", man.last + 0.03)
    assert other.until == pytest.approx(man.last + 0.03 + man.first)
    _, let_go = lapses(other, held(other.last, 1.0, 0.5, 0.03)[1:], "l")
    assert let_go == []


def test_fast_fingers_are_not_taken_for_repeats() -> None:
    """Seven taps a second, then a hold: the hold must not begin with a repeat's short time-out."""
    taps = [0.14 * n for n in range(10)]
    man, _ = lapses(FRESH, taps)
    assert man.until == pytest.approx(taps[-1] + FIRST)
    _, let_go = lapses(man, held(taps[-1] + 0.14, 1.0, 0.5, 0.03))
    assert let_go == []


def test_a_double_tap_is_no_repeat() -> None:
    man = struck(struck(FRESH, "i", 0.0), "i", 0.09)
    assert man.until == pytest.approx(0.09 + FIRST)


def test_repeats_that_come_in_bursts_hold() -> None:
    """Three at once every 90 ms, as over a network."""
    whole = held(0.0, 3.0, 0.5, 0.03)
    times = [whole[0], *(whole[1 + 3 * (n // 3)] for n in range(len(whole) - 1))]
    _, let_go = lapses(FRESH, times)
    assert let_go == []


def test_events_read_at_once_after_a_stall_are_not_taken_for_repeats() -> None:
    man = struck(struck(FRESH, "i", 1.0), "i", 1.0)
    assert man.until == pytest.approx(1.0 + FIRST)


def test_a_stall_does_not_spoil_what_was_learned() -> None:
    """The first event is read 0.15 s late, so the delay seems shorter than it is."""
    man, _ = lapses(FRESH, held(0.0, 2.0, 0.5, 0.03))
    late = held(10.0, 2.0, 0.5, 0.03)
    man, let_go = lapses(man, [10.15, *late[1:]])
    assert let_go == []
    _, let_go = lapses(man, held(20.0, 2.0, 0.5, 0.03))
    assert let_go == []


def test_a_repeat_that_is_read_late_is_a_repeat_all_the_same() -> None:
    """The reader was held up for 0.15 s; the key was let go meanwhile, after one more repeat."""
    man, _ = lapses(FRESH, held(0.0, 1.0, 0.5, 0.03))
    late = man.last + 0.16
    assert struck(man, "i", late, stall=0.15).until == pytest.approx(late + 0.1)
    assert struck(man, "i", late).until == pytest.approx(late + FIRST)


def test_the_fixed_time_out_is_that_of_teleop_twist_keyboard() -> None:
    man, let_go = lapses(DeadMan(0.5, adaptive=False), held(0.0, 2.0, 0.4, 0.03))
    assert let_go == []
    assert man.until - man.last == pytest.approx(0.5)


@given(
    delay=st.floats(0.15, FIRST - 0.01),
    interval=st.floats(0.017, 0.09),
    jitter=st.floats(0.0, 0.3),
    seconds=st.floats(0.0, 4.0),
    seed=st.integers(0, 2**32),
)
def test_any_keyboard_is_smooth_while_held_and_soon_over(
    delay: float, interval: float, jitter: float, seconds: float, seed: int
) -> None:
    times = held(0.0, seconds, delay, interval, jitter, seed)
    man, let_go = lapses(FRESH, times)
    assert let_go == []
    if len(times) > 4:
        assert man.until - times[-1] <= max(0.1, 3 * interval * (1 + jitter)) + 1e-9
    man, let_go = lapses(man, held(100.0, seconds, delay, interval, jitter, seed + 1))
    assert let_go == []


@given(delay=st.floats(FIRST, 1.8), interval=st.floats(0.017, 0.09), seconds=st.floats(2.2, 4.0))
def test_any_delay_is_smooth_once_it_is_known(delay: float, interval: float, seconds: float) -> None:
    man, let_go = lapses(FRESH, held(0.0, seconds, delay, interval))
    assert len(let_go) <= 1
    _, let_go = lapses(man, held(100.0, seconds, delay, interval))
    assert let_go == []


@given(st.lists(st.tuples(st.sampled_from("ilq"), st.floats(0.0, 3.0)), max_size=60))
def test_whatever_is_struck_nothing_is_held_for_long_after(events: list[tuple[str, float]]) -> None:
    man, now = FRESH, 0.0
    for key, pause in events:
        now += pause
        man = struck(man, key, now)
        assert man.holds(now)
        assert now + 0.1 <= man.until <= now + LONGEST_DELAY_S + MARGIN_S
    assert not released(man).holds(now)
