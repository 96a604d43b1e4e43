"""The effort that holds an arm against gravity, computed from its URDF, holds it in the physics engine."""

from __future__ import annotations

import math
from typing import Literal

import pytest

from models import ARMS
from models.dynamics import read_pendulum
from tests.services.sim.physics.arm_simulation import JOINT, arm_simulation
from tests.services.sim.physics.driven_robot import DT


def test_the_figures_of_the_tutorial() -> None:
    weight = read_pendulum("arm", JOINT)
    assert weight.torque == pytest.approx(27.15, abs=0.01)
    assert math.degrees(weight.rest) == pytest.approx(-1.4635, abs=0.001)
    assert weight.inertia == pytest.approx(3.8655, abs=0.0001)


@pytest.mark.slow
@pytest.mark.parametrize("model", ARMS)
@pytest.mark.parametrize("degrees", [-60.0, 0.0, 30.0, 85.0])
def test_the_holding_torque_holds(model: Literal["arm", "arm_corrected"], degrees: float) -> None:
    weight = read_pendulum(model, JOINT)
    with arm_simulation(model, start=degrees) as on:
        effort = weight.torque * math.sin(math.radians(degrees) - weight.rest)
        on.world.body("arm").set_efforts({JOINT: effort})
        on.world.step()
        assert abs(on.rate / DT) < 2e-3, "rad/s2; gravity alone makes up to 7"


@pytest.mark.parametrize("model", ARMS)
def test_the_inertia_is_what_the_engine_turns(model: Literal["arm", "arm_corrected"]) -> None:
    weight = read_pendulum(model, JOINT)
    with arm_simulation(model) as on:
        on.world.body("arm").set_efforts({JOINT: 10.0 + weight.torque * math.sin(-weight.rest)})
        on.world.step()
        assert 10.0 / (on.rate / DT) == pytest.approx(weight.inertia, rel=1e-4)


def test_a_joint_that_there_is_not() -> None:
    with pytest.raises(KeyError, match="elbow"):
        read_pendulum("arm", "elbow")
