"""The tutorial's laws on the arm: one job at a time, and jobs that add up, as documented by and as done in Gazebo."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from services.sim.engines import Engine
from services.sim.joints.effort_controller import EffortRule
from tests.services.sim.physics.arm_simulation import arm_simulation, set_point_pid, tracking_pid
from tests.services.sim.physics.driven_robot import DT

RATES = (50, 100, 200)
"""Control rates [Hz]."""
SUM = EffortRule("sum", "each", "unspecified")
GAZEBO = EffortRule("sum", "each", "gazebo")


def step(_: float) -> float:
    return 30.0


@pytest.mark.parametrize("rate", RATES)
def test_a_step_with_one_job_at_a_time(rate: int, engine: Engine) -> None:
    """The PD's steady error is that of gravity: 14.02 N m over 37.5 N m per degree."""
    with arm_simulation(engine=engine) as on:
        on.control(set_point_pid(), step, rate, 2.0)
    low, high = (next(i for i, angle in enumerate(on.angles) if angle >= share * 29.63) for share in (0.1, 0.9))
    assert 0.12 <= (high - low) * DT <= 0.15
    assert on.angles[-1] == pytest.approx(29.626, abs=0.01)
    assert max(on.angles) < 29.63 + 0.02
    assert max(map(abs, on.efforts)) == 200.0


@pytest.mark.parametrize("rate", RATES)
def test_a_sine_with_one_job_at_a_time(rate: int, engine: Engine) -> None:
    with arm_simulation(engine=engine) as on:
        errors = on.control(tracking_pid(), lambda t: 30.0 * math.sin(math.tau * 0.2 * t), rate, 15.0)[5 * rate :]
    assert math.sqrt(sum(error**2 for error in errors) / len(errors)) == pytest.approx(0.192, abs=0.003)
    assert max(map(abs, errors)) == pytest.approx(0.28, abs=0.01)
    assert max(map(abs, on.efforts[round(5 / DT) :])) == pytest.approx(10.9, abs=0.1)


@pytest.mark.parametrize("rate", RATES)
def test_jobs_that_add_up_never_settle(rate: int, engine: Engine) -> None:
    with arm_simulation(rule=SUM, engine=engine) as on:
        on.control(set_point_pid(), step, rate, 8.0)
    last = on.angles[-400:]
    assert max(last) - min(last) > 100.0, "it slams from stop to stop"
    assert max(map(abs, on.efforts)) == 200.0 * (rate // 10 + 1), "as many jobs as overlap, all at their limit"


@pytest.mark.parametrize("rate", [50, 100])
def test_they_settle_where_a_velocity_of_0_is_a_limit(rate: int, engine: Engine) -> None:
    with arm_simulation(rule=GAZEBO, engine=engine) as on:
        on.control(set_point_pid(), step, rate, 8.0)
    assert max(map(abs, (angle - 29.9 for angle in on.angles[-400:]))) < 0.1
    assert max(on.angles) < 30.0
    first, last = (next(i for i, angle in enumerate(on.angles) if angle >= at) for at in (3.0, 27.0))
    assert (last - first) * DT > 0.4, "slower than one job at a time"


def test_they_ripple_where_each_physics_step_brings_another_job(engine: Engine) -> None:
    """At 200 Hz and 5 ms the rule decides once per job, and a braking effort has reversed the motion by its next
    decision. Each job's saturation bounds the ripple: it stays about the set point, as wide after half a minute as at
    first.
    """
    with arm_simulation(rule=GAZEBO, engine=engine) as on:
        on.control(set_point_pid(), step, 200, 32.0)
    windows = [on.angles[begin : begin + 800] for begin in range(800, 6400, 800)]
    for window in windows:
        assert sum(window) / len(window) == pytest.approx(30.0, abs=0.3)
        assert 2.0 < max(window) - min(window) < 4.5
    assert max(on.angles) < 33.0, "far from the stops at 90"
    last = on.efforts[-800:]
    turns = sum(one * other < 0 for one, other in pairwise(last))
    assert turns > 600, "it is braked the other way at nearly every step"


@pytest.mark.parametrize(("rate", "rests"), [(100, 29.927), (200, 29.963)])
def test_they_do_not_ripple_at_the_step_of_gazebo(rate: int, rests: float, engine: Engine) -> None:
    """At steps of 1 ms, as the original does at 200 Hz, where the rule decides five times per job."""
    with arm_simulation(rule=GAZEBO, step_ns=1_000_000, engine=engine) as on:
        on.control(set_point_pid(), step, rate, 8.0)
    assert max(abs(angle - rests) for angle in on.angles[-2000:]) < 0.01


def test_the_clamp_on_the_total_does_not_make_the_sum_stable(engine: Engine) -> None:
    with arm_simulation(rule=EffortRule("sum", "total", "unspecified"), engine=engine) as on:
        on.control(set_point_pid(), step, 100, 8.0)
    assert max(map(abs, on.efforts)) == 1000.0
    assert max(on.angles[-400:]) - min(on.angles[-400:]) > 100.0


def test_a_controller_that_falls_silent_lets_go_after_its_last_job(engine: Engine) -> None:
    with arm_simulation(engine=engine) as on:
        on.control(set_point_pid(), step, 100, 1.0)
        held = on.step - 2  # the last job started with the last control turn
        on.run(1.0)
    acting = [number for number, effort in enumerate(on.efforts) if effort]
    assert acting[-1] == held + 20, "0.1 s, both ends included"
    assert on.angles[-1] < 20.0


def test_the_velocity_rule_alone_makes_one_job_at_a_time_slow(engine: Engine) -> None:
    with arm_simulation(rule=EffortRule("replace", "total", "gazebo"), engine=engine) as on:
        on.control(set_point_pid(), step, 100, 6.0)
    assert not [angle for angle in on.angles[: round(2.0 / DT)] if angle >= 27.0]
    assert on.angles[-1] == pytest.approx(29.2, abs=0.3)
