"""The default law: filter, anti-windup and bumpless changes, compared with the tutorial's law."""

from __future__ import annotations

import math

import pytest

from services.arm import ArmParameters
from services.arm.pid import BLEND_S, ArmController, ControlInput, Gains, Pid, TutorialPid, select_gains
from tests.services.arm.pendulum import DT, Pendulum

DT_CONTROL = 0.01


def gains(kp: float = 10.0, ki: float = 0.0, kd: float = 0.0, **more: float) -> Gains:
    rest = {
        "set_point_weight": 0.0,
        "saturation": 200.0,
        "derivative_filter": 0.0,
        "gravity_torque": 0.0,
        "gravity_rest": 0.0,
        "inertia": 0.0,
    }
    return Gains(kp, ki, kd, **{**rest, **more})


def at(wanted: float, angle: float = 0.0, wanted_rate: float = 0.0, rate: float = 0.0) -> ControlInput:
    return ControlInput(wanted, wanted_rate, angle, rate)


def test_the_gains_are_those_of_the_controller_that_is_chosen() -> None:
    assert select_gains(ArmParameters())[:4] == (37.5, 0.0, 2.8, 0.0)
    assert select_gains(ArmParameters(controller_type="tr"))[:4] == (38.5, 0.3, 1.3, 1.0)
    assert select_gains(ArmParameters()).gravity_compensation(30.0) == 0.0
    assert select_gains(ArmParameters(gravity=True)).gravity_compensation(30.0) == pytest.approx(14.17, abs=0.01)


def test_a_jump_of_the_reference_is_no_kick() -> None:
    """In the tutorial's law, 3 degrees within 10 ms make 840 N m through kd alone, beyond the saturation."""
    quiet = Pid()
    quiet.step(gains(kd=2.8), at(0.0), DT_CONTROL)
    assert quiet.step(gains(kd=2.8), at(3.0), DT_CONTROL) == pytest.approx(30.0)
    kicked = TutorialPid()
    kicked.step(gains(kd=2.8), 20.0, 0.0, 0.0, DT_CONTROL)
    assert kicked.step(gains(kd=2.8), 20.0, 3.0, 0.0, DT_CONTROL) == 200.0


def test_the_rate_is_filtered() -> None:
    law = Pid()
    law.step(gains(kp=0.0, kd=1.0, derivative_filter=0.02), at(0.0, rate=0.0), DT_CONTROL)
    shares = [
        -law.step(gains(kp=0.0, kd=1.0, derivative_filter=0.02), at(0.0, rate=10.0), DT_CONTROL) / 10.0
        for _ in range(4)
    ]
    assert shares == pytest.approx([1 - math.exp(-0.5 * step) for step in range(1, 5)])


def test_tracking_feeds_forward_what_the_motion_takes() -> None:
    """3.8655 kg m2 at 100 deg/s2, plus the weight; a set point has no acceleration to follow."""
    tracking, resting = ArmParameters(controller_type="tr", gravity=True), ArmParameters(gravity=True)
    for p, more in ((tracking, 3.8655 * math.radians(100.0)), (resting, 0.0)):
        fed = select_gains(p)
        still = Pid().step(fed, at(30.0, 30.0), DT_CONTROL)
        moving = Pid().step(fed, ControlInput(30.0, 0.0, 30.0, 0.0, 100.0), DT_CONTROL)
        assert moving - still == pytest.approx(more), p.controller_type
    assert select_gains(ArmParameters(controller_type="tr")).inertia_feedforward(100.0) == 0.0, (
        "with the weight or not at all"
    )


def test_over_a_gap_in_time_no_old_rate_counts() -> None:
    law, damped = Pid(), gains(kp=0.0, kd=1.0, derivative_filter=0.02)
    law.step(damped, at(0.0, rate=100.0), DT_CONTROL)
    assert law.step(damped, at(0.0, rate=0.0), 0.0) == 0.0


