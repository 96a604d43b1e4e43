"""The transforms of all robots on ``/tf`` and ``/tf_static``; frame ids begin with the robot's frame prefix."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from messages import se2
from messages.geometry import TransformStamped
from messages.se3 import IDENTITY, Pose3, quaternion_multiply, rotate
from messages.std import Header, Time
from messages.template import Template
from messages.tf import EncodedSplit, TFMessage, transform_size
from models.urdf import Joint, read_joints
from services.sim.drive.odometry import OdometrySample
from services.sim.robot import Robot
from services.sim.robot_names import WORLD_FRAME, robot_links
from services.sim.snapshot import Snapshot
from services.sim.template_groups import GroupEncoder, TemplateGroup


def static_transforms(robots: Iterable[tuple[Robot, Pose3]], now: int) -> TFMessage:
    """Return all fixed transforms in one message, since a latched publisher keeps only its last.

    ``world`` to ``odom`` is the identity if odometry starts in world coordinates, else the spawn pose; both are moved
    by later settings of odometry. A model with a fixed base has no odometry: its base is in ``world``.
    """
    transforms = []
    for robot, spawn_pose in robots:
        fixed_base = robot.model.fixed_base
        origin = robot.pose if fixed_base else _odom_origin(robot, spawn_pose)
        child = f"{robot.frame_prefix}{robot.model.base_frame if fixed_base else robot.model.odom_frame}"
        header = Header(stamp=Time.of(now), frame_id=WORLD_FRAME)
        if child != WORLD_FRAME:
            transforms.append(_stamped(header, child, origin))
        if (extra := _extra_frame(robot)) is not None:
            inside = replace(header, frame_id=f"{robot.frame_prefix}{extra}")
            transforms.append(_stamped(inside, f"{robot.frame_prefix}{robot.model.base_frame}", IDENTITY))
        for joint in _published_joints(robot):
            if not joint.single_dof:
                transforms.append(_joint_transform(robot.frame_prefix, joint, 0.0, now))
    return TFMessage(transforms=tuple(transforms))


class _TransformTemplate:
    """The transform between two frames, without its stamp and its seven numbers."""

    def __init__(self, frame: str, child: str) -> None:
        self.template = Template(lambda stamp, numbers: _of_numbers(stamp, frame, child, numbers), 7)
        self.size = transform_size(frame, child)


class _RobotFrames:
    """The moving frames of a robot: its base, and its joints if the simulation publishes them.

    ``indices`` are the indices of the joints in the body's joint readings.
    """

    def __init__(self, robot: Robot, joints: Sequence[str]) -> None:
        self.robot, prefix, self.joint_count = robot, robot.frame_prefix, len(joints)
        indices = {name: index for index, name in enumerate(joints)}
        self.joints = [each for each in _published_joints(robot) if each.name in indices]
        self.indices = [indices[each.name] for each in self.joints]
        self.of_joints = [_TransformTemplate(prefix + each.parent, prefix + each.child) for each in self.joints]
        base = _extra_frame(robot) or robot.model.base_frame
        self.of_base = _TransformTemplate(prefix + robot.model.odom_frame, prefix + base)

    @property
    def odometry(self) -> tuple[bytes, OdometrySample] | None:
        """The stamp and sample published last; None if the base is not on ``/tf``."""
        return self.robot.publishers.odometry if self.robot.actuation.publishes_odom_tf else None


class MovingTransforms:
    """Encodes the transforms of all robots' bases in their odometry, and of their joints."""

    def __init__(self) -> None:
        self._frames: dict[str, _RobotFrames] = {}
        self._based: list[_RobotFrames] | None = None
        """Robots whose bases are on ``/tf``, in the order of all; None forces a new arrangement."""
        self._base_encoder = GroupEncoder()

    def add(self, robot: Robot, joints: Sequence[str]) -> None:
        """Add a robot whose body has these joints."""
        self._frames[robot.name] = _RobotFrames(robot, joints)
        self._based = None

    def remove(self, name: str) -> None:
        """Remove a robot."""
        del self._frames[name]
        self._based = None

    def encode(self, snapshot: Snapshot) -> list[bytes]:
        """Return the encoded messages of the current transforms; a base's is stamped with its last odometry."""
        odometries = {each: odometry for each in self._frames.values() if (odometry := each.odometry) is not None}
        if (based := list(odometries)) != self._based:
            self._arrange(based)
        transforms = self._encode_bases(odometries) + self._encode_joints(snapshot)
        return self._messages.join([transforms[index] for index in self._order])

    def _arrange(self, based: list[_RobotFrames]) -> None:
        """Arrange the transforms of these bases and of all joints, those of one robot next to each other."""
        frames, self._based = list(self._frames.values()), based
        self._jointed = tuple(each.robot.name for each in frames if each.joints)
        self._joints = JointTransforms([joint for each in frames for joint in each.joints])
        self._joint_encoder = TemplateGroup([link.template for each in frames for link in each.of_joints])
        self._joint_indices = list[int]()
        """Indices of these joints among all joints of their robots."""
        self._order = list[int]()
        sizes, base, joint, angles = list[int](), 0, len(based), 0
        for each in frames:
            if each in based:
                self._order.append(base)
                sizes.append(each.of_base.size)
                base += 1
            self._order += range(joint, joint + len(each.joints))
            sizes += [link.size for link in each.of_joints]
            self._joint_indices += [angles + index for index in each.indices]
            joint, angles = joint + len(each.joints), angles + (each.joint_count if each.joints else 0)
        self._messages = EncodedSplit(sizes)

    def _encode_bases(self, odometries: dict[_RobotFrames, tuple[bytes, OdometrySample]]) -> list[bytes]:
        found: dict[bytes, list[_RobotFrames]] = {}
        for each, (stamp, _) in odometries.items():
            found.setdefault(stamp, []).append(each)
        encoded: dict[_RobotFrames, bytes] = {}
        for stamp, alike in found.items():
            poses = np.array([odometries[each][1].pose for each in alike])
            payloads = self._base_encoder.encode([each.of_base.template for each in alike], stamp, poses)
            encoded.update(zip(alike, payloads, strict=True))
        return [encoded[each] for each in odometries]

    def _encode_joints(self, snapshot: Snapshot) -> list[bytes]:
        positions = snapshot.joint_rows(self._jointed)[0][self._joint_indices]
        return self._joint_encoder.encode(snapshot.stamp, self._joints.poses(positions.tolist()))


