"""The tutorial's law behaves as the tutorial's own loop, with the computed error."""

from __future__ import annotations

import math

import pytest

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from services.square import SquareParameters
from services.square.corners import Square
from services.square.tutorial import TutorialState, overrun, predict, step
from tests.services.square.ideal_base import ANGULAR, IdealBase, drive


def original(phase: float) -> tuple[list[float], Pose2]:
    """Run the tutorial's script on odometry at 10 Hz, offset by ``phase`` [s]; return the yaw [deg] after each turn,
    and the end pose.

    Written from the script, independently of the service, with its variables, order and thresholds.
    """
    x = y = yaw = start_x = start_y = target = 0.0
    state, sides, turned = "MOVE_FORWARD", 0, []
    base, command = IdealBase(), ZERO_TWIST
    for tick in range(5000):
        if tick % 5 == 0:
            x, y, yaw = base.pose.x, base.pose.y, base.pose.yaw
        if tick * 0.02 + 1e-9 >= phase and (tick - round(phase / 0.02)) % 5 == 0 and sides < 4:
            if state == "MOVE_FORWARD":
                if math.sqrt((x - start_x) ** 2 + (y - start_y) ** 2) < 1.0 - 0.05:
                    command = Twist2(0.2, 0.0)
                else:
                    command, state = Twist2(0.0, 0.0), "ROTATE"
                    start_x, start_y = x, y
                    target = math.remainder(yaw + math.pi / 2, math.tau)
            else:
                error = math.remainder(target - yaw, math.tau)
                if abs(error) > 0.05:
                    command = Twist2(0.0, 0.5 if error > 0 else -0.5)
                else:
                    command, state, sides = Twist2(0.0, 0.0), "MOVE_FORWARD", sides + 1
                    start_x, start_y = x, y
                    turned.append(math.degrees(base.pose.yaw))
        base.run(command)
        if sides == 4 and base.velocity == ZERO_TWIST:
            return turned, base.pose
    raise AssertionError("it does not end")


@pytest.mark.parametrize("phase", [0.0, 0.02, 0.04, 0.06, 0.08])
def test_it_does_what_the_original_does(phase: float) -> None:
    turned, end = original(phase)
    run = list(drive(SquareParameters(law="tutorial", phase=phase), IdealBase()))
    reached = [each for each in run if each.move.state == "reached"]
    assert [math.degrees(each.pose.yaw) for each in reached] == pytest.approx(turned, abs=1e-9)
    last = run[-1].pose
    assert (last.x, last.y, last.yaw) == pytest.approx((end.x, end.y, end.yaw), abs=1e-9)


def test_it_misses_by_what_was_computed_for_it() -> None:
    """As computed for the tutorial: turns count as done at 90.3, 184.8, 279.4, 373.9 degrees; the end is 17 off."""
    run = list(drive(SquareParameters(law="tutorial"), IdealBase()))
    turned = [math.degrees(each.pose.yaw) for each in run if each.move.state == "reached"]
    assert turned == pytest.approx([90.3, 184.8, 279.4, 373.9], abs=2.0)
    assert math.hypot(run[-1].pose.x, run[-1].pose.y) == pytest.approx(0.223, abs=0.002)
    assert math.degrees(run[-1].pose.yaw) - 360 == pytest.approx(18.15, abs=0.05)
    at_rest = [abs(each.velocity.w) for each in run if each.move.state == "reached"]
    assert min(at_rest) > 0.4, "it declares turns done while it still rotates"


def test_the_mean_over_all_phases_is_seventeen_degrees() -> None:
    ends = [
        predict(SquareParameters(law="tutorial", phase=phase), IdealBase().ramp)
        for phase in (0, 0.02, 0.04, 0.06, 0.08)
    ]
    degrees = [math.degrees(each.excess_turn) for each in ends if each is not None]
    assert sorted(degrees)[0] == pytest.approx(6.7, abs=0.1)
    assert sorted(degrees)[-1] == pytest.approx(18.2, abs=0.1)
    assert 14 < sum(degrees) / len(degrees) < 18.2


def test_what_is_expected_is_what_is_driven() -> None:
    run = list(drive(SquareParameters(law="tutorial", count=2, side=0.6), IdealBase()))
    ends = predict(SquareParameters(law="tutorial", count=2, side=0.6), IdealBase().ramp)
    assert ends is not None
    assert ends.closure == pytest.approx(math.hypot(run[-1].pose.x, run[-1].pose.y), abs=1e-6)
    assert ends.excess_turn == pytest.approx(run[-1].pose.yaw - 2 * math.tau, abs=1e-6)


def test_a_base_turns_on_by_its_braking_angle() -> None:
    assert overrun(IdealBase().ramp, 0.5) == pytest.approx(0.5**2 / (2 * ANGULAR), abs=0.003)


def test_between_its_periods_it_sends_nothing_and_looks_once() -> None:
    p = SquareParameters(law="tutorial", phase=0.04)
    loop = TutorialState.at_start(Square(Pose2(0.0, 0.0), 1.0))
    commands = []
    for tick in range(50):
        loop, move = step(loop, tick * 20_000_000, Pose2(0.001 * tick, 0.0), ZERO_TWIST, p)
        if move.command is not None:
            commands.append((tick, loop.last_odometry.x))
    assert [tick for tick, _ in commands] == list(range(2, 50, 5))
    assert [seen for _, seen in commands] == pytest.approx([0.005 * turn for turn in range(10)])
