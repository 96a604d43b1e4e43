"""Where a base is: its true motion, or what its wheels tell."""

from __future__ import annotations

import math
from typing import NamedTuple

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
from services.sim.rotation import into_body
from services.sim.world import BodyState

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


def world_odometry(state: BodyState, header: Header, child: str, pose_covariance: Packed36 = EXACT) -> Odometry:
    """The true motion of a base: pose in the world, twist in the frame ``child``.

    With ``PLANAR`` it is what the TurtleBot3's plugin calls odometry: not relative to where the base was spawned.
    """
    return Odometry(
        header=header,
        child_frame_id=child,
        pose=PoseWithCovariance(pose=pose_of(state), packed=pose_covariance),
        twist=TwistWithCovariance(twist=body_twist(state), packed=EXACT),
    )


class Track(NamedTuple):
    """A pose found by counting wheel turns: x, y [m], heading [rad] without bounds; the speeds v [m/s] and w [rad/s] of
    the last interval; and the wheel angles [rad] where it ended."""

    x: float
    y: float
    heading: float
    v: float
    w: float
    left: float
    right: float


def start(left: float, right: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Track:
    """A track that begins at rest at the given pose, with the wheels at the angles ``left`` and ``right`` [rad]."""
    return Track(x, y, heading, 0.0, 0.0, left, right)


def roll(track: Track, left: float, right: float, dt: float, separation: float, radius: float) -> Track:
    """The track after the wheels turned on to the angles ``left`` and ``right`` [rad] in ``dt`` > 0 [s].

    Exact for constant speeds: the base moves along an arc of length l that turns by a, whose chord is
    l sin(a/2) / (a/2) long and points along heading + a/2.
    """
    went_left, went_right = (left - track.left) * radius, (right - track.right) * radius
    length, turn = (went_left + went_right) / 2, (went_right - went_left) / separation
    half = turn / 2
    chord = length * math.sin(half) / half if half else length
    course = track.heading + half
    return Track(
        track.x + chord * math.cos(course),
        track.y + chord * math.sin(course),
        track.heading + turn,
        length / dt,
        turn / dt,
        left,
        right,
    )


def encoder_odometry(track: Track, header: Header, child: str) -> Odometry:
    """What the wheels tell, on a level ground."""
    return Odometry(
        header=header,
        child_frame_id=child,
        pose=PoseWithCovariance(pose=Pose.planar(track.x, track.y, track.heading), packed=PLANAR),
        twist=TwistWithCovariance(twist=Twist.planar(track.v, track.w), packed=EXACT),
    )