class JointTransforms:
    """``Joint.transform`` for many joints at once."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._xyz = np.array([joint.xyz for joint in joints]).reshape(-1, 3).T
        mounts: Any = np.array([joint.rotation() for joint in joints]).reshape(-1, 4).T
        axes: Any = np.array([joint.axis for joint in joints]).reshape(-1, 3).T
        slides = np.array([joint.kind == "prismatic" for joint in joints], bool)
        self._axes, self._slides = np.where(slides, 0.0, axes), np.where(slides, rotate(mounts, axes), 0.0)
        self._mounts = mounts

    def poses(self, positions: Sequence[float]) -> NDArray[np.float64]:
        """Return the poses of child links in their parents, shape (n, 7): position [m], orientation (x, y, z, w)."""
        # Python's sine and cosine: numpy's differ in the last digit between processors.
        sine = np.array([math.sin(each / 2) for each in positions])
        cosine = np.array([math.cos(each / 2) for each in positions])
        rotation = (*(sine * self._axes), np.where(self._axes.any(axis=0), cosine, 1.0))
        position = self._xyz + np.array(positions) * self._slides
        return np.concatenate((position, quaternion_multiply(self._mounts, rotation))).T


def _extra_frame(robot: Robot) -> str | None:
    """Return the child frame of odometry if it is not a link of the robot; it then coincides with the root.

    A frame has one parent, so a link other than the root cannot be that child: the root moves in ``odom`` instead.
    """
    stated = robot.publishers.odometry_child
    return None if robot.model.fixed_base or stated in robot_links(robot.entry.model) else stated


def _published_joints(robot: Robot) -> tuple[Joint, ...]:
    """Return the joints whose transforms the simulation publishes: all, or none if the service ``state`` does."""
    return read_joints(robot.entry.model) if robot.actuation.publishes_link_tf else ()


def _odom_origin(robot: Robot, spawn_pose: Pose3) -> Pose3:
    """Return the pose of a robot's odometry frame in the world."""
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
