"""A run for tests: robots drive through their points on ideal bases, with all the messages that the grader reads."""

from __future__ import annotations

from collections.abc import Iterator

from messages.elea import BaseStatus
from messages.geometry import Pose, PoseWithCovariance, Twist, TwistWithCovariance
from messages.nav import Odometry
from messages.se2 import Pose2
from messages.std import Header, Time
from services.driving.plan import path_message, status_message
from services.grader.measurement import GradedMessage, Measurement, MessageKind
from services.waypoint import WaypointParameters
from services.waypoint.controller import WaypointController
from tests.services.waypoint.ideal_base import drive

Points = tuple[tuple[float, float], ...]
GradedEntry = tuple[MessageKind, str, GradedMessage]

CORNERS: Points = ((0.6, 0.0), (0.6, 0.4), (0.0, 0.0))
TOLERANCE = 0.05


def header(seconds: float, frame: str = "world") -> Header:
    return Header(stamp=Time.of(round(seconds * 1e9)), frame_id=frame)


def odometry_sample(seconds: float, x: float, y: float, yaw: float = 0.0, v: float = 0.0) -> Odometry:
    return Odometry(
        header=header(seconds),
        pose=PoseWithCovariance(pose=Pose.planar(x, y, yaw)),
        twist=TwistWithCovariance(twist=Twist.planar(v, 0.0)),
    )


def robot_messages(name: str, shift: float, points: Points = CORNERS, drift: float = 0.0) -> Iterator[GradedEntry]:
    """Yield the messages of one robot that starts at (0, ``shift``) [m]; its odometry drifts by ``drift`` [m/s]."""
    pilot = WaypointController(WaypointParameters(goals=tuple((x, y + shift) for x, y in points)))
    yield MessageKind.PLAN, name, path_message(pilot.plan, header(0))
    shown = None
    for now in drive(pilot, Pose2(0, shift, 1.57), 400):
        yield (
            MessageKind.ODOMETRY,
            name,
            odometry_sample(now.time, now.pose.x + drift * now.time, now.pose.y, now.pose.yaw),
        )
        yield MessageKind.TRUTH, name, odometry_sample(now.time, now.pose.x, now.pose.y, now.pose.yaw, now.velocity.v)
        if (now.progress.state, now.progress.index) != shown:
            shown = now.progress.state, now.progress.index
            yield MessageKind.STATUS, name, status_message(now.progress, header(now.time))
    yield MessageKind.BASE, name, BaseStatus(header=header(1), commands=10)


def measure_all(posts: list[GradedEntry], names: tuple[str, ...], end: float = 400.0) -> Measurement:
    """Measure all messages at once, up to ``end`` [s]."""
    run = Measurement(names, TOLERANCE)
    for kind, name, message in posts:
        run.add_messages(kind, name, [message])
    run.advance(round(end * 1e9))
    return run
