"""The odometry of one robot over time: from the world, its wheels or its commands, and when it is published."""

from __future__ import annotations

import math

from messages.base import Packed36
from messages.nav import Odometry
from messages.std import Header
from services.runtime.errors import BadInput
from services.sim.base.base import STEP_S, Base
from services.sim.base.settings import OdometrySettings
from services.sim.diffdrive.odometry import Pose2, Track, coast, roll, start
from services.sim.physics.world import BodyState, World
from services.sim.sensors.odometry import EXACT, PLANAR, encoder_odometry, world_odometry

ROUNDING = 1e-6
"""Of a period; what is nearer to its end is its end."""


class Odometer:
    """Keeps the ``track`` of a base that counts; None where odometry is the true pose in the world.

    ``moved`` is where the odometry's frame lies now, seen from where it was at the start.
    """

    def __init__(self, settings: OdometrySettings, world: World, name: str, base: Base | None) -> None:
        self.retune(settings)
        self._world, self._name, self._base = world, name, base
        if base is not None:
            joints = world.joints(name)
            self._left, self._right = (
                joints.index(joint) for joint in (base.settings.left_joint, base.settings.right_joint)
            )
        self._slot: int | None = None
        self.restart()

    def restart(self) -> None:
        """Count from here, with the wheels as they stand."""
        counts = self._base is not None and self.settings.source != "world"
        self.track: Track | None = start(*self._angles()) if counts else None
        self.moved = Pose2()
        self._told = -1
        self.retime()

    def step(self) -> None:
        """Follow a physics step that comes, where commands are what counts."""
        if self.track is not None and self._base is not None and self.settings.source == "open loop":
            self.track = coast(self.track, *self._base.motion, STEP_S)

    def count(self, now: int) -> None:
        """Follow the wheels until ``now`` [ns]."""
        if self.track is None or self._base is None or self.settings.source != "encoder":
            return
        if 0 <= self._told < now:
            geometry = self._base.drive.geometry
            self.track = roll(self.track, *self._angles(), (now - self._told) / 1e9, geometry, self.settings.window)
        self._told = now

    def due(self, now: int, rate: float) -> bool:
        """Whether a message goes out at ``now`` [ns] when ``rate`` [Hz] go out; asked at every control tick.

        The average rate is exact, as in ROS, and counts from time 0: at 25 Hz odometry has the stamps of ground truth,
        whenever the robot was spawned.
        """
        if rate <= 0:
            return False
        periods = now * rate / 1e9
        if self._slot is None:
            self._slot = math.ceil(periods - ROUNDING) - 1
        before, self._slot = self._slot, int(periods + ROUNDING)
        return self._slot > before

    def message(self, header: Header, child: str, state: BodyState) -> Odometry:
        """Odometry as it is published; ``state`` is where the body is."""
        covariances = self.pose_covariance, self.twist_covariance
        if self.track is None:
            return world_odometry(state, header, child, *covariances)
        return encoder_odometry(self.track, header, child, *covariances)

    def set(self, x: float, y: float, heading: float) -> None:
        """Count from (x [m], y [m], heading [rad]) on; raises BadInput where odometry is the true pose."""
        if self.track is None:
            raise BadInput(
                f"the odometry of {self._name} is its true pose in the world, which cannot be set: move the model with "
                'set_state, or give it odometry = "encoder"'
            )
        pose = Pose2(x, y, heading)
        self.moved = self.moved.then(self.track.pose).then(pose.inverse())
        self.track = self.track._replace(x=x, y=y, heading=heading)

    def retune(self, settings: OdometrySettings) -> None:
        """Tell it with other covariances, over another window; the source stays what it was."""
        self.settings = settings
        self.pose_covariance: Packed36 = PLANAR if settings.pose is None else settings.pose
        self.twist_covariance: Packed36 = EXACT if settings.twist is None else settings.twist

    def retime(self) -> None:
        """Find the rate's phase anew, as after a change of the rate."""
        self._slot = None

    def _angles(self) -> tuple[float, float]:
        angles = self._world.joint_readings(self._name).position
        return angles[self._left], angles[self._right]
