"""An arm's figures for responses with known figures, and their place in the report."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest

from deploy.report.checks import Bound
from deploy.report.record import RunFacts, report_schema
from deploy.report.table import print_report
from deploy.report.write import build_report, to_json, write_report
from messages.control import JointControllerState
from messages.elea import Health, InputHealth, LockstepState
from messages.sensor import JointState
from messages.std import Header, Time
from services.grader import ArmSpec
from services.grader.arm import TRANSIENT_S, SetPointMetrics
from services.grader.measurement import Measurement, MessageKind
from services.grader.records import ArmFigures, Measurements
from services.grader.results import write_results

FACTS = RunFacts(fleet="arm", mode="lockstep", seed=0, version="0", wall_seconds=2.0)
LAG = 0.1
"""Time constant [s] of the arm in these tests."""


def exercised(
    wanted: Callable[[float], float], answer: Callable[[float], float], seconds: float, hz: int = 100
) -> SetPointMetrics:
    exercise = SetPointMetrics()
    for tick in range(round(seconds * hz)):
        exercise.add_sample(tick / hz, wanted(tick / hz), answer(tick / hz))
    return exercise


def lagging(time: float) -> float:
    """Return a first-order response [deg] from 1 s on, to 29 of the 30 commanded degrees."""
    return 29.0 * (1.0 - math.exp(-(time - 1.0) / LAG)) if time > 1.0 else 0.0


def test_a_step_of_the_first_order() -> None:
    """Rise time T ln 9, settling time T ln 50, no overshoot."""
    exercise = exercised(lambda t: 30.0 if t >= 1.0 else 0.0, lagging, 4.0)
    (step,) = exercise.steps
    assert exercise.largest_step == step
    assert (step.at_s, step.from_deg, step.to_deg) == (1.0, 0.0, 30.0)
    assert step.rise_s == pytest.approx(LAG * math.log(9.0), abs=0.002)
    assert step.settling_s == pytest.approx(LAG * math.log(50.0), abs=0.001)
    assert step.final_deg == pytest.approx(29.0, abs=1e-3)
    assert step.steady_error_deg == pytest.approx(1.0, abs=1e-3)
    assert step.overshoot_percent == pytest.approx(0.0, abs=1e-6)
    assert exercise.tracking.rms is None


def test_overshoot_and_a_step_downward() -> None:
    def ringing(t: float) -> float:
        if t <= 1.0:
            return 10.0
        return -20.0 + 30.0 * math.exp(-(t - 1.0) * 8.0) * math.cos(20.0 * (t - 1.0))

    (step,) = exercised(lambda t: -20.0 if t >= 1.0 else 10.0, ringing, 5.0).steps
    most = max(-(ringing(1.0 + tick / 100) + 20.0) / 30.0 for tick in range(100))
    assert step.overshoot_percent == pytest.approx(100.0 * most, rel=0.01)
    assert step.overshoot_percent > 20.0
    assert step.steady_error_deg == pytest.approx(0.0, abs=0.01)


def test_what_is_no_step() -> None:
    assert exercised(lambda t: 0.5 if t > 1 else 0.0, lambda t: 0.0, 3.0).steps == (), "too small"
    assert exercised(lambda t: 30.0 if t > 1 else 0.0, lagging, 1.8).steps == (), "too short"
    assert exercised(lambda t: 30.0 if t > 1 else 0.0, lambda t: 0.0, 3.0).steps == (), "nothing moved"
    assert exercised(lambda t: 30.0, lambda t: 29.0, 3.0).steps == (), "it was there from the beginning"


def swing(t: float) -> float:
    return 30.0 * math.sin(math.tau * 0.2 * (t - 1.0)) if t >= 1.0 else 0.0


@pytest.mark.parametrize("hz", [50, 100, 200])
def test_the_error_in_motion_is_the_mean_over_a_stair(hz: int) -> None:
    """The arm is 0.2 deg behind the middle of each reference step of 20 ms, whatever its controller's rate."""

    def stair(t: float) -> float:
        return swing(math.floor(t * 50 + 1e-9) / 50)

    def centred(t: float) -> float:
        first = math.floor(t * 50 + 1e-9) / 50
        ticks = [first + tick / hz for tick in range(hz // 50)]
        return swing(t) - sum(swing(each) for each in ticks) / len(ticks) + stair(t) - 0.2

    exercise = exercised(stair, centred, 16.0, hz)
    assert exercise.tracking.rms == pytest.approx(0.2, abs=1e-6)
    assert exercise.tracking.max_error == pytest.approx(0.2, abs=1e-6)
    assert exercise.steps == (), "a motion does not begin with a step"


def test_the_beginning_of_a_motion_and_its_end_are_left_out() -> None:
    def answer(t: float) -> float:
        return swing(t) - (5.0 if t < 1.0 + TRANSIENT_S or t > 11.0 else 0.1)

    exercise = exercised(lambda t: swing(t) if t < 11.0 else swing(11.0), answer, 14.0)
    assert exercise.tracking.max_error == pytest.approx(0.1, abs=1e-9)
    assert exercise.resting_time(14.0) > 2.0


def played(saturation: float = 100.0, seconds: float = 5.0) -> Measurement:
    """Measure an arm's step response from the messages of its joint (200 Hz) and its controller (100 Hz)."""
    run = Measurement(["arm"], 0.05, None, {"arm": ArmSpec(name="arm", joint="j", saturation=saturation)})
    for tick in range(round(seconds * 200)):
        time = tick / 200
        header = Header(stamp=Time.of(tick * 5_000_000))
        angle = math.radians(lagging(time))
        run.add_messages(
            MessageKind.JOINTS, "arm", [JointState(header=header, name=("j",), position=(angle,), velocity=(0.0,))]
        )
        if tick % 2 == 0:
            command = 100.0 if 1.0 <= time < 1.5 else 10.0
            state = JointControllerState(header=header, set_point=30.0 if time >= 1.0 else 0.0, command=command)
            run.add_messages(MessageKind.CONTROL, "arm", [state])
    run.advance(round(seconds * 1e9))
    return run


def measured(run: Measurement) -> tuple[Measurements, ArmFigures]:
    found = run.measurements("goals")
    figures = found.robots["arm"]
    assert isinstance(figures, ArmFigures)
    return found, figures


def test_the_figures_of_an_arm() -> None:
    run = played()
    _, arm = measured(run)
    assert arm.step_rise_s == arm.steps[0].rise_s == pytest.approx(LAG * math.log(9.0), abs=0.002)
    assert arm.saturated_s == pytest.approx(0.5)
    assert arm.saturated_share == pytest.approx(0.5 / 4.99, rel=1e-3)
    assert arm.effort_max_nm == 100.0
    assert arm.control_gap_s == pytest.approx(0.01)
    assert arm.tracking_rms_deg is None
    assert arm.samples == 1000
    assert run.finished
    assert arm.time_s == pytest.approx(2.0), "a second after the last change"
    assert measured(played(saturation=200.0))[1].saturated_s == 0.0


def test_lost_messages_of_a_controller_count_for_its_own_arm_and_once() -> None:
    states = {"arm": "/robot_control/state", "left": "/left/control/state", "right": "/b/state", "free": ""}
    arms = {name: ArmSpec(name=name, joint="j", state=state) for name, state in states.items()}
    run = Measurement(tuple(arms), 0.05, arms=arms, namespaces={"right": "/"})
    topics = {"/robot_control/error": 1, "/left/joint_states": 2, "/left/control/state": 4, "/b/state": 8, "/odd": 16}
    inputs = tuple(InputHealth(topic=topic, lost=lost) for topic, lost in topics.items())
    run.add_heartbeats([Health(node="/logger", pid=7, inputs=(*inputs, InputHealth(topic="/free/joints", lost=32)))])
    robots = run.measurements("goals").robots
    assert {name: robots[name].messages_lost for name in arms} == {"arm": 1, "left": 6, "right": 24, "free": 32}


def test_an_arm_that_nobody_controls_has_no_figures_and_does_not_finish() -> None:
    run = Measurement(["arm"], 0.05, None, {"arm": ArmSpec(name="arm", joint="j")})
    for tick in range(200):
        header = Header(stamp=Time.of(tick * 5_000_000))
        other = JointState(header=header, name=("other",), position=(1.0,))
        run.add_messages(MessageKind.JOINTS, "arm", [other, JointState(header=header, name=("j",), position=(0.0,))])
    run.advance(1_000_000_000)
    _, arm = measured(run)
    assert (arm.samples, arm.step_rise_s, arm.control_gap_s, arm.effort_max_nm) == (200, None, None, None)
    assert not run.finished


def test_the_hash_tells_one_motion_from_another() -> None:
    assert measured(played())[0].trajectory_hash == measured(played())[0].trajectory_hash
    assert measured(played())[0].trajectory_hash != measured(played(seconds=4.9))[0].trajectory_hash


@pytest.mark.slow
def test_the_report_of_an_arm_fits_the_schema_and_is_drawn(tmp_path: Path) -> None:
    run = played()
    write_results(tmp_path, run.measurements("goals", LockstepState()), run.robots)
    report = write_report(tmp_path, FACTS, {"step_rise_s": Bound(min=0.2, max=0.25)})
    jsonschema.Draft202012Validator(report_schema()).validate(json.loads(to_json(report)))
    assert report.ok
    names = [each.name for each in report.checks]
    assert names.count("arm.step_rise_s") == 2
    assert "arm.cross_track_max_m" not in names, "an arm has no such figure, so no bound on it"
    assert (tmp_path / "report.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_bound_that_an_arm_misses_and_one_on_what_was_not_measured() -> None:
    report = build_report(
        played().measurements("goals", LockstepState()), FACTS, {"step_overshoot_percent": 1.0, "tracking_rms_deg": 0.2}
    )
    assert not report.ok
    assert [each.name for each in report.checks if not each.ok] == ["arm.tracking_rms_deg"]


def test_the_table_tells_of_it_in_words() -> None:
    out = io.StringIO()
    print_report(build_report(played().measurements("goals", LockstepState()), FACTS, {}), out)
    text = out.getvalue()
    assert "arm: step from 0.0 to 30.0 deg at 1.00 s: rise 0.220 s" in text
    assert "at 29.000 deg, error 1.000 deg" in text
    assert "saturated for 0.50 s (10.0 %)" in text
    assert "points" not in text, "no table for robots that drive where none does"
