"""The transforms of all robots on ``/tf`` and ``/tf_static``; frame ids begin with the robot's frame prefix."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from messages import se2
from messages.geometry import Transform, TransformStamped, Vector3
from messages.se3 import IDENTITY, Pose3
from messages.std import Header, Time
from messages.tf import TFMessage, split
from models.urdf import Joint, read_joints
from services.sim.physics.world import World
from services.sim.robot import Robot
from services.sim.robot_names import WORLD_FRAME


def static_transforms(robots: Iterable[tuple[Robot, Pose3]], now: int) -> TFMessage:
    """All fixed transforms in one message, since a latched publisher keeps only its last.

    ``world`` to ``odom`` is the identity for odometry that began in world coordinates, else where the robot was
    spawned, moved by what odometry was set to since. A model with a fixed base has no odometry: its base stands in
    ``world``.
    """
    transforms = []
    for robot, spawn_pose in robots:
        fixed_base = robot.model.fixed_base
        origin = robot.pose if fixed_base else _odom_origin(robot, spawn_pose)
        child = f"{robot.frame_prefix}{robot.model.base_frame if fixed_base else robot.model.odom_frame}"
        header = Header(stamp=Time.of(now), frame_id=WORLD_FRAME)
        transforms.append(_stamped(header, child, origin))
        for joint in _published_joints(robot):
            if not joint.single_dof:
                transforms.append(_joint_transform(robot.frame_prefix, joint, 0.0, now))
    return TFMessage(transforms=tuple(transforms))


def dynamic_transforms(robots: Iterable[Robot], world: World, now: int) -> Iterator[TFMessage]:
    """Where the bases are in their odometry, and how the wheels stand, in as many messages as it takes."""
    transforms = []
    for robot in robots:
        odometry = robot.publishers.odometry
        if odometry is not None and robot.actuation.publishes_odom_tf:
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
        joints = _published_joints(robot)
        if not joints:
            continue
        body = world.body(robot.name)
        angles = dict(zip(body.joints, body.joint_readings().position, strict=True))
        for joint in joints:
            if joint.name in angles:
                transforms.append(_joint_transform(robot.frame_prefix, joint, angles[joint.name], now))
    return split(transforms)


def _published_joints(robot: Robot) -> tuple[Joint, ...]:
    """The joints whose transforms the simulation publishes: all, or none when the service ``state`` does."""
    return read_joints(robot.entry.model) if robot.actuation.publishes_link_tf else ()


def _odom_origin(robot: Robot, spawn_pose: Pose3) -> Pose3:
    """Where the frame of a robot's odometry lies in the world."""
    odometer = robot.publishers.odometer
    if odometer.state is None:
        return IDENTITY
    start = IDENTITY if odometer.config.in_world else spawn_pose
    if odometer.offset == se2.IDENTITY:
        return start
    return start @ Pose3.planar(*odometer.offset)


def _joint_transform(prefix: str, joint: Joint, angle: float, now: int) -> TransformStamped:
    header = Header(stamp=Time.of(now), frame_id=f"{prefix}{joint.parent}")
    return _stamped(header, f"{prefix}{joint.child}", joint.transform(angle))


def _stamped(header: Header, child: str, pose: Pose3) -> TransformStamped:
    return TransformStamped(header=header, child_frame_id=child, transform=pose.to_transform())
