"""Readings of a robot's sensors, from the world's records to messages."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from messages.base import Float32Array
from messages.geometry import Quaternion, Vector3
from messages.sensor import Imu, JointState, LaserScan
from messages.std import Header
from models.figures import Inertial, Laser
from services.sim.physics.rotation import into_body, into_world, matrix
from services.sim.physics.world import GRAVITY, BodyState, JointReadings, Vector, World


def noise_source(seed: int, robot: str, sensor: str, tick: int) -> np.random.Generator:
    """Random numbers that depend on nothing but run, robot, sensor and tick: a replayed tick gives the same noise."""
    return np.random.default_rng((seed, zlib.crc32(robot.encode()), zlib.crc32(sensor.encode()), tick))


def scan(world: World, robot: str, laser: Laser, header: Header, noise: np.random.Generator | None = None) -> LaserScan:
    """One turn of a laser, all rays at the same instant, counter-clockwise in the link's plane.

    A ray without an echo up to ``range_max`` gives inf, one that meets something nearer than ``range_min`` gives -inf
    (REP 117). The rays start outside the laser's housing, so that they cannot see it. 360 rays take about 1 ms.
    """
    eye = world.link_placement(robot, laser.link)
    rays = _directions(laser) @ matrix(eye.orientation).T
    origin = np.array(eye.position)
    reach = laser.range_max - laser.clearance
    fractions = world.rays(origin + laser.clearance * rays, origin + laser.range_max * rays)
    ranges = laser.clearance + reach * fractions
    if noise is not None:
        ranges += noise.normal(0.0, laser.noise, laser.samples)
        ranges = np.where(np.isinf(fractions), np.inf, np.minimum(ranges, laser.range_max))
    ranges[ranges < laser.range_min] = -np.inf
    return LaserScan(
        header=header,
        angle_min=laser.angle_min,
        angle_max=laser.angle_min + (laser.samples - 1) * laser.increment,
        angle_increment=laser.increment,
        scan_time=1 / laser.rate,
        range_min=laser.range_min,
        range_max=laser.range_max,
        ranges=Float32Array(ranges),
    )


def _directions(laser: Laser) -> NDArray[np.float64]:
    angles = laser.angle_min + np.arange(laser.samples) * laser.increment
    return np.stack((np.cos(angles), np.sin(angles), np.zeros(laser.samples)), axis=1)


def velocity_at(state: BodyState, offset: Vector) -> Vector:
    """The world velocity [m/s] of the point ``offset`` [m, body axes] of a body: v + w x R r."""
    rx, ry, rz = into_world(state.orientation, offset)
    (vx, vy, vz), (wx, wy, wz) = state.linear, state.angular
    return vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx


def imu(
    unit: Inertial,
    offset: Vector,
    before: BodyState,
    now: BodyState,
    dt: float,
    header: Header,
    noise: np.random.Generator | None = None,
) -> Imu:
    """What an inertial unit at ``offset`` [m] of a body, with the body's axes, measures over the last ``dt`` [s].

    The specific force is R^T (dv/dt + g e_z), with dv the change of the unit's own velocity from ``before`` to ``now``:
    turning off the centre shows up, and a unit at rest measures +g upward.
    """
    old, new = velocity_at(before, offset), velocity_at(now, offset)
    force = into_body(
        now.orientation, ((new[0] - old[0]) / dt, (new[1] - old[1]) / dt, (new[2] - old[2]) / dt + GRAVITY)
    )
    rate = into_body(now.orientation, now.angular)
    if noise is not None:
        errors = noise.standard_normal(6)
        rate = _add(rate, errors[:3] * unit.gyro_noise)
        force = _add(force, errors[3:] * unit.acceleration_noise)
    x, y, z, w = now.orientation
    return Imu(
        header=header,
        orientation=Quaternion(x=x, y=y, z=z, w=w),
        angular_velocity=Vector3(x=rate[0], y=rate[1], z=rate[2]),
        angular_velocity_covariance=_isotropic(unit.gyro_noise),
        linear_acceleration=Vector3(x=force[0], y=force[1], z=force[2]),
        linear_acceleration_covariance=_isotropic(unit.acceleration_noise),
    )


def joint_state(names: Sequence[str], readings: JointReadings, header: Header) -> JointState:
    """The angles, speeds and torques of a robot's joints."""
    return JointState(
        header=header,
        name=tuple(names),
        position=readings.position,
        velocity=readings.velocity,
        effort=readings.effort,
    )


def _add(vector: Vector, errors: NDArray[np.float64]) -> Vector:
    return vector[0] + float(errors[0]), vector[1] + float(errors[1]), vector[2] + float(errors[2])


def _isotropic(deviation: float) -> tuple[float, ...]:
    variance = deviation * deviation
    return (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)
