"""The arm alone in an empty world with the tutorial's control laws, without a network."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal

from messages.joints import JointEffort
from models import urdf_path
from models.urdf import read_joint_limits
from models.world import WorldDescription
from services.runtime.log import Log
from services.sim.engines import Engine, default_engine, open_world
from services.sim.joints.effort_controller import EffortRule, JointEffortController
from services.sim.physics.world import Body, JointFriction, World
from services.sim.transit_delay import TransitDelayEstimator
from tests.services.sim.physics.driven_robot import STEP_NS

JOINT = "bear_link"
JOB_S = 0.1
"""Duration [s] of each effort request in the tutorial."""
SATURATION = 200.0
"""The tutorial's effort limit [N m]."""


@dataclass
class TutorialPid:
    """The tutorial's law: errors in degrees, gains per degree, the derivative of the error, everything clipped."""

    kp: float
    ki: float
    kd: float
    integral: float = 0.0
    before: float | None = None

    def step(self, error: float, dt: float) -> float:
        """Return the effort [N m] for an error [deg]."""
        self.integral = max(-20.0, min(20.0, self.integral + error * dt))
        rate = 0.0 if self.before is None else (error - self.before) / dt
        self.before = error
        effort = self.kp * error + self.ki * self.integral + self.kd * rate
        return max(-SATURATION, min(SATURATION, effort))


def set_point_pid() -> TutorialPid:
    """Return the tutorial's PD for set points."""
    return TutorialPid(37.5, 0.0, 2.8)


def tracking_pid() -> TutorialPid:
    """Return the tutorial's PID for tracking."""
    return TutorialPid(38.5, 0.3, 1.3)


@dataclass
class ArmSimulation:
    """An arm, at rest at first; ``angles`` [deg] and ``efforts`` [N m] are recorded after each step."""

    world: World
    actuators: JointEffortController
    step_ns: int = STEP_NS
    step: int = 0
    angles: list[float] = field(default_factory=list)
    efforts: list[float] = field(default_factory=list)

    @property
    def angle(self) -> float:
        """The joint's angle [deg]."""
        return math.degrees(self.world.body("arm").joint_readings().position[0])

    @property
    def rate(self) -> float:
        """The joint's velocity [rad/s]."""
        return self.world.body("arm").joint_readings().velocity[0]

    def apply_effort(self, effort: float, duration: float = JOB_S) -> None:
        """Add an effort job that starts now."""
        self.actuators.add_job(
            JointEffort(joint_name=JOINT, effort=effort, duration=duration), self.step * self.step_ns
        )

    def run(self, seconds: float) -> None:
        """Advance the simulation by ``seconds``."""
        for _ in range(round(seconds * 1e9 / self.step_ns)):
            self.actuators.step(self.step * self.step_ns)
            self.world.step()
            self.step += 1
            self.angles.append(self.angle)
            self.efforts.append(self.actuators.applied_efforts[JOINT])

    def control(self, law: TutorialPid, reference: Callable[[float], float], rate: int, seconds: float) -> list[float]:
        """Control at ``rate`` [Hz] towards ``reference`` [deg], a function of time [s]; return the errors [deg]."""
        errors = []
        for _ in range(round(seconds * rate)):
            errors.append(reference(self.step * self.step_ns / 1e9) - self.angle)
            self.apply_effort(law.step(errors[-1], 1 / rate))
            self.run(1 / rate)
        return errors


@contextmanager
def arm_simulation(
    model: Literal["arm", "arm_corrected"] = "arm",
    rule: EffortRule | None = None,
    damping: float = 0.0,
    friction: float = 0.0,
    start: float = 0.0,
    step_ns: int = STEP_NS,
    engine: Engine | None = None,
) -> Iterator[ArmSimulation]:
    """Yield an arm at rest with its joint at ``start`` [deg]."""
    with open_world(engine or default_engine(), WorldDescription(), step_ns) as world:
        at = ((JOINT, math.radians(start)),)
        resists = ((JOINT, JointFriction(damping, friction)),)
        body = world.spawn(Body("arm", urdf_path(model), fixed=True, initial_positions=at, joint_friction=resists))
        log = Log("/sim", out=io.StringIO())
        yield ArmSimulation(
            world,
            JointEffortController(
                body, "arm", read_joint_limits(model), rule or EffortRule(), TransitDelayEstimator(), log
            ),
            step_ns,
        )
