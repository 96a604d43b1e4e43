"""The transforms of all robots on ``/tf`` and ``/tf_static``, every frame prefixed by its robot's name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from messages.geometry import Quaternion, Transform, TransformStamped, Vector3
from messages.std import Header, Time
from messages.tf import TFMessage, split
from models.frames import Joint, read_joints
from services.sim.diffdrive.odometry import Pose2
from services.sim.physics.rotation import into_world
from services.sim.physics.world import ORIGIN, Placement, World
from services.sim.robot import Robot


def fixed(robots: Iterable[tuple[Robot, Placement]], now: int) -> TFMessage:
    """All fixed transforms in one message, since a latched publisher keeps only its last.

    ``world`` to ``odom`` is the identity for odometry in world coordinates, else where the robot was spawned, moved by
    what odometry was set to since. A model with a fixed base has no odometry: its base stands in ``world``.
    """
    transforms = []
    for robot, spawned in robots:
        fixed_base = robot.model.fixed_base
        origin = robot.placement if fixed_base else _origin(robot, spawned)
        child = f"{robot.name}/{robot.model.base_frame if fixed_base else 'odom'}"
        header = Header(stamp=Time.of(now), frame_id="world")
        transforms.append(_stamped(header, child, origin.position, origin.orientation))
        for joint in _links(robot):
            if joint.kind == "fixed":
                transforms.append(_of_joint(robot.name, joint, 0.0, now))
    return TFMessage(transforms=tuple(transforms))


def moving(robots: Iterable[Robot], world: World, now: int) -> Iterator[TFMessage]:
    """Where the bases are in their odometry, and how the wheels stand, in as many messages as it takes."""
    transforms = []
    for robot in robots:
        odometry = robot.telemetry.odometry
        if odometry is not None and (robot.base is None or robot.base.live.enable_odom_tf):
            pose = odometry.pose.pose
            place = pose.position
            transforms.append(
                TransformStamped(
                    header=odometry.header,
                    child_frame_id=odometry.child_frame_id,
                    transform=Transform(
                        translation=Vector3(x=place.x, y=place.y, z=place.z), rotation=pose.orientation
                    ),
                )
            )
        joints = _links(robot)
        if not joints:
            continue
        angles = dict(zip(world.joints(robot.name), world.joint_readings(robot.name).position, strict=True))
        for joint in joints:
            if joint.name in angles:
                transforms.append(_of_joint(robot.name, joint, angles[joint.name], now))
    return split(transforms)


def _links(robot: Robot) -> tuple[Joint, ...]:
    """The joints whose transforms the simulation tells: all, or none when the service ``state`` does."""
    entry = robot.entry
    terms = entry.parameters if robot.base is not None else entry.joint_parameters
    return () if terms.enable_link_tf is False else read_joints(entry.model)


def _origin(robot: Robot, spawned: Placement) -> Placement:
    """Where the frame of a robot's odometry lies in the world."""
    odometer = robot.telemetry.odometer
    if odometer.track is None:
        return ORIGIN
    if odometer.moved == Pose2():
        return spawned
    x, y, heading = odometer.moved
    dx, dy, dz = into_world(spawned.orientation, (x, y, 0.0))
    px, py, pz = spawned.position
    i, j, k, w = spawned.orientation
    s, c = math.sin(heading / 2), math.cos(heading / 2)
    turned = (i * c + j * s, j * c - i * s, k * c + w * s, w * c - k * s)
    return Placement((px + dx, py + dy, pz + dz), turned)


def _of_joint(robot: str, joint: Joint, angle: float, now: int) -> TransformStamped:
    header = Header(stamp=Time.of(now), frame_id=f"{robot}/{joint.parent}")
    return _stamped(header, f"{robot}/{joint.child}", *joint.placement(angle))


def _stamped(
    header: Header, child: str, xyz: tuple[float, float, float], turn: tuple[float, float, float, float]
) -> TransformStamped:
    transform = Transform(
        translation=Vector3(x=xyz[0], y=xyz[1], z=xyz[2]),
        rotation=Quaternion(x=turn[0], y=turn[1], z=turn[2], w=turn[3]),
    )
    return TransformStamped(header=header, child_frame_id=child, transform=transform)
