"""The readings of a robot's sensors as messages: laser scan, IMU, joint states, camera and sonars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from messages.base import Float32Array
from messages.geometry import Point32, Quaternion, Vector3
from messages.se3 import (
    Pose3,
    Vector,
    add_cross,
    rotate,
    rotate_inverse,
    rotated_axes,
)
from messages.sensor import CameraInfo, ChannelFloat32, Image, Imu, JointState, LaserScan, PointCloud, Range
from messages.std import Header
from models.model import CameraConfig, ImuConfig, LaserConfig, SonarConfig
from models.urdf import read_joints
from services.sim.physics.world import GRAVITY, CameraModel, JointReadings, World

Floats = NDArray[np.float64]


def laser_ranges(world: World, robots: Sequence[str], laser: LaserConfig, noise: Sequence[Floats | None]) -> Floats:
    """Return one scan of a laser on each robot, shape (robots, samples), m, all rays at the same instant.

    They go counter-clockwise in the link's plane. A ray without an echo up to ``range_max`` gives inf, one that hits
    something nearer than ``range_min`` gives -inf (REP 117). Rays start outside the laser's housing, so they cannot hit
    it. 360 rays take about 1 ms. ``noise`` has standard normal numbers for each robot, shape (samples,), or None.
    """
    ranges = world.cast_fans(
        [(robot, laser.link) for robot in robots],
        laser.mount.pose,
        _ray_directions(laser),
        laser.clearance,
        laser.range_max,
    )
    for row, errors in enumerate(noise):
        if errors is not None:
            ranges[row] += laser.noise * errors
            ranges[row] = np.where(np.isinf(ranges[row]), np.inf, np.minimum(ranges[row], laser.range_max))
    ranges[ranges < laser.range_min] = -np.inf
    return ranges


def laser_scan(laser: LaserConfig, ranges: Floats, header: Header) -> LaserScan:
    """Return a scan as a message, from ``ranges`` [m], shape (samples,).

    Intensities are 0, as in Gazebo without reflectors.
    """
    return LaserScan(
        header=header,
        angle_min=laser.angle_min,
        angle_max=laser.angle_min + (laser.samples - 1) * laser.increment,
        angle_increment=laser.increment,
        scan_time=1 / laser.rate,
        range_min=laser.range_min,
        range_max=laser.range_max,
        ranges=Float32Array(ranges),
        intensities=_zeros(len(ranges)),
    )


@cache
def _zeros(samples: int) -> Float32Array:
    return Float32Array(np.zeros(samples))


@cache
def _ray_directions(laser: LaserConfig) -> NDArray[np.float64]:
    angles = laser.angle_min + np.arange(laser.samples) * laser.increment
    return np.stack((np.cos(angles), np.sin(angles), np.zeros(laser.samples)), axis=1)


ALIGNED = 1 - 1e-9
"""Cosine of half the largest angle between the axes of an IMU and its body at which they count as equal."""


def imu_readings(config: ImuConfig, poses: Floats, before: Floats, now: Floats, dt: float, noise: Floats) -> Floats:
    """Return the readings of IMUs of one kind over the last ``dt`` [s], each on a body of its own.

    The specific force is R^T (dv/dt + g e_z), with dv the change of the IMU's own velocity: rotation about another
    point shows up, and an IMU at rest measures +g upward.

    Args:
        config: Its noise.
        poses: Poses of the IMUs, shape (n, 7).
        before: States of the bodies ``dt`` ago, shape (n, 13).
        now: Current states of the bodies, shape (n, 13).
        dt: Time between the two [s].
        noise: Standard normal numbers, shape (n, 6); zeros without noise.

    Returns:
        Shape (n, 10): the orientation in the world, the turn rate [rad/s] and the specific force [m/s2] in the IMU's
            own axes.
    """
    pose: Any = poses.T
    old: Any = before.T
    new: Any = now.T
    body = new[3:7]
    axes, spin = pose[3:], new[10:]
    offset = rotate_inverse(body, pose[:3] - new[:3])
    x, y, z, w = body * axes
    aligned = np.abs(w + x + y + z) >= ALIGNED
    orientation: Any = np.where(aligned, body, axes)
    change: Any = (np.array(_point_velocity(new, offset)) - np.array(_point_velocity(old, offset))) / dt
    change[2] += GRAVITY
    rate, force = rotate_inverse(orientation, spin), rotate_inverse(orientation, change)
    readings = np.concatenate((orientation, rate, force)).T
    readings[:, 4:] += noise * np.repeat((config.gyro_noise, config.acceleration_noise), 3)
    return readings


def _point_velocity(states: Any, offset: Any) -> Vector:
    """Return the world velocity [m/s] of points ``offset`` [m, body axes] of bodies, v + w x R r, of arrays."""
    return add_cross(states[7:10], states[10:], rotate(states[3:7], offset))


def imu_message(config: ImuConfig, header: Header, numbers: Sequence[float]) -> Imu:
    """Return a reading as a message; ``numbers`` are its orientation, turn rate and specific force."""
    x, y, z, w, wx, wy, wz, ax, ay, az = numbers
    return Imu(
        header=header,
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        angular_velocity=Vector3(x=wx, y=wy, z=wz),
        angular_velocity_covariance=_isotropic(config.gyro_noise),
        linear_acceleration=Vector3(x=ax, y=ay, z=az),
        linear_acceleration_covariance=_isotropic(config.acceleration_noise),
    )


def joint_state(names: Sequence[str], readings: JointReadings, header: Header) -> JointState:
    """Return the angles, speeds and torques of a robot's joints as a message."""
    return JointState(
        header=header,
        name=tuple(names),
        position=readings.position,
        velocity=readings.velocity,
        effort=readings.effort,
    )


