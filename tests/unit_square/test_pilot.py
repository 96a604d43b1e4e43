"""A square under way takes other parameters: its speed changes at once, the square itself stays."""

from __future__ import annotations

import math

import pytest

from services.motion.planar import STILL, Planar
from services.square import SquareParameters
from services.square.pilot import Pilot
from tests.unit_square.ideal_base import CONTROL, IdealBase

START = Planar(0.7, -0.4, 2.9)


@pytest.mark.parametrize("law", ["profile", "seed"])
def test_another_speed_on_the_way_is_kept_to_and_the_square_is_the_same(law: str) -> None:
    base, pilot, command = IdealBase(START), Pilot(SquareParameters(law=law)), STILL
    speeds: dict[float, list[float]] = {0.2: [], 0.4: []}
    for tick in range(20_000):
        if tick == 150:
            pilot.retune(SquareParameters(law=law, linear_speed=0.4))
        move = pilot.step(round(tick * CONTROL * 1e9), base.here, base.moving, CONTROL if tick else 0.0)
        if move.state == "finished":
            break
        command = move.command or command
        base.run(command)
        speeds[0.2 if tick < 150 else 0.4].append(base.moving.v)
    else:
        raise AssertionError("never finished")
    for wanted, seen in speeds.items():
        assert max(seen) == pytest.approx(wanted, rel=0.1)
    closure = math.hypot(base.here.x - START.x, base.here.y - START.y)
    print(f"{law}: closed on {1000 * closure:.1f} mm")
    assert closure < (0.005 if law == "profile" else 0.35)
