"""The meaning of keys: directions, scaling, stops, two keys, compared with the table of teleop_twist_keyboard."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.teleop import MIN_SPEED, TeleopParameters
from services.teleop.keys import MOVES, SCALES, KeyEvent, KeyState, Velocity, is_stop, on_key, reconfigured

P = TeleopParameters(speed=0.4, turn=0.8)


def typed(keys: str, p: TeleopParameters = P, pause: float = 0.2) -> tuple[KeyState, float]:
    """Return the key state after taps, and the time of the last one [s]."""
    state, now = KeyState.initial(p), 0.0
    for key in keys:
        now += pause
        state = on_key(state, KeyEvent(key, now), p)
    return state, now


@pytest.mark.parametrize(
    ("key", "motion"),
    [
        ("i", (0.4, 0.0, 0.0, 0.0)),
        ("o", (0.4, 0.0, 0.0, -0.8)),
        ("j", (0.0, 0.0, 0.0, 0.8)),
        ("l", (0.0, 0.0, 0.0, -0.8)),
        ("u", (0.4, 0.0, 0.0, 0.8)),
        (",", (-0.4, 0.0, 0.0, 0.0)),
        (".", (-0.4, 0.0, 0.0, 0.8)),
        ("m", (-0.4, 0.0, 0.0, -0.8)),
        ("I", (0.4, 0.0, 0.0, 0.0)),
        ("O", (0.4, -0.4, 0.0, 0.0)),
        ("J", (0.0, 0.4, 0.0, 0.0)),
        ("L", (0.0, -0.4, 0.0, 0.0)),
        ("U", (0.4, 0.4, 0.0, 0.0)),
        ("<", (-0.4, 0.0, 0.0, 0.0)),
        (">", (-0.4, -0.4, 0.0, 0.0)),
        ("M", (-0.4, 0.4, 0.0, 0.0)),
        ("t", (0.0, 0.0, 0.4, 0.0)),
        ("b", (0.0, 0.0, -0.4, 0.0)),
    ],
)
def test_a_key_moves(key: str, motion: tuple[float, ...]) -> None:
    state, now = typed(key)
    assert state.command(now) == Velocity(*motion)


def test_other_parameters_count_for_the_hand_that_is_there() -> None:
    state, now = typed("qi")
    assert state.speed == pytest.approx(0.44)
    p = TeleopParameters(speed=0.4, turn=0.5, speed_limit=0.42)
    after = reconfigured(state, P, p)
    assert (after.speed, after.turn) == (0.42, 0.5)
    assert after.command(now) == Velocity(0.42)
    slow = reconfigured(after, p, TeleopParameters(speed=0.1, turn=0.5, key_timeout=2.0))
    assert (slow.speed, slow.detector.first_timeout) == (0.1, 2.0)
    assert slow.command(now) == Velocity(0.1)


def test_no_other_key_moves() -> None:
    for code in range(0x20, 0x7F):
        state, now = typed(chr(code))
        assert (state.command(now) is not None) == (chr(code) in MOVES)


@pytest.mark.parametrize(
    ("key", "speed", "turn"),
    [
        ("q", 0.44, 0.88),
        ("z", 0.36, 0.72),
        ("w", 0.44, 0.8),
        ("x", 0.36, 0.8),
        ("e", 0.4, 0.88),
        ("c", 0.4, 0.72),
    ],
)
def test_a_key_scales_by_ten_per_cent(key: str, speed: float, turn: float) -> None:
    state, now = typed(key)
    assert (state.speed, state.turn) == pytest.approx((speed, turn))
    assert state.command(now) is None


def test_scaling_changes_a_motion_under_way_and_counts_as_the_held_key() -> None:
    state, now = typed("iq")
    assert state.command(now) == pytest.approx((0.44, 0, 0, 0))
    assert state.command(now + 0.6) is not None
    assert state.command(now + 0.61) is None


def test_scaling_sets_nothing_in_motion_again() -> None:
    state, now = typed("i")
    state = on_key(state, KeyEvent("q", now + 0.7), P)
    assert state.command(now + 0.7) is None


def test_scaling_ends_at_the_limits() -> None:
    p = TeleopParameters(speed=0.4, turn=0.8, speed_limit=0.5, turn_limit=1.0)
    state, _ = typed("q" * 9, p)
    assert (state.speed, state.turn) == (0.5, 1.0)
    state, _ = typed("z" * 200, p)
    assert (state.speed, state.turn) == (MIN_SPEED, MIN_SPEED)


def test_the_speeds_at_the_start_keep_to_the_limits() -> None:
    state = KeyState.initial(TeleopParameters(speed=3.0, turn=3.0, speed_limit=0.2, turn_limit=0.3))
    assert (state.speed, state.turn) == (0.2, 0.3)


@pytest.mark.parametrize("key", ["k", " ", "K", "5", "other", "\x1a"])
def test_any_other_key_stops(key: str) -> None:
    state, now = typed("i")
    press = KeyEvent(key, now + 0.1)
    assert is_stop(press)
    assert on_key(state, press, P).command(now + 0.1) is None


def test_of_two_keys_the_later_one_counts() -> None:
    state, now = typed("il")
    assert state.command(now) == Velocity(0, 0, 0, -0.8)
    state = on_key(state, KeyEvent("i", now + 0.03), P)
    assert state.command(now + 0.03) == Velocity(0.4, 0, 0, 0)


def test_where_it_is_told_that_a_key_went_up_its_motion_ends_at_once() -> None:
    state, now = typed("il")
    up = KeyEvent("i", now + 0.01, released=True)
    assert on_key(state, up, P).command(now + 0.01) == Velocity(0, 0, 0, -0.8)
    assert on_key(state, KeyEvent("l", now + 0.02, released=True), P).command(now + 0.02) is None
    assert not is_stop(up)


@given(st.lists(st.sampled_from([*MOVES, *SCALES, "k", " "]), max_size=80))
def test_no_keys_exceed_the_limits(keys: list[str]) -> None:
    p = TeleopParameters(speed=0.4, turn=0.8, speed_limit=0.6, turn_limit=0.9)
    state, now = KeyState.initial(p), 0.0
    for key in keys:
        now += 0.1
        state = on_key(state, KeyEvent(key, now), p)
        motion = state.command(now)
        assert MIN_SPEED <= state.speed <= 0.6
        assert MIN_SPEED <= state.turn <= 0.9
        assert motion is None or (max(map(abs, motion[:3])) <= 0.6 and abs(motion.yaw) <= 0.9)
    assert state.command(now + 0.61) is None
