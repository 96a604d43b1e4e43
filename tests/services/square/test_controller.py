"""Parameter changes during a square: the speed changes at once, the square stays the same."""

from __future__ import annotations

import math

import pytest

from messages.se2 import ZERO_TWIST, Pose2
from services.square import SquareParameters
from services.square.controller import SquareController
from tests.services.square.ideal_base import CONTROL_S, IdealBase

START = Pose2(0.7, -0.4, 2.9)


@pytest.mark.parametrize("law", ["profile", "tutorial"])
def test_another_speed_on_the_way_is_kept_to_and_the_square_is_the_same(law: str) -> None:
    base, pilot, command = IdealBase(START), SquareController(SquareParameters(law=law)), ZERO_TWIST
    speeds: dict[float, list[float]] = {0.2: [], 0.4: []}
    for tick in range(20_000):
        if tick == 150:
            pilot.reconfigure(SquareParameters(law=law, linear_speed=0.4))
        move = pilot.step(round(tick * CONTROL_S * 1e9), base.pose, base.velocity, CONTROL_S if tick else 0.0)
        if move.state == "finished":
            break
        command = move.command or command
        base.run(command)
        speeds[0.2 if tick < 150 else 0.4].append(base.velocity.v)
    else:
        raise AssertionError("never finished")
    for wanted, seen in speeds.items():
        assert max(seen) == pytest.approx(wanted, rel=0.1)
    closure = math.hypot(base.pose.x - START.x, base.pose.y - START.y)
    assert closure < (0.005 if law == "profile" else 0.35)
