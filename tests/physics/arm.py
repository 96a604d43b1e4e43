"""The arm alone in an empty world, and the seed's laws on it, without a network."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

from messages.joints import JointEffort
from models import model_path
from models.limits import read_limits
from models.scene import Scene
from services.runtime.log import Log
from services.sim.ages import Ages
from services.sim.joints.actuators import Actuators
from services.sim.joints.effort import Rule
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Body, Resistance
from tests.physics.rig import STEP_NS

JOINT = "bear_link"
JOB_S = 0.1
"""What the seed asks for, again and again."""
SATURATION = 200.0
"""N m, the seed's."""


@dataclass
class Pid:
    """The seed's law: errors in degrees, gains per degree, the derivative of the error, everything clipped."""

    kp: float
    ki: float
    kd: float
    integral: float = 0.0
    before: float | None = None

    def step(self, error: float, dt: float) -> float:
        """The effort [N m] for an error [deg]."""
        self.integral = max(-20.0, min(20.0, self.integral + error * dt))
        rate = 0.0 if self.before is None else (error - self.before) / dt
        self.before = error
        effort = self.kp * error + self.ki * self.integral + self.kd * rate
        return max(-SATURATION, min(SATURATION, effort))


def set_point() -> Pid:
    """The seed's PD for set-points."""
    return Pid(37.5, 0.0, 2.8)


def tracking() -> Pid:
    """The seed's PID for tracking."""
    return Pid(38.5, 0.3, 1.3)


@dataclass
class Stand:
    """An arm that begins at rest at 0; ``angles`` [deg] and ``efforts`` [N m] are those after each step."""

    world: BulletWorld
    actuators: Actuators
    step_ns: int = STEP_NS
    step: int = 0
    angles: list[float] = field(default_factory=list)
    efforts: list[float] = field(default_factory=list)

    @property
    def angle(self) -> float:
        """Of the joint, deg."""
        return math.degrees(self.world.joint_readings("arm").position[0])

    @property
    def rate(self) -> float:
        """Of the joint, rad/s."""
        return self.world.joint_readings("arm").velocity[0]

    def put(self, effort: float, duration: float = JOB_S) -> None:
        """A job that begins now."""
        self.actuators.apply(JointEffort(joint_name=JOINT, effort=effort, duration=duration), self.step * self.step_ns)

    def run(self, seconds: float) -> None:
        """Let time go on."""
        for _ in range(round(seconds * 1e9 / self.step_ns)):
            self.actuators.step(self.step * self.step_ns)
            self.world.step()
            self.step += 1
            self.angles.append(self.angle)
            self.efforts.append(self.actuators.applied[JOINT])

    def control(self, law: Pid, reference: Callable[[float], float], rate: int, seconds: float) -> list[float]:
        """Control at ``rate`` [Hz] toward ``reference`` [deg] of the time [s]; returns the errors [deg] that it saw."""
        errors = []
        for _ in range(round(seconds * rate)):
            errors.append(reference(self.step * self.step_ns / 1e9) - self.angle)
            self.put(law.step(errors[-1], 1 / rate))
            self.run(1 / rate)
        return errors


@contextmanager
def stand(
    model: Literal["arm", "arm_corrected"] = "arm",
    rule: Rule | None = None,
    damping: float = 0.0,
    friction: float = 0.0,
    start: float = 0.0,
    step_ns: int = STEP_NS,
) -> Iterator[Stand]:
    """An arm whose joint stands at ``start`` [deg]."""
    with BulletWorld(Scene(), step_ns) as world:
        at = ((JOINT, math.radians(start)),)
        resists = ((JOINT, Resistance(damping, friction)),)
        world.spawn(Body("arm", model_path(model), fixed=True, start=at, resistance=resists))
        log = Log("/sim", out=io.StringIO())
        yield Stand(world, Actuators(world, "arm", read_limits(model), rule or Rule(), Ages(), log), step_ns)
