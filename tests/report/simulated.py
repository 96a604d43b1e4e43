"""A run for tests: robots drive their points on ideal bases, and every message that the grader takes is made of it."""

from __future__ import annotations

from collections.abc import Iterator

from messages.elea import BaseStatus
from messages.geometry import Pose, PoseWithCovariance, Twist, TwistWithCovariance
from messages.nav import Odometry
from messages.std import Header, Time
from services.grader.measure import Judged, Kind, Run
from services.motion.planar import Planar
from services.waypoint import WaypointParameters
from services.waypoint.loop import path, status
from services.waypoint.pilot import Pilot
from tests.unit_waypoint.ideal_base import drive

Points = tuple[tuple[float, float], ...]
Post = tuple[Kind, str, Judged]

CORNERS: Points = ((0.6, 0.0), (0.6, 0.4), (0.0, 0.0))
TOLERANCE = 0.05


def header(seconds: float, frame: str = "world") -> Header:
    return Header(stamp=Time.of(round(seconds * 1e9)), frame_id=frame)


def sample(seconds: float, x: float, y: float, yaw: float = 0.0, v: float = 0.0) -> Odometry:
    return Odometry(
        header=header(seconds),
        pose=PoseWithCovariance(pose=Pose.planar(x, y, yaw)),
        twist=TwistWithCovariance(twist=Twist.planar(v, 0.0)),
    )


def robot(name: str, shift: float, points: Points = CORNERS, drift: float = 0.0) -> Iterator[Post]:
    """The messages of one robot, which starts at (0, ``shift``) m; its odometry grows wrong by ``drift`` m/s."""
    pilot = Pilot(WaypointParameters(goals=tuple((x, y + shift) for x, y in points)))
    yield Kind.PLAN, name, path(pilot.plan, header(0))
    shown = None
    for now in drive(pilot, Planar(0, shift, 1.57), 400):
        yield Kind.ODOMETRY, name, sample(now.time, now.here.x + drift * now.time, now.here.y, now.here.yaw)
        yield Kind.TRUTH, name, sample(now.time, now.here.x, now.here.y, now.here.yaw, now.moving.v)
        if (now.progress.state, now.progress.index) != shown:
            shown = now.progress.state, now.progress.index
            yield Kind.STATUS, name, status(now.progress, header(now.time))
    yield Kind.BASE, name, BaseStatus(header=header(1), commands=10)


def judged(posts: list[Post], names: tuple[str, ...], end: float = 400.0) -> Run:
    """All messages measured at once, up to ``end`` [s]."""
    run = Run(names, TOLERANCE)
    for kind, name, message in posts:
        run.take(kind, name, [message])
    run.advance(round(end * 1e9))
    return run
