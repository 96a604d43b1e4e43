"""The controller manager on the in-memory transport, commanding a two-link arm in real physics."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from messages.joints import JointCommand
from messages.sensor import JointState
from messages.std import Duration, Header, String, Time
from messages.topics import JOINT_COMMAND, JOINT_FEEDBACK, ROBOT_DESCRIPTION
from messages.trajectory import JointTrajectory, JointTrajectoryPoint
from services.controller_manager import SERVICE
from services.runtime.testing import ServiceHarness, run_service
from tests.harness.joint_rig import URDF, JointRig, joint_rig

CONTROLLERS = """\
arm_controller:
  type: position_controllers/JointTrajectoryController
  joints: [waist, shoulder, elbow]
  allow_partial_joints_goal: true
  constraints:
    goal_time: 0.5
    stopped_velocity_tolerance: 0.05
    shoulder: {trajectory: 0.1, goal: 0.01}
gripper_controller:
  type: effort_controllers/JointPositionController
  joint: gripper
  pid: {p: 100, i: 100, d: 2, i_clamp: 5}
group_controller:
  type: position_controllers/JointGroupPositionController
  joints: [shoulder, elbow]
effort_controller:
  type: effort_controllers/JointTrajectoryController
  joints: [shoulder, elbow]
  gains:
    shoulder: {p: 400, i: 200, d: 20, i_clamp: 20}
    elbow: {p: 40, i: 40, d: 1, i_clamp: 10}
  constraints: {goal_time: 1.0, shoulder: {goal: 0.02}, elbow: {goal: 0.02}}
waist_controller:
  type: velocity_controllers/JointVelocityController
  joint: waist
"""


class ArmStand:
    """The manager and the arm; a control tick is two physics steps. ``feedback``: publish joint states."""

    def __init__(self, service: ServiceHarness, rig: JointRig, urdf: str) -> None:
        self.service, self.rig, self.feedback = service, rig, True
        self.command = JointCommand()
        service.publish(ROBOT_DESCRIPTION, String(data=urdf))

    @property
    def now(self) -> float:
        """Simulation time [s]."""
        return self.rig.now / 1e9

    def tick(self) -> None:
        """Run one tick of the service, and the physics up to the next."""
        if self.feedback:
            header, readings = Header(stamp=Time.of(self.rig.now)), self.rig.body.joint_readings()
            state = JointState(
                header=header,
                name=self.rig.body.joints,
                position=readings.position,
                velocity=readings.velocity,
                effort=readings.effort,
            )
            self.service.publish(JOINT_FEEDBACK, state)
        self.service.set_time(self.now)
        self.command = self.service.next(JOINT_COMMAND)
        self.rig.send(self.command)
        self.rig.step(0.01)

    def run(self, seconds: float) -> None:
        """Run ticks for ``seconds``."""
        for _ in range(round(seconds * 100)):
            self.tick()


@contextmanager
def arm_stand(folder: Path, text: str = CONTROLLERS, urdf: str = "", **params: Any) -> Iterator[ArmStand]:
    """Run ``/arm/controller_manager`` with the controllers of a file, and the arm at rest at 0."""
    file = folder / "controllers.yaml"
    file.write_text(text)
    with joint_rig() as rig, run_service(SERVICE, "/arm", {"config": str(file), **params}) as service:
        yield ArmStand(service, rig, urdf or URDF.read_text())


def trajectory(*points: tuple[float, dict[str, float]], stamp: float = 0.0) -> JointTrajectory:
    """Return a trajectory through positions at times [s]; all points have the joints of the first."""
    joints = tuple(points[0][1])
    return JointTrajectory(
        header=Header(stamp=Time.of(round(stamp * 1e9))),
        joint_names=joints,
        points=tuple(
            JointTrajectoryPoint(
                positions=tuple(each[joint] for joint in joints), time_from_start=Duration.of(round(time * 1e9))
            )
            for time, each in points
        ),
    )