def test_the_integral_is_summed_over_time_and_rests_without_it() -> None:
    law = Pid()
    for _ in range(100):
        law.step(gains(ki=2.0), at(1.0), DT_CONTROL)
    assert law.integral == pytest.approx(2.0)
    law.step(gains(ki=2.0), at(1.0), 0.0)
    assert law.integral == pytest.approx(2.0)


def test_a_joint_that_is_held_winds_nothing_up_beyond_the_saturation() -> None:
    """The tutorial's integral without its guard would be 3000 N m after a minute."""
    law, stuck = Pid(), gains(kp=1.0, ki=10.0, kd=0.1)
    for _ in range(6000):
        assert law.step(stuck, at(5.0), DT_CONTROL) <= 200.0
    assert law.integral <= 200.0
    assert law.step(stuck, at(-5.0), DT_CONTROL) < 195.0, "it leaves the saturation at once"


def test_a_saturation_that_the_error_alone_makes_costs_no_more_than_what_was_summed() -> None:
    law, strong = Pid(), gains(kp=40.0, ki=2.0, kd=1.0)
    for _ in range(100):
        law.step(strong, at(1.0), DT_CONTROL)
    summed = law.integral
    for _ in range(10):
        law.step(strong, at(30.0), DT_CONTROL)
    assert 0.0 <= law.integral <= summed + 2.0 * 30.0 * 10 * DT_CONTROL


@pytest.mark.parametrize(
    "after",
    [
        {"controller_type": "ss"},
        {"tr_Kp": 20.0},
        {"tr_Ki": 0.0},
        {"gravity": True},
        {"derivative_filter": 0.02},
    ],
)
def test_no_change_is_a_bump_and_each_is_let_in(after: dict[str, object]) -> None:
    before = ArmParameters(controller_type="tr", tr_Ki=5.0)
    changed = ArmParameters(**{"controller_type": "tr", "tr_Ki": 5.0, **after})  # type: ignore[arg-type]
    controller, sight = ArmController(), at(30.0, 29.5, 10.0, 9.0)
    efforts = [controller.step(before, sight, DT_CONTROL) for _ in range(50)]
    first = controller.step(changed, sight, DT_CONTROL)
    slope = abs(efforts[-1] - efforts[-2])
    assert abs(first - efforts[-1]) <= slope + 0.05 * 200 * DT_CONTROL + 0.5
    long = round(8 * BLEND_S / DT_CONTROL)
    own = ArmController()
    own.step(changed, sight, DT_CONTROL)
    settled = [controller.step(changed, sight, DT_CONTROL) for _ in range(long)][-1]
    if select_gains(changed).ki == 0:
        assert settled == pytest.approx(own.step(changed, sight, DT_CONTROL), abs=0.1)


def test_the_law_itself_is_changed_without_a_bump_into_the_default() -> None:
    tutorial, default = ArmParameters(law="tutorial"), ArmParameters(law="default", gravity=True)
    controller, sight = ArmController(), at(30.0, 29.0)
    last = [controller.step(tutorial, sight, DT_CONTROL) for _ in range(5)][-1]
    assert controller.step(default, sight, DT_CONTROL) == pytest.approx(last, abs=1e-6)


def test_the_tutorial_keeps_its_guard() -> None:
    """It bounds the error sum to 20 deg s: with ki = 0.3 that is 6 N m, which can't hold the arm."""
    law = TutorialPid()
    for _ in range(1000):
        effort = law.step(gains(kp=0.0, ki=0.3), 20.0, 30.0, 0.0, DT_CONTROL)
    assert law.error_sum == 20.0
    assert effort == pytest.approx(6.0)


def test_an_arm_that_swings_comes_to_rest_where_it_should() -> None:
    """It starts far off and moving, and reaches the saturation on the way."""
    arm, controller, p = Pendulum(angle=-1.4, rate=3.0), ArmController(), ArmParameters(gravity=True)
    for step in range(800):
        if step % 2 == 0:
            effort = controller.step(p, at(60.0, arm.degrees, 0.0, arm.degrees_per_second), 2 * DT)
        arm.step(effort)
    assert arm.degrees == pytest.approx(60.0, abs=0.01)
    assert abs(arm.degrees_per_second) < 0.01
