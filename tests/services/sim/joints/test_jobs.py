"""The queue of effort jobs: when each acts, which ones act together, and the resulting effort."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.urdf import JointLimits, read_joint_limits
from services.runtime.errors import BadInput
from services.sim.joints.effort_controller import EffortRule, net_effort
from services.sim.joints.jobs import MAX_JOBS, Job, JobQueue, schedule_job

MS = 1_000_000
ARM = read_joint_limits("arm")["bear_link"]


def acting(jobs: JobQueue[float], step: int, until: int, mode: str = "active") -> list[list[float]]:
    """Return the values that act at each step from 0 on; times in ms."""
    return [getattr(jobs, mode)(now * MS) for now in range(0, until, step)]


@pytest.mark.parametrize(("step", "steps"), [(1, 101), (5, 21), (10, 11)])
def test_a_job_of_a_tenth_of_a_second_acts_at_both_its_ends(step: int, steps: int) -> None:
    jobs: JobQueue[float] = JobQueue()
    job, note = schedule_job(3.0, 0, 0.1, 0, step * MS)
    jobs.add(job)
    seen = acting(jobs, step, 300)
    assert note == ""
    assert [len(each) for each in seen] == [1] * steps + [0] * (len(seen) - steps)
    assert len(jobs) == 0


@pytest.mark.parametrize("duration", [0.0, 0.001, 0.0049])
@pytest.mark.parametrize("start", [0, 2, 5, 12])
def test_a_job_shorter_than_a_step_acts_on_one_step_and_says_so(duration: float, start: int) -> None:
    jobs: JobQueue[float] = JobQueue()
    job, note = schedule_job(3.0, start * MS, duration, 0, 5 * MS)
    jobs.add(job)
    assert [len(each) for each in acting(jobs, 5, 50)].count(1) == 1
    assert note == "for one physics step of 5 ms, the shortest there is"


def test_a_start_in_the_past_is_now_and_one_ahead_waits() -> None:
    late, _ = schedule_job(1.0, 100 * MS, 0.01, 700 * MS, 5 * MS)
    assert (late.start, late.end) == (700 * MS, 710 * MS)
    jobs: JobQueue[float] = JobQueue()
    jobs.add(schedule_job(1.0, 20 * MS, 0.01, 0, 5 * MS)[0])
    assert acting(jobs, 5, 40) == [[], [], [], [], [1.0], [1.0], [1.0], []]


def test_a_negative_duration_lasts_until_it_is_cleared() -> None:
    jobs: JobQueue[float] = JobQueue()
    job, note = schedule_job(1.0, 0, -1.0, 0, 5 * MS)
    jobs.add(job)
    assert (job.end, note) == (inf, "until it is cleared")
    assert jobs.active(10**15) == [1.0]
    assert jobs.clear() == 1
    assert jobs.active(10**15) == []


def test_overlapping_jobs_add_up_or_the_last_to_begin_acts_alone() -> None:
    for mode, expected in (
        ("active", [[1.0], [1.0], [1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [1.0], [1.0], [], []]),
        ("latest", [[1.0], [1.0], [2.0], [2.0], [2.0], [], [], [], []]),
    ):
        jobs: JobQueue[float] = JobQueue()
        jobs.add(Job(2.0, 10 * MS, 20 * MS))
        jobs.add(Job(1.0, 0, 30 * MS))
        assert acting(jobs, 5, 45, mode) == expected, mode


def test_of_those_that_begin_together_the_last_to_come_acts() -> None:
    jobs: JobQueue[float] = JobQueue()
    for value in (1.0, 2.0, 3.0):
        jobs.add(Job(value, 0, 10 * MS))
    assert jobs.latest(0) == [3.0]
    assert len(jobs) == 1, "what it replaced is gone"


def test_a_publisher_that_dies_takes_what_has_no_end() -> None:
    jobs: JobQueue[float] = JobQueue()
    for value, end, source in ((1.0, inf, b"a"), (2.0, 50 * MS, b"a"), (3.0, inf, b"b"), (4.0, inf, b"")):
        jobs.add(Job(value, 0, end, source))
    jobs.publisher_lost(b"a")
    assert jobs.active(0) == [2.0, 3.0, 4.0]


def test_there_is_an_end_to_how_many_wait() -> None:
    jobs: JobQueue[float] = JobQueue()
    for number in range(MAX_JOBS):
        jobs.add(Job(float(number), 10**12 + number, inf))
    with pytest.raises(BadInput, match=f"{MAX_JOBS} jobs are waiting or acting.*clear some first"):
        jobs.add(Job(0.0, 0, inf))


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50), st.floats(-100, 100)), max_size=12))
def test_of_all_that_act_the_one_with_the_latest_start_is_the_last(given_: list[tuple[int, int, float]]) -> None:
    """Compared with another formulation: a job acts until its end or until another starts."""
    jobs: JobQueue[float] = JobQueue()
    for start, length, value in given_:
        jobs.add(Job(value, start * MS, (start + length) * MS))
    for now in range(105):
        begun = [(start, number) for number, (start, _, _) in enumerate(given_) if start <= now]
        newest = given_[max(begun)[1]] if begun else None
        expected = [newest[2]] if newest and now <= newest[0] + newest[1] else []
        assert jobs.latest(now * MS) == expected


LIMITED = JointLimits("revolute", effort=10.0, velocity=2.0)
NO_RATE = JointLimits("revolute", effort=10.0, velocity=0.0)
TOTAL, EACH = EffortRule("sum", "total"), EffortRule("sum", "each")


@pytest.mark.parametrize(
    ("rule", "limits", "rate", "efforts", "expected"),
    [
        (TOTAL, LIMITED, 0.0, [8.0, 8.0], 10.0),
        (TOTAL, LIMITED, 0.0, [-80.0, 75.0], -5.0),
        (EACH, LIMITED, 0.0, [8.0, 8.0], 16.0),
        (EACH, LIMITED, 0.0, [-80.0, 75.0], 0.0),
        (TOTAL, LIMITED, 2.5, [8.0], 0.0),
        (TOTAL, LIMITED, 2.0, [8.0], 8.0),
        (TOTAL, LIMITED, 2.5, [-8.0], -8.0),
        (TOTAL, LIMITED, -2.5, [-8.0], 0.0),
        (TOTAL, NO_RATE, 2.5, [8.0], 8.0),
        (EffortRule("sum", "each", "gazebo"), NO_RATE, 1e-9, [8.0, -3.0], -3.0),
        (EffortRule("replace", "total", "gazebo"), NO_RATE, 0.0, [8.0], 8.0),
        (TOTAL, JointLimits("continuous"), 1e3, [1e6], 1e6),
        (TOTAL, JointLimits("revolute", effort=0.0), 0.0, [5.0], 0.0),
        (TOTAL, ARM, 50.0, [1200.0], 1000.0),
    ],
)
def test_what_efforts_come_to(
    rule: EffortRule, limits: JointLimits, rate: float, efforts: list[float], expected: float
) -> None:
    assert net_effort(rule, limits, rate, efforts) == expected


def test_limits_are_read_from_the_urdf() -> None:
    assert JointLimits("revolute", -1.5708, 1.5708, 1000.0, 0.0) == ARM
    wheel = read_joint_limits("burger")["wheel_left_joint"]
    assert (wheel.kind, wheel.lower, wheel.upper) == ("continuous", None, None)
