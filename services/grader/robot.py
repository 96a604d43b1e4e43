"""Metrics of one robot: cross-track error, progress along the plan, odometry error and stops."""

from __future__ import annotations

import math

from messages.elea import BaseStatus, GoalStatus
from messages.geometry import Pose
from messages.nav import Odometry, Path
from messages.se2 import IDENTITY, Pose2, wrap
from services.grader import BrakingSpec
from services.grader.clearance import Clearance
from services.grader.corners import CornerMetrics
from services.grader.records import RobotFigures
from services.grader.stops import StopMetrics
from services.grader.trajectory import Fingerprint, Trail

Point = tuple[float, float]


def segment_distance(a: Point, b: Point, x: float, y: float) -> float:
    """Return the distance [m] of (x, y) to the segment from ``a`` to ``b``, beyond its ends to the nearer end."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    dx, dy = x - a[0], y - a[1]
    square = ux * ux + uy * uy
    share = max(0.0, min(1.0, (dx * ux + dy * uy) / square)) if square > 0 else 0.0
    return math.hypot(dx - share * ux, dy - share * uy)


class ReferencePath:
    """The path through ``corners``, the start and the goals [m]; segment k leads from corner k to goal k."""

    def __init__(self, start: Point, goals: tuple[Point, ...]) -> None:
        self.goals = goals
        self.corners: tuple[Point, ...] = (start, *goals)

    def cross_track(self, index: int, x: float, y: float) -> float:
        """Return the distance [m] of a robot on its way to goal ``index`` from the path.

        Only the segment to that goal and the previous one count, whichever is nearer: cutting a corner is measured
        against the corner, and a crossing with a later segment hides nothing.
        """
        here = segment_distance(self.corners[index], self.corners[index + 1], x, y)
        if index == 0:
            return here
        return min(here, segment_distance(self.corners[index - 1], self.corners[index], x, y))


class PlanProgress:
    """Progress of a robot along its plan, and its distance from the reference path.

    The robot's status contains its current goal; a robot without a status is assumed to drive to its goals in order. A
    goal counts as reached when ground truth comes within ``tolerance`` [m] of it.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._goals: tuple[Point, ...] = ()
        self._position: Point | None = None
        self._index = 0
        self._has_status = False
        self._squares, self._count = 0.0, 0
        self.reference_path: ReferencePath | None = None
        self.reached_at: list[float | None] = []
        self.closest_distances: list[float] = []
        self.max_cross_track = 0.0
        self.finished_at: float | None = None

    @property
    def rms_cross_track(self) -> float | None:
        """Root mean square of the cross-track error [m] over the plan; None before its start."""
        return math.sqrt(self._squares / self._count) if self._count else None

    def set_plan(self, goals: tuple[Point, ...]) -> None:
        """Set a plan, which starts at the robot's position; the same one again, after a restart, has no effect."""
        if goals == self._goals:
            return
        self._goals, self._index, self.finished_at = goals, 0, None
        self.reached_at, self.closest_distances = [None] * len(goals), [math.inf] * len(goals)
        self.reference_path = ReferencePath(self._position, goals) if self._position and goals else None

    def add_status(self, status: GoalStatus) -> None:
        """Process the robot's current goal, or its report that it has finished."""
        self._has_status = True
        self._index = min(status.index, max(0, len(self._goals) - 1))
        finished = status.state == "finished"
        self.finished_at = (self.finished_at or status.header.stamp.ns / 1e9) if finished else None

    def add_position(self, time: float, here: Point) -> float:
        """Add the true position ``here`` [m] at ``time`` [s]; return the cross-track error [m], nan without a plan."""
        self._position = here
        if self.reference_path is None:
            if not self._goals:
                return math.nan
            self.reference_path = ReferencePath(here, self._goals)
        index = self._index
        off = self.reference_path.cross_track(index, *here)
        if self.finished_at is None:
            self._squares, self._count = self._squares + off * off, self._count + 1
            self.max_cross_track = max(self.max_cross_track, off)
        self._check_reached(index, time, math.hypot(here[0] - self._goals[index][0], here[1] - self._goals[index][1]))
        return off

    def _check_reached(self, index: int, time: float, distance: float) -> None:
        self.closest_distances[index] = min(self.closest_distances[index], distance)
        if distance > self._tolerance:
            return
        if self.reached_at[index] is None:
            self.reached_at[index] = time
        if self._has_status:
            return
        if index + 1 < len(self._goals):
            self._index = index + 1
        elif self.finished_at is None:
            self.finished_at = time


UNKNOWN_POSE = Pose2(math.nan, math.nan, math.nan)


