"""The arm service's loop on the in-memory transport; the test plays the simulation and the reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from messages.joints import JointEffort
from messages.sensor import JointState
from messages.std import Float32, Header, Time
from messages.topics import (
    CONTROL_ERROR,
    CONTROL_SIGNAL,
    CONTROL_STATE,
    JOINT_ANGLE,
    JOINT_EFFORT,
    JOINT_STATES,
    REFERENCE,
)
from services.arm import SERVICE, ArmParameters
from services.runtime.testing import ServiceHarness, run_service
from tests.harness.waiting import wait_until
from tests.services.arm.pendulum import Pendulum

STEP_MS = 5


class ArmLoopHarness:
    """A simulated arm and its service; one control tick is two physics steps."""

    def __init__(self, bench: ServiceHarness) -> None:
        self.bench, self.arm = bench, Pendulum(angle=0.2)
        self.ms = self.epoch = 0
        self.jobs: list[JointEffort] = []

    def tick(self, reference: float | None = None, states: bool = True, acts: bool = True) -> None:
        """Run one tick of the service; ``acts``: whether it should publish an effort."""
        now = Time.of(self.ms * 1_000_000)
        if states:
            position, rate = (self.arm.angle,), (self.arm.rate,)
            state = JointState(header=Header(stamp=now), name=("bear_link",), position=position, velocity=rate)
            self.bench.publish(JOINT_STATES, state)
        if reference is not None:
            self.bench.publish(REFERENCE, Float32(data=reference))
        self.bench.set_time(self.ms / 1000, self.epoch)
        if acts:
            self.jobs.append(self.bench.next(JOINT_EFFORT))
        effort = self.jobs[-1].effort if acts else 0.0
        for _ in range(2):
            self.arm.step(effort)
        self.ms += 2 * STEP_MS

    def idle(self, reference: float | None = None) -> bool:
        """Run a tick without waiting for an effort; return False, so that ``wait_until`` can call it."""
        self.tick(reference, acts=False)
        return False

    def run(self, seconds: float, reference: Callable[[float], float | None] = lambda _: None) -> None:
        """Run ticks for ``seconds``, with a reference at every second one."""
        for number in range(round(seconds * 100)):
            self.tick(reference(self.ms / 1000) if number % 2 == 0 else None)


@contextmanager
def standing(p: ArmParameters | None = None) -> Iterator[ArmLoopHarness]:
    with run_service(SERVICE, "/arm", p or ArmParameters()) as bench:
        yield ArmLoopHarness(bench)


def test_before_the_first_reference_it_holds_what_it_found() -> None:
    with standing() as stand:
        stand.run(1.0)
        assert stand.arm.degrees == pytest.approx(math.degrees(0.2), abs=0.3)
        assert "holding bear_link, starting at 11.46 deg" in stand.bench.log
        assert "no reference on /robot_control/reference yet, holding 11.46 deg" in stand.bench.log
        assert stand.bench.drain(CONTROL_ERROR) == [], "there is no error without a reference"
        assert stand.bench.drain(CONTROL_STATE) == []
        assert len(stand.bench.drain(JOINT_ANGLE)) >= 99
        job = stand.jobs[-1]
        assert (job.joint_name, job.duration) == ("bear_link", 0.1)
        assert job.start_time.ns == (stand.ms - 10) * 1_000_000


def test_it_takes_the_joint_to_the_reference_and_tells_all_of_it() -> None:
    with standing() as stand:
        stand.run(1.5, lambda _: 30.0)
        assert stand.arm.degrees == pytest.approx(29.626, abs=0.01)
        angles = [each.data for each in stand.bench.drain(JOINT_ANGLE)]
        errors = [each.data for each in stand.bench.drain(CONTROL_ERROR)]
        signals = [each.data for each in stand.bench.drain(CONTROL_SIGNAL)]
        states = stand.bench.drain(CONTROL_STATE)
        assert errors == pytest.approx([30.0 - angle for angle in angles[-len(errors) :]])
        assert signals == [job.effort for job in stand.jobs][: len(signals)]
        assert max(map(abs, signals)) == 200.0
        last = states[-1]
        assert (last.set_point, last.command, last.error) == (30.0, signals[-1], errors[-1])
        assert (last.p, last.i, last.d, last.antiwindup, last.time_step) == (37.5, 0.0, 2.8, True, 0.01)


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_an_effort_acts_for_two_periods_at_least(rate: float) -> None:
    with standing(ArmParameters(rate=rate, duration=0.0)) as stand:
        stand.tick(0.0)
        assert stand.jobs[0].duration == pytest.approx(2 / rate)


def test_a_silent_reference_is_held_and_a_returning_one_is_followed() -> None:
    with standing(ArmParameters(gravity=True)) as stand:
        stand.run(1.0, lambda time: 20.0 + time)
        stand.run(1.5)
        assert stand.arm.degrees == pytest.approx(20.98, abs=0.05)
        assert "holding 20.98 deg: is its service still running?" in stand.bench.log
        stand.run(1.0, lambda _: -10.0)
        assert stand.arm.degrees == pytest.approx(-10.0, abs=0.02)
        assert "references are arriving again" in stand.bench.log


def test_without_joint_states_it_lets_go_and_begins_anew_with_them() -> None:
    with standing(ArmParameters(controller_type="tr", tr_Ki=50.0)) as stand:
        stand.run(1.0, lambda _: 30.0)
        for _ in range(10):
            stand.tick(states=False)
        stand.tick(states=False)
        assert (stand.jobs[-1].effort, stand.jobs[-1].duration) == (0.0, 0.0), "at once, not after the last job"
        before = len(stand.jobs)
        for _ in range(20):
            stand.tick(states=False, acts=False)
        wait_until(lambda: "no joint states on /arm/joint_states for 0.1 s, releasing the joint" in stand.bench.log)
        assert stand.bench.drain(JOINT_EFFORT) == []
        stand.run(1.0, lambda _: 0.0)
        assert len(stand.jobs) == before + 100
        assert abs(stand.arm.degrees) < 1.0


@pytest.mark.parametrize("absurd", [90.6, -1e9, 3e38])
def test_what_the_joint_cannot_do_is_refused(absurd: float) -> None:
    with standing() as stand:
        stand.run(1.0, lambda _: 10.0)
        stand.run(0.5, lambda _: absurd)
        assert stand.arm.degrees == pytest.approx(9.85, abs=0.1)
        assert "refused, bear_link moves from -90 to 90 deg" in stand.bench.log


def test_a_motion_does_not_go_on_beyond_the_joint() -> None:
    """Extrapolated from the samples at 89.8 and 90 deg it would reach 90.2 deg."""
    with standing() as stand:
        stand.run(1.2, lambda time: min(90.0, 65.0 + 31.0 * round(time * 50) / 50))
        wanted = [each.set_point for each in stand.bench.drain(CONTROL_STATE)]
        assert max(wanted) == 90.0
        assert 89.0 < sorted(set(wanted))[-2] < 90.0


def test_what_is_no_number_is_refused_on_arrival() -> None:
    with standing() as stand:
        stand.run(1.0, lambda _: 10.0)
        stand.run(0.3, lambda _: math.nan)
        stand.run(0.1, lambda _: math.inf)
        assert stand.arm.degrees == pytest.approx(9.85, abs=0.1)


def test_joint_states_of_another_joint_move_nothing() -> None:
    with standing(ArmParameters(joint="elbow")) as stand:
        said = "have no position of 'elbow' (only of: bear_link)"
        wait_until(lambda: stand.idle(30.0) or said in stand.bench.log)
        assert stand.bench.drain(JOINT_EFFORT) == []


def test_when_time_begins_anew_nothing_of_before_counts() -> None:
    with standing(ArmParameters(controller_type="tr", tr_Ki=50.0)) as stand:
        stand.run(1.0, lambda _: 30.0)
        stand.ms, stand.epoch, stand.arm = 0, 1, Pendulum()
        # Messages that arrived with the reset are ignored, so the first tick has no joint state.
        wait_until(lambda: stand.idle() or stand.bench.drain(JOINT_EFFORT))
        stand.run(0.3)
        assert abs(stand.arm.degrees) < 2.0, "held where it was found, without the integral of before"
        assert abs(stand.jobs[-1].effort) < 3.0


def test_a_jump_of_time_is_neither_summed_up_nor_derived_over() -> None:
    with standing(ArmParameters(law="tutorial", controller_type="tr")) as stand:
        stand.run(1.0, lambda _: 10.0)
        before = stand.jobs[-1].effort
        stand.ms += 5000
        stand.tick(10.0)
        assert stand.jobs[-1].effort == pytest.approx(before, abs=0.5)


def test_at_its_end_it_lets_go() -> None:
    with standing() as stand:
        stand.run(0.2, lambda _: 5.0)
        bench = stand.bench
    last = bench.drain(JOINT_EFFORT)[-1]
    assert (last.effort, last.duration) == (0.0, 0.0)
