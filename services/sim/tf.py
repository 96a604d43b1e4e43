"""The transforms of all robots on ``/tf`` and ``/tf_static``; frame ids begin with the robot's frame prefix."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from messages import se2
from messages.geometry import TransformStamped
from messages.se3 import IDENTITY, Pose3
from messages.std import Header, Time
from messages.template import Template
from messages.tf import EncodedTransform, TFMessage, transform_size
from models.urdf import Joint, read_joints
from services.sim.moment import Moment
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
        if child != WORLD_FRAME:
            transforms.append(_stamped(header, child, origin))
        for joint in _published_joints(robot):
            if not joint.single_dof:
                transforms.append(_joint_transform(robot.frame_prefix, joint, 0.0, now))
    return TFMessage(transforms=tuple(transforms))


class _TransformTemplate:
    """The transform between two frames, but for its stamp and its seven numbers."""

    def __init__(self, frame: str, child: str) -> None:
        self._template = Template(lambda stamp, numbers: _of_numbers(stamp, frame, child, numbers), 7)
        self._size = transform_size(frame, child)

    def encode(self, stamp: bytes, numbers: Sequence[float]) -> EncodedTransform:
        return EncodedTransform(self._template.encode(stamp, numbers), self._size)


class _MovingJoint(NamedTuple):
    """A joint that moves, its place among the joints of the body, and its transform."""

    joint: Joint
    place: int
    template: _TransformTemplate


class RobotTransforms:
    """Where a base is in its odometry, and how its joints stand."""

    def __init__(self, robot: Robot, joints: Sequence[str]) -> None:
        self._robot, prefix = robot, robot.frame_prefix
        places = {name: place for place, name in enumerate(joints)}
        self._joints = [
            _MovingJoint(each, places[each.name], _TransformTemplate(prefix + each.parent, prefix + each.child))
            for each in read_joints(robot.entry.model)
            if each.name in places
        ]
        self._base = _TransformTemplate(prefix + robot.model.odom_frame, prefix + robot.model.base_frame)

    def encode(self, moment: Moment) -> Iterator[EncodedTransform]:
        """The transforms as they are now; that of the base is as old as the odometry that was published last."""
        robot = self._robot
        odometry, actuation = robot.publishers.odometry, robot.actuation
        if odometry is not None and actuation.publishes_odom_tf:
            stamp, sample = odometry
            yield self._base.encode(stamp, sample.pose)
        if self._joints and actuation.publishes_link_tf:
            angles = moment.joints(robot.name).position
            for joint, place, template in self._joints:
                position, turn = joint.transform(angles[place])
                yield template.encode(moment.stamp, (*position, *turn))


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


def _of_numbers(stamp: Time, frame: str, child: str, numbers: Sequence[float]) -> TransformStamped:
    x, y, z, i, j, k, w = numbers
    return _stamped(Header(stamp=stamp, frame_id=frame), child, Pose3((x, y, z), (i, j, k, w)))
