"""Odometry of one robot: integration of wheel angles or commands, and its messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.base import Packed36, covariance
from messages.geometry import (
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from messages.nav import Odometry
from messages.se2 import IDENTITY, Pose2
from messages.se3 import Pose3, rotate_inverse
from messages.std import Header
from services.runtime.errors import BadInput
from services.runtime.step import STEP_S
from services.sim.drive.config import OdometryConfig
from services.sim.drive.controller import DiffDriveController
from services.sim.drive.driver import Drive
from services.sim.drive.kinematics import WheelGeometry
from services.sim.drive.odometry_error import assumed_geometry, draw_errors, odometry_error
from services.sim.physics.world import BodyHandle, BodyState
from services.sim.snapshot import FEW, Snapshot

MIN_INTERVAL_S = 1e-4
"""Over a shorter interval the distance is updated, but no speed is computed."""

Velocity = tuple[float, float]
"""Speed [m/s] and turn rate [rad/s]."""


class OdometryState(NamedTuple):
    """Counted odometry: x, y [m], unbounded heading [rad]; the speeds v [m/s] and w [rad/s], the mean over ``recent``;
    and the wheel angles [rad] at the end of the last interval."""

    x: float
    y: float
    heading: float
    v: float
    w: float
    left: float
    right: float
    recent: tuple[Velocity, ...] = ()

    @property
    def pose(self) -> Pose2:
        """The counted pose."""
        return Pose2(self.x, self.y, self.heading)


def initial_odometry(left: float, right: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> OdometryState:
    """Return odometry at rest at the given pose, with the wheels at the angles ``left`` and ``right`` [rad]."""
    return OdometryState(x, y, heading, 0.0, 0.0, left, right)


def integrate_encoders(
    odometry: OdometryState, left: float, right: float, dt: float, geometry: WheelGeometry, window: int = 1
) -> OdometryState:
    """Return the odometry after the wheels turned to the angles ``left`` and ``right`` [rad] in ``dt`` > 0 [s].

    Its speeds are the mean over the last ``window`` intervals. Angles that are not finite change nothing.
    """
    if not (math.isfinite(left) and math.isfinite(right)):
        return odometry
    went_left, went_right = (
        (left - odometry.left) * geometry.left_radius,
        (right - odometry.right) * geometry.right_radius,
    )
    length, turn = (went_left + went_right) / 2, (went_right - went_left) / geometry.separation
    x, y, heading = integrate_arc(odometry.x, odometry.y, odometry.heading, length, turn)
    if dt < MIN_INTERVAL_S:
        return OdometryState(x, y, heading, odometry.v, odometry.w, left, right, odometry.recent)
    recent = (*odometry.recent[max(0, len(odometry.recent) + 1 - window) :], (length / dt, turn / dt))
    count = len(recent)
    v = w = 0.0
    for speed, rate in recent:  # sum() rounds otherwise from Python 3.12 on
        v += speed
        w += rate
    return OdometryState(x, y, heading, v / count, w / count, left, right, recent)


def integrate_commands(odometry: OdometryState, v: float, w: float, dt: float) -> OdometryState:
    """Return the odometry after the limited command ``v`` [m/s], ``w`` [rad/s] has acted for ``dt`` [s]: open loop."""
    x, y, heading = integrate_arc(odometry.x, odometry.y, odometry.heading, v * dt, w * dt)
    return odometry._replace(x=x, y=y, heading=heading, v=v, w=w)


def integrate_arc(x: float, y: float, heading: float, length: float, turn: float) -> Pose2:
    """Return the pose after an arc of ``length`` [m] that turns by ``turn`` [rad]; exact for constant speeds.

    Its chord is length sin(turn/2) / (turn/2) long and points along heading + turn/2. ROS integrates the same arc, but
    takes a mid-heading step below 1e-6 rad; the chord needs no such case.
    """
    half = turn / 2
    chord = length * math.sin(half) / half if half else length
    course = heading + half
    return Pose2(x + chord * math.cos(course), y + chord * math.sin(course), heading + turn)


ZERO_COVARIANCE = covariance(0, 0, 0, 0, 0, 0)
"""The covariance of ground truth."""

PLANAR_COVARIANCE = covariance(1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)
"""The covariance of a pose from odometry: x and y, then three axes that a base does not measure, then yaw. The values
are those of Gazebo's ``libgazebo_ros_diff_drive``, which gives its twist ``ZERO_COVARIANCE``."""


