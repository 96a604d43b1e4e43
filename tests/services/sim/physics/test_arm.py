"""The arm in both engines: gravity, inertia and period compared with theory, its stops, and joint friction."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import pytest

from models import ARMS
from services.sim.engines import Engine
from tests.services.sim.physics.arm_simulation import JOINT, ArmSimulation, arm_simulation
from tests.services.sim.physics.driven_robot import DT

GRAVITY = 9.81


class Theory:
    """A pendulum of link (2 kg) and head (1 g): inertia [kg m2] about the hinge, torque of gravity [N m]."""

    def __init__(self, model: str) -> None:
        centre, own = ((0.03534, -1.38324), 0.03565) if model == "arm" else ((0.0011, -0.3720), 9.267e-2)
        head = (0.00225 + 0.00323, -0.74383 - 0.04129)
        self.inertia = own + 2.0 * math.hypot(*centre) ** 2 + 2e-5 + 0.001 * math.hypot(*head) ** 2
        x, y = (2.0 * a + 0.001 * b for a, b in zip(centre, head, strict=True))
        self.amplitude, self.offset = GRAVITY * math.hypot(x, y), math.atan2(x, -y)

    def period(self, swing: float) -> float:
        """Return the period [s] of an amplitude ``swing`` [rad]: T = T0 / agm(1, cos(swing / 2))."""
        one, other = 1.0, math.cos(swing / 2)
        for _ in range(10):
            one, other = (one + other) / 2, math.sqrt(one * other)
        return math.tau * math.sqrt(self.inertia / self.amplitude) / one


def acceleration(on: ArmSimulation, degrees: float, effort: float) -> float:
    """Return the joint's acceleration [rad/s2] from rest at an angle, under an effort [N m]."""
    on.world.set_joints("arm", {JOINT: math.radians(degrees)})
    on.world.body("arm").set_efforts({JOINT: effort})
    on.world.step()
    return on.rate / DT


def test_the_figures_of_the_tutorial_follow_from_its_urdf() -> None:
    theory = Theory("arm")
    assert theory.amplitude == pytest.approx(27.148, abs=0.01)
    assert math.degrees(theory.offset) == pytest.approx(1.4635, abs=0.001)
    assert theory.inertia == pytest.approx(3.865, abs=0.001)
    assert theory.period(1e-6) == pytest.approx(2.371, abs=0.001)
    assert theory.period(math.radians(30)) == pytest.approx(2.412, abs=0.001)


@pytest.mark.parametrize("model", ARMS)
def test_gravity_and_inertia(model: Literal["arm", "arm_corrected"], engine: Engine) -> None:
    theory = Theory(model)
    with arm_simulation(model, engine=engine) as on:
        inertia = 10.0 / (acceleration(on, 20.0, 10.0) - acceleration(on, 20.0, 0.0))
        assert inertia == pytest.approx(theory.inertia, rel=1e-3)
        for degrees in (0.0, 30.0, -30.0, 85.0):
            falls = -inertia * acceleration(on, degrees, 0.0)
            assert falls == pytest.approx(
                theory.amplitude * math.sin(math.radians(degrees) + theory.offset), rel=1e-3, abs=1e-3
            )


@pytest.mark.parametrize("model", ARMS)
@pytest.mark.parametrize("degrees", [1.0, 30.0])
def test_it_swings_for_ever_at_the_period_of_theory(
    model: Literal["arm", "arm_corrected"], degrees: float, engine: Engine
) -> None:
    theory = Theory(model)
    rest = -math.degrees(theory.offset)
    with arm_simulation(model, start=rest + degrees, engine=engine) as on:
        on.run(20.0)
    swings = [angle - rest for angle in on.angles]
    rising = [i + a / (a - b) for i, (a, b) in enumerate(pairwise(swings)) if a < 0 <= b]
    period = (rising[-1] - rising[0]) / (len(rising) - 1) * DT
    assert period == pytest.approx(theory.period(math.radians(degrees)), rel=5e-4)
    assert max(swings[-1000:]) == pytest.approx(degrees, rel=2e-3), "nothing brakes it"


def test_damping_takes_the_energy_at_its_rate(engine: Engine) -> None:
    """Small swings about rest shrink by exp(-d t / 2 I)."""
    theory = Theory("arm")
    rest = -math.degrees(theory.offset)
    with arm_simulation(damping=1.0, start=rest + 5.0, engine=engine) as on:
        on.run(20.0)
    left = max(angle - rest for angle in on.angles[-500:])
    middle = 20.0 - 250 * DT
    assert left == pytest.approx(5.0 * math.exp(-middle / 2 / theory.inertia), rel=0.05)


def test_dry_friction_holds_what_is_below_it(engine: Engine) -> None:
    with arm_simulation(friction=20.0, start=30.0, engine=engine) as on:
        on.run(2.0)
        assert on.angle == pytest.approx(30.0, abs=0.01), "gravity asks for 14 N m"
        on.apply_effort(-10.0, 1.0)
        on.run(1.0)
        assert on.angle < 20.0


@pytest.mark.parametrize("effort", [100.0, 200.0, 1000.0])
@pytest.mark.parametrize("model", ARMS)
def test_the_stops_hold(model: Literal["arm", "arm_corrected"], effort: float, engine: Engine) -> None:
    """A joint that overshoots a stop within one step returns to it under the same effort."""
    with arm_simulation(model, engine=engine) as on:
        on.apply_effort(effort, 5.0)
        on.run(5.0)
        assert on.angles[-1] == pytest.approx(90.0, abs=0.01)
        assert max(on.angles) < 90.0 + math.degrees(max(1.0, on.rate) * DT) + 20.0
        on.apply_effort(-effort, 5.0)
        on.run(5.0)
        assert on.angles[-1] == pytest.approx(-90.0, abs=0.01)
