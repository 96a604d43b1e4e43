"""Odometry as messages: a base's true motion, or what its wheels tell."""

from __future__ import annotations

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
from messages.std import Header
from services.sim.diffdrive.odometry import Track
from services.sim.physics.rotation import into_body
from services.sim.physics.world import BodyState

EXACT = covariance(0, 0, 0, 0, 0, 0)
"""Of ground truth."""

PLANAR = covariance(1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)
"""Of a pose from odometry: x and y, then three axes that a base does not measure, then yaw. The figures of Gazebo's
``libgazebo_ros_diff_drive``, which gives its twist ``EXACT``."""


def pose_of(state: BodyState) -> Pose:
    """The pose of a body in the world."""
    (x, y, z), (i, j, k, w) = state.position, state.orientation
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))


def body_twist(state: BodyState) -> Twist:
    """The velocity of a body in its own axes."""
    vx, vy, vz = into_body(state.orientation, state.linear)
    wx, wy, wz = into_body(state.orientation, state.angular)
    return Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))


def world_odometry(
    state: BodyState, header: Header, child: str, pose_covariance: Packed36 = EXACT, twist_covariance: Packed36 = EXACT
) -> Odometry:
    """The true motion of a base: pose in the world, twist in the frame ``child``.

    With ``PLANAR`` it is what the TurtleBot3's plugin calls odometry: not relative to where the base was spawned.
    """
    return Odometry(
        header=header,
        child_frame_id=child,
        pose=PoseWithCovariance(pose=pose_of(state), packed=pose_covariance),
        twist=TwistWithCovariance(twist=body_twist(state), packed=twist_covariance),
    )


def encoder_odometry(
    track: Track, header: Header, child: str, pose_covariance: Packed36 = PLANAR, twist_covariance: Packed36 = EXACT
) -> Odometry:
    """What the wheels tell, on a level ground."""
    return Odometry(
        header=header,
        child_frame_id=child,
        pose=PoseWithCovariance(pose=Pose.planar(track.x, track.y, track.heading), packed=pose_covariance),
        twist=TwistWithCovariance(twist=Twist.planar(track.v, track.w), packed=twist_covariance),
    )