def body_pose(state: BodyState) -> Pose:
    """Return the pose of a body in the world."""
    return Pose3(state.position, state.orientation).to_msg()


def body_twist(state: BodyState) -> Twist:
    """Return the velocity of a body in its own axes."""
    vx, vy, vz = rotate_inverse(state.orientation, state.linear)
    wx, wy, wz = rotate_inverse(state.orientation, state.angular)
    return Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))


Motion = tuple[float, ...]
"""The thirteen numbers of an ``Odometry``: position [m], orientation, velocity [m/s] and turn rate [rad/s]."""


def world_motions(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the true motion of bases, pose in the world and twist in their own axes, from their states, both (n, 13).

    With ``PLANAR_COVARIANCE`` this is what the TurtleBot3's plugin calls odometry: not relative to the spawn pose.
    """
    if len(states) <= FEW:
        return np.array([_world_motion(state) for state in states.tolist()]).reshape(-1, 13)
    return np.array(_world_motion(states.T)).T


def _world_motion(state: Any) -> tuple[Any, ...]:
    """Return the motion of one base; the thirteen numbers of its state may be arrays."""
    orientation = state[3:7]
    return *state[:7], *rotate_inverse(orientation, state[7:10]), *rotate_inverse(orientation, state[10:])


def counted_motion(odometry: OdometryState) -> Motion:
    """Return counted odometry as a motion on level ground."""
    x, y, heading, v, w, *_ = odometry
    return x, y, 0.0, 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2), v, 0.0, 0.0, 0.0, 0.0, w


class OdometrySample(NamedTuple):
    """Odometry at one instant: counted, or the true state of the body; nothing is computed until it is needed."""

    state: OdometryState | BodyState

    @property
    def pose(self) -> tuple[float, ...]:
        """Position and orientation, seven numbers."""
        if isinstance(self.state, BodyState):
            return *self.state.position, *self.state.orientation
        return counted_motion(self.state)[:7]


def odometry_motions(samples: Sequence[OdometrySample]) -> NDArray[np.float64]:
    """Return odometry as it is published, a row of thirteen numbers each."""
    states = [each.state for each in samples]
    in_world = [isinstance(each, BodyState) for each in states]
    motions = np.array([each.numbers if isinstance(each, BodyState) else counted_motion(each) for each in states])
    if any(in_world):
        motions[in_world] = world_motions(motions[in_world])
    return motions


def odometry_message(
    header: Header, child: str, motion: Sequence[float], pose_covariance: Packed36, twist_covariance: Packed36
) -> Odometry:
    """Return a motion as a message; the twist is in the frame ``child``."""
    x, y, z, i, j, k, w, vx, vy, vz, wx, wy, wz = motion
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
    twist = Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))
    return Odometry(
        header=header,
        child_frame_id=child,
        pose=PoseWithCovariance(pose=pose, packed=pose_covariance),
        twist=TwistWithCovariance(twist=twist, packed=twist_covariance),
    )


class Odometer:
    """The odometry of one robot. ``state`` is what it has counted; None if odometry is the true pose in the world.

    ``offset`` is the current pose of the odometry frame relative to its initial one: the world's origin with
    ``config.in_world``, else the robot's start pose. ``seed`` is the run's seed, from which the error is drawn.
    """

    def __init__(
        self,
        settings: OdometryConfig,
        body: BodyHandle,
        name: str,
        controller: DiffDriveController | None,
        seed: int = 0,
    ) -> None:
        self._body, self._name, self._controller = body, name, controller
        self.joint_count = len(body.joints)
        self._draws = draw_errors(seed, name)
        self._assumed: tuple[Drive, WheelGeometry] | None = None
        """A drive, and the wheel geometry that odometry assumes for it."""
        self.reconfigure(settings)
        if controller is not None:
            config = controller.config
            self._left, self._right = (
                tuple((body.joints.index(joint), -1.0 if joint in config.reversed else 1.0) for joint in side)
                for side in (config.left_joints, config.right_joints)
            )
        self.reset()

    def reset(self) -> None:
        """Restart counting here, from the current wheel angles."""
        counts = self._controller is not None and self.config.source != "world"
        here = body_pose(self._body.state()) if counts and self.config.in_world else None
        start = IDENTITY if here is None else Pose2.from_msg(here)
        self.state: OdometryState | None = initial_odometry(*self._angles(), *start) if counts else None
        self.offset = IDENTITY
        self._last_update = -1

    def update_from_commands(self) -> None:
        """Integrate the command of the coming physics step, if odometry is open loop."""
        if self.state is not None and self._controller is not None and self.config.source == "open loop":
            self.state = integrate_commands(self.state, *self._controller.commanded_velocity, STEP_S)

    @property
    def follows_encoders(self) -> bool:
        """Whether it counts the turns of wheels."""
        return self.state is not None and self._controller is not None and self.config.source == "encoder"

    def update_from_encoders(self, now: int, angles: Sequence[float]) -> None:
        """Integrate the wheel angles up to ``now`` [ns], where the ``joint_count`` joints are at ``angles`` [rad]."""
        if 0 <= self._last_update < now:
            assert self.state is not None
            assert self._controller is not None
            drive = self._controller.drive
            if self._assumed is None or self._assumed[0] is not drive:
                self._assumed = drive, assumed_geometry(drive.geometry, self.error)
            left, right = _mean(angles, self._left), _mean(angles, self._right)
            dt = (now - self._last_update) / 1e9
            self.state = integrate_encoders(self.state, left, right, dt, self._assumed[1], self.config.window)
        self._last_update = now

    def sample(self, snapshot: Snapshot) -> OdometrySample:
        """Return the odometry of this snapshot."""
        return OdometrySample(snapshot.state(self._name) if self.state is None else self.state)

    def set_pose(self, x: float, y: float, heading: float) -> None:
        """Continue counting from (x [m], y [m], heading [rad]); raises BadInput if odometry is the true pose."""
        if self.state is None:
            raise BadInput(
                f"the odometry of {self._name} is its true pose in the world, which cannot be set: move the model with "
                'set_state, or give it odometry = "encoder"'
            )
        pose = Pose2(x, y, heading)
        self.offset = self.offset @ self.state.pose @ pose.inverse()
        self.state = self.state._replace(x=x, y=y, heading=heading)

    def reconfigure(self, settings: OdometryConfig) -> None:
        """Change covariances, averaging window and error; the source stays the same."""
        self.config = settings
        self.error = odometry_error(settings.error, settings.error_multiple, self._draws)
        self._assumed = None
        self.pose_covariance: Packed36 = PLANAR_COVARIANCE if settings.pose is None else settings.pose
        self.twist_covariance: Packed36 = ZERO_COVARIANCE if settings.twist is None else settings.twist

    def _angles(self) -> tuple[float, float]:
        angles = self._body.joint_readings().position
        return _mean(angles, self._left), _mean(angles, self._right)


def _mean(values: Sequence[float], chosen: tuple[tuple[int, float], ...]) -> float:
    """Return the mean of the values chosen by index, each multiplied by its sign."""
    total = 0.0
    for index, sign in chosen:  # sum() rounds otherwise from Python 3.12 on
        total += values[index] * sign
    return total / len(chosen)
