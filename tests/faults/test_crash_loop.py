"""Fault 8: a service repeatedly exits as soon as it starts."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

import psutil
import pytest

from deploy.bench.figures import Figure
from deploy.restart_policy import JITTER, RestartPolicy
from tests.faults.fleet_files import FIRST_PAUSE_S, WINDOW_S
from tests.faults.supervised_fleet import START_S, SupervisedFleet

pytestmark = pytest.mark.waits

NAME = "crash_at_once"
POLICY = RestartPolicy(first=FIRST_PAUSE_S, window=WINDOW_S)


def test_it_is_given_up_after_pauses_that_grow(broken: SupervisedFleet) -> None:
    broken.wait(lambda: broken.process(NAME).state == "failed", "a service that is given up", START_S)
    log = broken.log(NAME)
    pauses = [float(each) for each in re.findall(r"backing off: exit status 1; restarting in ([\d.]+) s", log)]
    expected = [min(POLICY.longest, POLICY.first * 2**number) for number in range(POLICY.limit)]
    assert pauses == pytest.approx(expected, rel=JITTER + 0.05)
    assert f"{NAME} failed: exit status 1; restarted 5 times within 600 s" in log
    assert log.splitlines().count("the lidar does not answer") == 1 + POLICY.limit
    broken.wait(lambda: f"{NAME} failed: exit status 1" in broken.supervisor.text, "the supervisor's word")
    assert broken.process(NAME).restarts == POLICY.limit


def test_it_stays_given_up_and_the_others_do_not_mind(broken: SupervisedFleet) -> None:
    broken.wait(lambda: broken.process(NAME).state == "failed", "a service that is given up", START_S)
    broken.wait_full_speed("tb3_0")
    robot = broken.robot("tb3_0")
    seen = robot.samples[-1].sent
    broken.wait_simulated((1 + JITTER) * POLICY.first * 2**POLICY.limit + 0.5)  # longer than the next pause would be
    assert broken.log(NAME).splitlines().count("the lidar does not answer") == 1 + POLICY.limit
    assert robot.samples[-1].sent > seen
    assert robot.slowed(seen) == []
    for name in ("router", "sim", "grader", "tb3_0/waypoint"):
        assert (broken.process(name).state, broken.process(name).restarts) == ("ready", 0)


@pytest.mark.bench
def test_the_supervisor_costs_little_beside_it(broken: SupervisedFleet, keeps_bound: Callable[[Figure], None]) -> None:
    broken.wait(lambda: broken.process(NAME).state == "failed", "a service that is given up", START_S)
    broken.wait_full_speed("tb3_0")
    supervisor = psutil.Process(broken.supervisor.pid)
    start, begun = sum(supervisor.cpu_times()[:2]), time.monotonic()
    broken.wait_simulated(3.0)
    busy = 100 * (sum(supervisor.cpu_times()[:2]) - start) / (time.monotonic() - begun)
    about = "share of a core of the supervisor beside a service that it has given up"
    keeps_bound(Figure("supervisor_cpu_percent", "%", about, (busy,), at_most=5.0))