def _isotropic(deviation: float) -> tuple[float, ...]:
    variance = deviation * deviation
    return (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)


TO_OPTICAL = Pose3((0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5))
"""Rotation to the optical frame (z forward, x right) of a camera that looks along its x axis, as Gazebo's do."""


def camera_image(world: World, robot: str, camera: CameraConfig, header: Header) -> Image:
    """Return the image of the robot's camera, ``rgb8``; the header's frame should be the camera's optical frame."""
    lens = CameraModel(camera.width, camera.height, camera.fov, camera.near, camera.far)
    eye = world.body(robot).link_pose(camera.link) @ camera.mount.pose
    pixels = world.render(eye if camera.optical else eye @ TO_OPTICAL, lens)
    return Image(
        header=header,
        height=camera.height,
        width=camera.width,
        encoding="rgb8",
        step=3 * camera.width,
        data=pixels,
    )


def camera_info(camera: CameraConfig, header: Header) -> CameraInfo:
    """Return the camera's intrinsics: square pixels, no distortion, the principal point in the middle.

    The focal length in pixels is f = (width / 2) / tan(fov / 2).
    """
    focal = camera.width / 2 / math.tan(camera.fov / 2)
    cx, cy = camera.width / 2, camera.height / 2
    return CameraInfo(
        header=header,
        height=camera.height,
        width=camera.width,
        d=(0.0,) * 5,
        k=(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0),
        r=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        p=(focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0),
    )


CONE_CIRCLES = 3
"""Circles of rays around a cone's axis: 1 + 6 + 12 + 18 = 37 rays. In a cone of 30 degrees they are 5 degrees apart; an
object between them appears farther by 0.13 %."""

GROUND_MARGIN = 0.001
"""m; rays end this high above the ground, which gives no echo: at such flat angles sound is reflected away."""


@dataclass(frozen=True)
class SonarRing:
    """The ``n`` sonars of a robot in the frame ``config.link``: positions [m] and axes, both of shape (n, 3), and the
    rays of their cones, unit vectors of shape (n, m, 3)."""

    config: SonarConfig
    positions: Floats
    axes: Floats
    rays: Floats