class OdometryError:
    """Compares odometry with ground truth, after aligning the two frames at the first samples with the same stamp.

    World odometry is aligned already; wheel odometry starts wherever it was reset. Distances in m, headings in rad.
    """

    def __init__(self) -> None:
        self.max_distance: float | None = None
        self.last_distance: float | None = None
        self.max_heading: float | None = None
        self.last_heading: float | None = None
        self._sample: Odometry | None = None
        self._odom_to_world: Pose2 | None = None

    @property
    def odom_to_world(self) -> Pose2:
        """The pose of the odometry frame in the world; the identity until odometry arrives."""
        return self._odom_to_world or IDENTITY

    def add_odometry(self, sample: Odometry) -> None:
        """Set the odometry sample for the ground truth with the same stamp."""
        self._sample = sample

    def compare(self, stamp: int, truth: Pose) -> Pose2:
        """Return the pose by odometry at ``stamp`` [ns] in the world frame; UNKNOWN_POSE without a sample."""
        if self._sample is None or self._sample.header.stamp.ns != stamp:
            return UNKNOWN_POSE
        here, there = Pose2.from_msg(self._sample.pose.pose), Pose2.from_msg(truth)
        if self._odom_to_world is None:
            self._odom_to_world = Pose2.aligning(there, here)
        world = self._odom_to_world @ here
        self.last_distance = math.hypot(world.x - there.x, world.y - there.y)
        self.max_distance = max(self.max_distance or 0.0, self.last_distance)
        self.last_heading = abs(wrap(world.yaw - there.yaw))
        self.max_heading = max(self.max_heading or 0.0, self.last_heading)
        return world


class RobotMeter:
    """Metrics of one robot so far. ``braking`` is how its base brakes, if known.

    Plan and status wait for the next ground truth, since transforming a plan from the odom to the world frame requires
    it.
    """

    def __init__(self, reach_tolerance: float, braking: BrakingSpec | None = None) -> None:
        self.fingerprint, self.trail = Fingerprint(), Trail()
        self.progress, self.corner_metrics = PlanProgress(reach_tolerance), CornerMetrics()
        self.stops = StopMetrics(braking)
        self.min_distance = math.inf
        self.odometry_error = OdometryError()
        self._base: BaseStatus | None = None
        self._pending: list[Path | GoalStatus] = []
        self._samples = 0
        self._length = 0.0
        self._last: Point | None = None

    @property
    def finished_at(self) -> float | None:
        """Time [s] at which the robot finished its plan; None before."""
        return self.progress.finished_at

    def add_message(self, message: Path | GoalStatus) -> None:
        """Add a plan or a status."""
        self._pending.append(message)

    def add_base_status(self, status: BaseStatus) -> None:
        """Set the state of the base, whose counts start at spawning or at the last reset of time."""
        self._base = status
        self.stops.add_status(status)

    def add_truth(self, sample: Odometry) -> Point:
        """Add a ground-truth sample; return the robot's position [m]."""
        stamp, pose = sample.header.stamp.ns, sample.pose.pose
        there = Pose2.from_msg(pose)
        here = there.x, there.y
        self.fingerprint.add(stamp, pose)
        self._samples += 1
        if self._last is not None:
            self._length += math.hypot(here[0] - self._last[0], here[1] - self._last[1])
        self._last = here
        odom = self.odometry_error.compare(stamp, pose)
        self._process_pending()
        off = self.progress.add_position(stamp / 1e9, here)
        self.corner_metrics.add_poses(stamp / 1e9, there, odom)
        velocity = sample.twist.twist.linear
        speed = math.hypot(velocity.x, velocity.y)
        self.stops.add_sample(stamp, self._length, speed)
        self.trail.add((stamp / 1e9, *here, there.yaw, odom.x, odom.y, off, speed))
        return here

    def result(self, messages_lost: int, clearance: Clearance | None = None) -> RobotFigures:
        """Return all figures so far; ``clearance`` is the smallest from the world's bodies, if measured."""
        progress, odometry_error, base = self.progress, self.odometry_error, self._base
        closure, stop = self.corner_metrics.closure, self.stops.longest
        return RobotFigures(
            points=len(progress.reached_at),
            points_reached=sum(at is not None for at in progress.reached_at),
            points_reached_at=tuple(progress.reached_at),
            points_closest_m=tuple(None if math.isinf(each) else each for each in progress.closest_distances),
            cross_track_rms_m=progress.rms_cross_track,
            cross_track_max_m=progress.max_cross_track if progress.rms_cross_track is not None else None,
            odometry_error_max_m=odometry_error.max_distance,
            odometry_error_final_m=odometry_error.last_distance,
            odometry_heading_error_max_deg=_degrees(odometry_error.max_heading),
            odometry_heading_error_final_deg=_degrees(odometry_error.last_heading),
            corners=tuple(self.corner_metrics.corners),
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
            min_distance_m=None if math.isinf(self.min_distance) else self.min_distance,
            min_clearance_m=clearance.distance if clearance else None,
            min_clearance_at_s=clearance.at if clearance else None,
            min_clearance_to=clearance.body if clearance else None,
            collisions=base.collisions if base else None,
            commands_timed_out=base.commands_timed_out if base else None,
            stale_dropped=base.stale_dropped if base else None,
            commands_refused=base.refused if base else None,
            messages_lost=messages_lost,
            samples=self._samples,
        )

    def _process_pending(self) -> None:
        for message in self._pending:
            match message:
                case Path(header=header, poses=poses):
                    frame = IDENTITY if header.frame_id in ("", "world") else self.odometry_error.odom_to_world
                    goals: tuple[Pose2, ...] = tuple(frame @ Pose2.from_msg(each.pose) for each in poses)
                    self.progress.set_plan(tuple((each.x, each.y) for each in goals))
                    self.corner_metrics.set_plan(goals)
                case GoalStatus():
                    self.progress.add_status(message)
                    self.corner_metrics.add_status(message)
        self._pending = []


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
