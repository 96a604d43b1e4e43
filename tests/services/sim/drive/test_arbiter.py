"""The command arbiter: priorities, time-outs on arrival and age, lost publishers, the emergency stop, and counts."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.model import read_model
from services.sim.drive.arbiter import BRAKE, Arbiter, Decision
from services.sim.drive.driver import AT_REST, step_drive, wheel_speeds
from tests.services.sim.physics.driven_robot import ramped_drive

MS = 1_000_000
TELEOP, CONTROLLER = 10, 1
A, B = b"controller", b"teleop"


def test_nobody_ever_spoke_means_brake() -> None:
    assert Arbiter().decide(5_000 * MS) == BRAKE


def test_another_timeout_counts_for_the_commands_that_came() -> None:
    arbiter = Arbiter(0.25)
    arbiter.accept(A, CONTROLLER, 0.2, 0.1, None, 100 * MS)
    arbiter.reconfigure(0.5, False, 200 * MS)
    assert arbiter.decide(600 * MS) == Decision(0.2, 0.1, False, A)
    arbiter.reconfigure(0.4, False, 600 * MS)
    assert arbiter.decide(600 * MS) == BRAKE
    assert arbiter.commands_timed_out == 1
    arbiter.reconfigure(0.0, True, 700 * MS)
    arbiter.accept(A, CONTROLLER, 0.2, 0.1, None, 800 * MS)
    assert arbiter.decide(10**15) == Decision(0.2, 0.1, False, A)
    arbiter.accept(B, CONTROLLER, 0.1, 0.1, None, 900 * MS)
    assert arbiter.conflict


def test_a_command_holds_until_it_is_older_than_the_timeout() -> None:
    arbiter = Arbiter(0.25)
    assert arbiter.accept(A, CONTROLLER, 0.2, 0.1, None, 100 * MS)
    assert arbiter.decide(100 * MS) == Decision(0.2, 0.1, False, A)
    assert arbiter.decide(350 * MS) == Decision(0.2, 0.1, False, A)
    assert arbiter.decide(350 * MS + 1) == BRAKE
    assert arbiter.timed_out
    assert arbiter.commands_timed_out == 1


def test_a_lapse_counts_once_and_only_for_a_base_that_was_told_to_move() -> None:
    arbiter = Arbiter(0.25)
    arbiter.accept(A, CONTROLLER, 0.2, 0.0, None, 0)
    for now in range(0, 2000, 5):
        arbiter.decide(now * MS)
    assert arbiter.commands_timed_out == 1
    arbiter.accept(A, CONTROLLER, 0.0, 0.0, None, 2000 * MS)
    assert not arbiter.timed_out
    arbiter.decide(3000 * MS)
    assert arbiter.timed_out
    assert arbiter.commands_timed_out == 1, "it had been told to stand"


def test_a_timeout_of_zero_holds_a_command_until_its_publisher_is_gone() -> None:
    arbiter = Arbiter(0.0)
    arbiter.accept(A, CONTROLLER, 0.2, 0.0, 0, 0)
    assert arbiter.decide(10**15).v == 0.2
    arbiter.publisher_lost(A, 10**15)
    assert arbiter.decide(10**15) == BRAKE


def test_age_counts_from_the_stamp() -> None:
    arbiter = Arbiter(0.25)
    assert arbiter.accept(A, CONTROLLER, 0.2, 0.0, 0, 200 * MS)
    assert not arbiter.decide(250 * MS).braking
    assert arbiter.decide(251 * MS).braking, "50 ms after its arrival"


def test_a_burst_of_old_commands_moves_nothing() -> None:
    arbiter = Arbiter(0.25)
    for age in range(3000, 250, -40):
        assert not arbiter.accept(A, CONTROLLER, 0.2, 0.0, (3000 - age) * MS, 3000 * MS)
    assert arbiter.decide(3000 * MS) == BRAKE
    assert arbiter.stale_dropped == 69
    assert arbiter.commands == 0


def test_a_command_from_before_a_reset_bears_a_future_stamp_and_is_stale() -> None:
    arbiter = Arbiter(0.25)
    assert not arbiter.accept(A, CONTROLLER, 0.2, 0.0, 60_000 * MS, 5 * MS)
    assert arbiter.stale_dropped == 1


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e308, 100.1])
def test_nonsense_is_refused_and_the_last_good_command_stays(bad: float) -> None:
    arbiter = Arbiter(0.25)
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    assert not arbiter.accept(A, CONTROLLER, bad, 0.0, None, 10 * MS)
    assert not arbiter.accept(A, CONTROLLER, 0.0, 11 * bad, None, 10 * MS)
    assert arbiter.decide(10 * MS).v == 0.1
    assert arbiter.refused == 2
    assert arbiter.decide(251 * MS).braking, "refused commands keep nothing alive"
    assert arbiter.accept(A, CONTROLLER, 0.2, 0.0, None, 300 * MS)


def test_the_highest_live_priority_wins_and_falls_back() -> None:
    arbiter = Arbiter(0.25)
    for now in range(0, 1000, 40):
        arbiter.accept(A, CONTROLLER, 0.2, 0.0, None, now * MS)
        if now == 200:
            arbiter.accept(B, TELEOP, -0.1, 0.0, None, now * MS)
        source = arbiter.decide(now * MS).source
        assert source == (B if 200 <= now <= 450 else A)
    assert arbiter.commands_timed_out == 0, "the base always had a commander"


def test_among_equals_the_last_word_counts() -> None:
    arbiter = Arbiter()
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    arbiter.accept(B, CONTROLLER, 0.2, 0.0, None, 0)
    assert arbiter.decide(0).source == B
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    assert arbiter.decide(0).source == A


def test_a_lost_publisher_is_forgotten_at_once() -> None:
    arbiter = Arbiter()
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    arbiter.accept(B, TELEOP, 0.2, 0.0, None, 0)
    arbiter.publisher_lost(B, MS)
    assert arbiter.decide(MS).source == A
    arbiter.publisher_lost(A, 2 * MS)
    assert arbiter.decide(2 * MS) == BRAKE
    assert arbiter.commands_timed_out == 1
    arbiter.publisher_lost(b"stranger", 3 * MS)


def test_an_emergency_stop_latches_and_needs_a_fresh_command_afterwards() -> None:
    arbiter = Arbiter()
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    arbiter.set_e_stop(True)
    assert arbiter.decide(0) == BRAKE
    assert arbiter.accept(A, TELEOP, 0.1, 0.0, None, 10 * MS)
    assert arbiter.decide(10 * MS) == BRAKE
    arbiter.set_e_stop(False)
    assert arbiter.decide(10 * MS) == BRAKE, "the command of before does not revive"
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 20 * MS)
    assert arbiter.decide(20 * MS).v == 0.1


def test_clear_forgets_commands_but_not_the_emergency_stop_or_the_counts() -> None:
    arbiter = Arbiter()
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 900 * MS)
    arbiter.set_e_stop(True)
    arbiter.clear()
    assert arbiter.e_stopped
    assert arbiter.commands == 1
    assert arbiter.decide(0) == BRAKE


anything = st.floats(allow_nan=True, allow_infinity=True)
offers = st.lists(
    st.tuples(st.sampled_from([A, B]), st.integers(0, 2), anything, anything, st.integers(-300, 300)), max_size=50
)


@given(offers, st.booleans())
def test_whatever_is_offered_only_finite_bounded_speeds_reach_the_wheels(
    series: list[tuple[bytes, int, float, float, int]], clamp: bool
) -> None:
    wheels = read_model("burger").wheels
    assert wheels is not None
    drive, arbiter, state = ramped_drive(wheels, clamp=clamp), Arbiter(), AT_REST
    for step, (source, priority, v, w, age) in enumerate(series):
        now = step * 5 * MS
        arbiter.accept(source, priority, v, w, now - age * MS, now)
        decision = arbiter.decide(now)
        state = step_drive(drive, state, decision.v, decision.w, decision.braking, 0.005)
        assert all(math.isfinite(speed) and abs(speed) < 6000 for speed in wheel_speeds(drive, state))
    assert arbiter.commands + arbiter.refused + arbiter.stale_dropped == len(series)


def test_where_one_commander_is_allowed_several_mean_brake() -> None:
    arbiter = Arbiter(0.25, exclusive=True)
    assert arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 0)
    assert not arbiter.accept(B, TELEOP, 0.2, 0.0, None, 100 * MS), "whatever its priority"
    assert arbiter.decide(100 * MS) == BRAKE
    assert arbiter.conflict
    assert not arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 200 * MS)
    assert arbiter.refused == 2
    assert arbiter.decide(351 * MS) == Decision(0.1, 0.0, False, A), "the other one is silent"
    assert not arbiter.conflict
    arbiter.accept(B, TELEOP, 0.2, 0.0, None, 400 * MS)
    arbiter.publisher_lost(A, 410 * MS)
    assert arbiter.decide(410 * MS).source == B
    arbiter.accept(A, CONTROLLER, 0.1, 0.0, None, 420 * MS)
    arbiter.clear()
    assert not arbiter.conflict


@pytest.mark.parametrize("tiny", [5e-324, -2.3e-308, 9e-10])
def test_a_command_too_small_to_see_is_a_standstill(tiny: float) -> None:
    arbiter = Arbiter()
    assert arbiter.accept(A, CONTROLLER, tiny, -tiny, None, 0)
    assert arbiter.decide(0) == Decision(0.0, 0.0, False, A)