def sonar_ring(model: str, config: SonarConfig) -> SonarRing:
    """Return the sonars of the robot ``model``, mounted where its URDF has their links on ``config.link``."""
    mounts = {joint.child: joint for joint in read_joints(model) if joint.parent == config.link}
    turns = [np.array(rotated_axes(mounts[link].rotation())).T for link in config.links]
    return SonarRing(
        config=config,
        positions=np.array([mounts[link].xyz for link in config.links]),
        axes=np.array([each[:, 0] for each in turns]),
        rays=np.array([cone_rays(config.cone) @ each.T for each in turns]),
    )


def cone_rays(angle: float) -> Floats:
    """Return unit vectors in a cone about the x axis, shape (m, 3).

    The axis comes first, then ``CONE_CIRCLES`` circles, the last at ``angle / 2`` [rad] from it.
    """
    vectors = [(1.0, 0.0, 0.0)]
    for circle in range(1, CONE_CIRCLES + 1):
        off = angle / 2 * circle / CONE_CIRCLES
        for step in range(6 * circle):
            around = 2 * math.pi * step / (6 * circle)
            vectors.append((math.cos(off), math.sin(off) * math.cos(around), math.sin(off) * math.sin(around)))
    return np.array(vectors)


def sonar_ranges(world: World, robot: str, ring: SonarRing, noise: Floats | None = None) -> Floats:
    """Return the range of each sonar's nearest echo, m, shape (n,), all at the same instant.

    inf without an echo up to ``range_max``, -inf for one nearer than ``range_min`` (REP 117). Everything in the cone
    gives an echo, however oblique. Sixteen sonars take about 2 ms.
    """
    config = ring.config
    eye = world.body(robot).link_pose(config.link)
    turn = np.array(rotated_axes(eye.orientation)).T
    rays = ring.rays @ turn.T
    starts = np.repeat((np.array(eye.position) + ring.positions @ turn.T)[:, None, :], rays.shape[1], axis=1)
    fall = np.minimum(rays[:, :, 2], -1e-12)
    reach = np.clip((GROUND_MARGIN - starts[:, :, 2]) / fall, GROUND_MARGIN, config.range_max)
    ends = starts + reach[:, :, None] * rays
    fractions = world.cast_rays(starts.reshape(-1, 3), ends.reshape(-1, 3)).reshape(reach.shape)
    ranges: Floats = (reach * fractions).min(axis=1)
    if noise is not None:
        heard = np.isfinite(ranges)
        ranges[heard] = np.minimum(ranges + config.noise * noise, config.range_max)[heard]
    ranges[ranges < config.range_min] = -np.inf
    return ranges


def sonar_cloud(ring: SonarRing, ranges: Floats, header: Header) -> PointCloud:
    """Return the echoes as points in the ring's frame, in the order of the sonars, as RosAria publishes them.

    Every sonar has a point on its axis: at ``range_max`` without an echo, as in ARIA, and at ``range_min`` for an echo
    that is too near. The channel ``range`` has the readings themselves. ``header`` must have the ring's frame.
    """
    shown = np.clip(ranges, ring.config.range_min, ring.config.range_max)
    return PointCloud(
        header=header,
        points=tuple(Point32(x=x, y=y, z=z) for x, y, z in (ring.positions + shown[:, None] * ring.axes).tolist()),
        channels=(ChannelFloat32(name="range", values=Float32Array(ranges)),),
    )


def range_messages(ring: SonarRing, ranges: Floats, headers: Sequence[Header]) -> list[Range]:
    """Return the readings as single messages; each sonar's header has its own frame."""
    config = ring.config
    return [
        Range(
            header=header,
            radiation_type=Range.ULTRASOUND,
            field_of_view=config.cone,
            min_range=config.range_min,
            max_range=config.range_max,
            range=reading,
        )
        for header, reading in zip(headers, ranges.tolist(), strict=True)
    ]
