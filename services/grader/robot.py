"""The meter of one robot: it takes the robot's messages in the order of their stamps and keeps sums, not samples."""

from __future__ import annotations

import math

from messages.elea import BaseStatus, GoalStatus
from messages.nav import Odometry, Path
from services.grader import Halting
from services.grader.circuit import Circuit
from services.grader.drift import Drift, planar
from services.grader.progress import Progress
from services.grader.records import RobotFigures
from services.grader.reference import Point
from services.grader.stops import Stops
from services.grader.trajectory import Fingerprint, Trail
from services.motion.planar import HERE, Planar


class RobotMeter:
    """Figures of one robot so far. ``halting`` is what is known of its base's brake.

    Plan and status wait for the next ground truth: a plan in the frame of odometry is placed in the world by it.
    """

    def __init__(self, reach_tolerance: float, halting: Halting | None = None) -> None:
        self.fingerprint, self.trail = Fingerprint(), Trail()
        self.progress, self.circuit = Progress(reach_tolerance), Circuit()
        self.stops = Stops(halting)
        self.nearest = math.inf
        self.drift = Drift()
        self._base = BaseStatus()
        self._told: list[Path | GoalStatus] = []
        self._samples = 0
        self._length = 0.0
        self._last: Point | None = None

    @property
    def finished_at(self) -> float | None:
        """When the robot had finished its plan, s; None before."""
        return self.progress.finished_at

    def tell(self, message: Path | GoalStatus) -> None:
        """Take a plan or a status."""
        self._told.append(message)

    def base(self, status: BaseStatus) -> None:
        """Take the state of the base, whose counts grow from spawn on."""
        self._base = status
        self.stops.status(status)

    def truth(self, sample: Odometry) -> Point:
        """Take a ground-truth sample; returns where the robot is, m."""
        stamp, pose = sample.header.stamp.ns, sample.pose.pose
        there = planar(pose)
        here = there.x, there.y
        self.fingerprint.add(stamp, pose)
        self._samples += 1
        if self._last is not None:
            self._length += math.hypot(here[0] - self._last[0], here[1] - self._last[1])
        self._last = here
        odom = self.drift.compare(stamp, pose)
        self._pass_on()
        off = self.progress.at(stamp / 1e9, here)
        self.circuit.at(stamp / 1e9, there, odom)
        velocity = sample.twist.twist.linear
        speed = math.hypot(velocity.x, velocity.y)
        self.stops.at(stamp, self._length, speed)
        self.trail.add((stamp / 1e9, *here, there.yaw, odom.x, odom.y, off, speed))
        return here

    def figures(self, messages_lost: int) -> RobotFigures:
        """All figures so far."""
        progress, drift, base = self.progress, self.drift, self._base
        closure, stop = self.circuit.closure, self.stops.hardest
        return RobotFigures(
            points=len(progress.reached_at),
            points_reached=sum(at is not None for at in progress.reached_at),
            points_reached_at=tuple(progress.reached_at),
            points_closest_m=tuple(None if math.isinf(each) else each for each in progress.closest),
            cross_track_rms_m=progress.rms,
            cross_track_max_m=progress.largest if progress.rms is not None else None,
            odometry_error_max_m=drift.largest,
            odometry_error_final_m=drift.last,
            odometry_heading_error_max_deg=_degrees(drift.turned_most),
            odometry_heading_error_final_deg=_degrees(drift.turned),
            corners=tuple(self.circuit.corners),
            closure_m=closure.true_m,
            closure_heading_deg=closure.true_deg,
            closure_odometry_m=closure.odometry_m,
            closure_odometry_heading_deg=closure.odometry_deg,
            stops=self.stops.count,
            stop_speed=stop.speed,
            stop_time_s=stop.time,
            stop_distance_m=stop.distance,
            stop_time_theory_s=stop.theory_time,
            stop_distance_theory_m=stop.theory_distance,
            path_length_m=self._length,
            time_s=progress.finished_at,
            min_distance_m=None if math.isinf(self.nearest) else self.nearest,
            collisions=base.collisions,
            commands_timed_out=base.commands_timed_out,
            stale_dropped=base.stale_dropped,
            commands_refused=base.refused,
            messages_lost=messages_lost,
            samples=self._samples,
        )

    def _pass_on(self) -> None:
        for message in self._told:
            match message:
                case Path(header=header, poses=poses):
                    frame = HERE if header.frame_id in ("", "world") else self.drift.frame
                    goals: tuple[Planar, ...] = tuple(frame.apply(planar(each.pose)) for each in poses)
                    self.progress.plan(tuple((each.x, each.y) for each in goals))
                    self.circuit.plan(goals)
                case GoalStatus():
                    self.progress.status(message)
                    self.circuit.status(message)
        self._told = []


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
