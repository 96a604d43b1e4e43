"""The meter of one robot: it takes the robot's messages in the order of their stamps and keeps sums, not samples."""

from __future__ import annotations

import math

from messages.elea import BaseStatus
from messages.nav import Odometry, Path
from services.grader.drift import Drift
from services.grader.progress import Progress
from services.grader.records import RobotFigures
from services.grader.reference import Point
from services.grader.trajectory import Fingerprint, Trail


class RobotMeter:
    """Figures of one robot so far. ``base`` is the last state of its base, whose counts grow from spawn on."""

    def __init__(self, reach_tolerance: float) -> None:
        self.fingerprint, self.trail = Fingerprint(), Trail()
        self.progress = Progress(reach_tolerance)
        self.nearest = math.inf
        self.drift = Drift()
        self.base = BaseStatus()
        self._samples = 0
        self._length = 0.0
        self._last: Point | None = None

    def truth(self, sample: Odometry) -> Point:
        """Take a ground-truth sample; returns where the robot is, m."""
        stamp, pose = sample.header.stamp.ns, sample.pose.pose
        here = pose.position.x, pose.position.y
        self.fingerprint.add(stamp, pose)
        self._samples += 1
        if self._last is not None:
            self._length += math.hypot(here[0] - self._last[0], here[1] - self._last[1])
        self._last = here
        off = self.progress.at(stamp / 1e9, here)
        odom = self.drift.compare(stamp, pose)
        velocity = sample.twist.twist.linear
        self.trail.add((stamp / 1e9, *here, pose.orientation.yaw, *odom, off, math.hypot(velocity.x, velocity.y)))
        return here

    def plan(self, path: Path) -> None:
        """Take a plan."""
        self.progress.plan(tuple((each.pose.position.x, each.pose.position.y) for each in path.poses))

    def figures(self, messages_lost: int) -> RobotFigures:
        """All figures so far."""
        progress, drift = self.progress, self.drift
        return RobotFigures(
            points=len(progress.reached_at),
            points_reached=sum(at is not None for at in progress.reached_at),
            points_reached_at=tuple(progress.reached_at),
            points_closest_m=tuple(None if math.isinf(each) else each for each in progress.closest),
            cross_track_rms_m=progress.rms,
            cross_track_max_m=progress.largest if progress.rms is not None else None,
            odometry_error_max_m=drift.largest,
            odometry_error_final_m=drift.last,
            path_length_m=self._length,
            time_s=progress.finished_at,
            min_distance_m=None if math.isinf(self.nearest) else self.nearest,
            collisions=self.base.collisions,
            commands_timed_out=self.base.commands_timed_out,
            stale_dropped=self.base.stale_dropped,
            commands_refused=self.base.refused,
            messages_lost=messages_lost,
            samples=self._samples,
        )
