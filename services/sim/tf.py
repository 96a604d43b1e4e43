"""The transforms of all robots on ``/tf`` and ``/tf_static``; frame ids begin with the robot's frame prefix."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from messages import se2
from messages.geometry import TransformStamped
from messages.se3 import IDENTITY, Pose3, quaternion_multiply, rotate
from messages.std import Header, Time
from messages.template import Template
from messages.tf import EncodedTransform, TFMessage, transform_size
from models.urdf import Joint, read_joints
from services.sim.drive.odometry import OdometrySample
from services.sim.moment import Moment
from services.sim.robot import Robot
from services.sim.robot_names import WORLD_FRAME, robot_links
from services.sim.template_groups import GroupEncoder


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
        if (extra := _extra_frame(robot)) is not None:
            inside = replace(header, frame_id=f"{robot.frame_prefix}{extra}")
            transforms.append(_stamped(inside, f"{robot.frame_prefix}{robot.model.base_frame}", IDENTITY))
        for joint in _published_joints(robot):
            if not joint.single_dof:
                transforms.append(_joint_transform(robot.frame_prefix, joint, 0.0, now))
    return TFMessage(transforms=tuple(transforms))


class _TransformTemplate:
    """The transform between two frames, but for its stamp and its seven numbers."""

    def __init__(self, frame: str, child: str) -> None:
        self.template = Template(lambda stamp, numbers: _of_numbers(stamp, frame, child, numbers), 7)
        self.size = transform_size(frame, child)


class _RobotFrames:
    """The frames of a robot that move: that of its base, and those of its joints with their places in the readings."""

    def __init__(self, robot: Robot, joints: Sequence[str]) -> None:
        self.robot, prefix = robot, robot.frame_prefix
        places = {name: place for place, name in enumerate(joints)}
        self.joints = [each for each in read_joints(robot.entry.model) if each.name in places]
        self.places = [places[each.name] for each in self.joints]
        self.of_joints = [_TransformTemplate(prefix + each.parent, prefix + each.child) for each in self.joints]
        base = _extra_frame(robot) or robot.model.base_frame
        self.of_base = _TransformTemplate(prefix + robot.model.odom_frame, prefix + base)

    @property
    def odometry(self) -> tuple[bytes, OdometrySample] | None:
        """What was published last, and its stamp; None where the base is no transform."""
        return self.robot.publishers.odometry if self.robot.actuation.publishes_odom_tf else None

    @property
    def tells_joints(self) -> bool:
        """Whether its joints are transforms."""
        return bool(self.joints) and self.robot.actuation.publishes_link_tf


class MovingTransforms:
    """Where the bases of all robots are in their odometry, and how their joints stand."""

    def __init__(self) -> None:
        self._frames: dict[str, _RobotFrames] = {}
        self._bases, self._links = GroupEncoder(), GroupEncoder()
        self._jointed: list[_RobotFrames] = []
        self._joints = JointTransforms(())

    def add(self, robot: Robot, joints: Sequence[str]) -> None:
        """A robot has come, whose body has these joints."""
        self._frames[robot.name] = _RobotFrames(robot, joints)

    def remove(self, name: str) -> None:
        """A robot has gone."""
        del self._frames[name]

    def encode(self, moment: Moment) -> Iterator[EncodedTransform]:
        """The transforms as they are now; that of a base is as old as the odometry that was published last."""
        bases, links = self._encode_bases(), self._encode_joints(moment)
        for each in self._frames.values():
            if (base := bases.get(each)) is not None:
                yield EncodedTransform(base, each.of_base.size)
            for link in each.of_joints if each.tells_joints else ():
                yield EncodedTransform(next(links), link.size)

    def _encode_bases(self) -> dict[_RobotFrames, bytes]:
        found: dict[bytes, list[tuple[_RobotFrames, OdometrySample]]] = {}
        for each in self._frames.values():
            if (odometry := each.odometry) is not None:
                found.setdefault(odometry[0], []).append((each, odometry[1]))
        encoded: dict[_RobotFrames, bytes] = {}
        for stamp, alike in found.items():
            poses = np.array([sample.pose for _, sample in alike])
            payloads = self._bases.encode([each.of_base.template for each, _ in alike], stamp, poses)
            encoded.update(zip((each for each, _ in alike), payloads, strict=True))
        return encoded

    def _encode_joints(self, moment: Moment) -> Iterator[bytes]:
        jointed = [each for each in self._frames.values() if each.tells_joints]
        if jointed != self._jointed:
            self._jointed = jointed
            self._joints = JointTransforms([joint for each in jointed for joint in each.joints])
        positions = list[float]()
        for each in jointed:
            readings = moment.joints(each.robot.name).position
            positions += [readings[place] for place in each.places]
        templates = [link.template for each in jointed for link in each.of_joints]
        return iter(self._links.encode(templates, moment.stamp, self._joints.poses(positions)))


class JointTransforms:
    """``Joint.transform`` of many joints at once."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        self._xyz = np.array([joint.xyz for joint in joints]).reshape(-1, 3).T
        mounts: Any = np.array([joint.rotation() for joint in joints]).reshape(-1, 4).T
        axes: Any = np.array([joint.axis for joint in joints]).reshape(-1, 3).T
        slides = np.array([joint.kind == "prismatic" for joint in joints], bool)
        self._axes, self._slides = np.where(slides, 0.0, axes), np.where(slides, rotate(mounts, axes), 0.0)
        self._mounts = mounts

    def poses(self, positions: Sequence[float]) -> NDArray[np.float64]:
        """The poses of the children in the parents, shape (n, 7): position [m], orientation (x, y, z, w)."""
        # Python's sine and cosine: those of numpy differ in the last place from one processor to another.
        sine = np.array([math.sin(each / 2) for each in positions])
        cosine = np.array([math.cos(each / 2) for each in positions])
        turn = (*(sine * self._axes), np.where(self._axes.any(axis=0), cosine, 1.0))
        place = self._xyz + np.array(positions) * self._slides
        return np.concatenate((place, quaternion_multiply(self._mounts, turn))).T


def _extra_frame(robot: Robot) -> str | None:
    """The child frame of odometry where it is none of the robot's links: it coincides with the root.

    A link that is not the root has a parent already, and a frame has one: then the root is what moves in ``odom``.
    """
    stated = robot.publishers.odometry_child
    return None if robot.model.fixed_base or stated in robot_links(robot.entry.model) else stated


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
