"""The restart policy on histories written as data, with a fake clock."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.restart_policy import ExitDecision, Failed, Finished, Restart, RestartMode, RestartPolicy, decide_after_exit
from services.runtime.errors import TRY_AGAIN

MIDDLE = 0.5
"""A random number that gives no jitter."""


def replay(policy: RestartPolicy, exits: list[tuple[float, int]], chance: float = MIDDLE) -> list[ExitDecision]:
    """Return the decisions on exits, each given as (time since the last start, exit status)."""
    now, restarts, verdicts = 0.0, list[float](), list[ExitDecision]()
    for lived, status in exits:
        now += lived
        verdict = decide_after_exit(policy, restarts, now, status, chance)
        verdicts.append(verdict)
        if not isinstance(verdict, Restart):
            break
        now += verdict.pause
        restarts.append(now)
    return verdicts


def test_crash_loop_backs_off_and_is_given_up_after_five_restarts() -> None:
    verdicts = replay(RestartPolicy(), [(0.1, 1)] * 10)
    assert verdicts[:5] == [Restart(pause) for pause in (0.1, 0.2, 0.4, 0.8, 1.6)]
    assert verdicts[5:] == [Failed("exit status 1; restarted 5 times within 30 s")]


def test_pause_is_bounded() -> None:
    verdicts = replay(RestartPolicy(limit=100, window=1000), [(0.1, 1)] * 12)
    assert [each.pause for each in verdicts if isinstance(each, Restart)][-4:] == [5.0] * 4


def test_who_runs_well_for_a_while_is_forgiven() -> None:
    assert replay(RestartPolicy(), [(31.0, 1)] * 20) == [Restart(0.1)] * 20


def test_restarts_leave_the_window_one_by_one() -> None:
    verdicts = replay(RestartPolicy(limit=2, window=10), [(4.0, 1)] * 6)
    assert verdicts == [Restart(0.1), Restart(0.2), Failed("exit status 1; restarted 2 times within 10 s")]
    assert replay(RestartPolicy(limit=2, window=10), [(6.0, 1)] * 6) == [Restart(0.1)] + [Restart(0.2)] * 5


@pytest.mark.parametrize(
    ("when", "status", "verdict"),
    [
        ("on-failure", 0, Finished()),
        ("on-failure", 1, Restart(0.1)),
        ("on-failure", -9, Restart(0.1)),
        ("always", 0, Restart(0.1)),
        ("always", -11, Restart(0.1)),
        ("never", 0, Finished()),
        ("never", 2, Failed("exit status 2")),
        ("never", -9, Failed("killed by signal 9")),
    ],
)
def test_first_exit(when: str, status: int, verdict: ExitDecision) -> None:
    assert replay(RestartPolicy(when=when), [(1.0, status)]) == [verdict]  # type: ignore[arg-type]


@pytest.mark.parametrize("when", ["never", "on-failure", "always"])
def test_what_was_given_bad_input_is_not_started_again(when: RestartMode) -> None:
    assert decide_after_exit(RestartPolicy(when=when), [], 1.0, 2, MIDDLE, "no file a.csv") == Failed(
        "exit status 2: no file a.csv"
    )
    assert decide_after_exit(RestartPolicy(when=when), [0.5], 1.0, 2, MIDDLE) == Failed("exit status 2")


def test_what_may_work_a_moment_later_is_tried_again() -> None:
    assert replay(RestartPolicy(), [(0.1, TRY_AGAIN)] * 2) == [Restart(0.1), Restart(0.2)]


def test_no_restart_at_all_with_a_limit_of_zero() -> None:
    assert isinstance(replay(RestartPolicy(limit=0), [(1.0, 1)])[0], Failed)


@given(st.floats(0, 1, exclude_max=True), st.integers(0, 20))
def test_jitter_stays_within_a_fifth_and_below_the_longest(chance: float, earlier: int) -> None:
    policy = RestartPolicy(limit=1000, window=1000)
    verdict = decide_after_exit(policy, [0.0] * earlier, 1.0, 1, chance)
    assert isinstance(verdict, Restart)
    middle = min(5.0, 0.1 * 2**earlier)
    assert 0.8 * middle <= verdict.pause <= min(5.0, 1.2 * middle)


def test_jitter_repeats_with_the_seed() -> None:
    def pauses(seed: int) -> list[ExitDecision]:
        dice = random.Random(seed)
        return [decide_after_exit(RestartPolicy(), [], 0.0, 1, dice.random()) for _ in range(5)]

    assert pauses(1) == pauses(1) != pauses(2)
