"""One robot's messages since the last batch, as numpy columns ready to be recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from messages.control import JointControllerState
from messages.elea import GoalStatus
from messages.geometry import Quaternion, Twist
from messages.nav import Odometry, Path
from messages.se2 import Pose2
from messages.sensor import JointState, LaserScan
from services.logger.reference_path import ReferencePath
from services.logger.scans import ScanBuffer
from services.logger.static_frames import world_transform
from services.markers.footprint import transform_points
from services.runtime.tf.buffer import TransformBuffer

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """One robot's columns. Times are simulation time [ns]; positions [m] are in the world frame.

    Attributes:
        positions: (n, 3) at ``times`` (n,), as are ``quaternions`` and ``scalars``.
        quaternions: (n, 4) as x, y, z, w.
        scalars: (n, 4) speed and command [m/s], cross-track error and distance to the goal [m]; NaN if unknown.
        odometry_error: (k, 1) [m] at ``odometry_times``.
        trail: Segments (m, 2, 3) at ``trail_times``; ``odometry_trail`` (b, 2, 3) are those of the odometry.
        angles: (j, joints) [rad] at ``joint_times``.
        control: (c, 4) at ``control_times``: a joint controller's set-point, angle, error [deg] and effort [N m].
        plan: (p, 3) a new reference path from ``plan_time`` on.
        goals: (g, 3) the current goal from each of ``goal_times`` on, NaN for none.
        scans: For each of ``scan_times``, the echoes (e, 3) of the laser.
    """

    times: Stamps
    positions: Floats
    quaternions: Floats
    scalars: Floats
    odometry_times: Stamps
    odometry_error: Floats
    trail_times: Stamps
    trail: Floats
    joints: tuple[str, ...]
    joint_times: Stamps
    angles: Floats
    control_times: Stamps
    control: Floats
    odometry_trail_times: Stamps
    odometry_trail: Floats
    plan_time: int
    plan: Floats | None
    goal_times: Stamps
    goals: Floats
    scan_times: Stamps
    scans: list[Floats]


MAX_ROWS = 20_000
"""Maximum number of rows kept between two batches: more than six minutes of a 50 Hz topic."""


class RowBuffer:
    """Collects rows of ``width`` numbers, the first of which is a time [ns]; beyond ``limit``, the oldest are dropped.

    Times are stored as doubles: exact below 104 days.
    """

    def __init__(self, width: int, limit: int = MAX_ROWS) -> None:
        self.width, self.limit = width, limit
        self.dropped = 0
        self._rows: list[tuple[float, ...]] = []

    def extend(self, rows: Sequence[tuple[float, ...]]) -> None:
        """Add rows, newest last."""
        self._rows += rows
        excess = len(self._rows) - self.limit
        if excess > 0:
            del self._rows[:excess]
            self.dropped += excess

    def drain(self) -> NDArray[np.float64]:
        """Return all rows as an array of shape (n, width), and empty the buffer."""
        rows, self._rows = self._rows, []
        return np.array(rows, dtype=np.float64).reshape(-1, self.width)


SPACING = 0.02
"""Distance between a trail's corners [m]: finer than displayed, with a tenth of a slow robot's rows."""


class Trail:
    """Thins out a path incrementally; the last corner connects one batch to the next."""

    def __init__(self, spacing: float = SPACING) -> None:
        self.spacing = spacing
        self._corner: Floats | None = None

    def extend(self, times: Stamps, positions: Floats) -> tuple[Stamps, Floats]:
        """Return the segments (m, 2, 3) [m] that positions (n, 3) at ``times`` (n,) [ns] add, and end times (m,)."""
        if not len(positions):
            return times, np.empty((0, 2, 3))
        corner = positions[0] if self._corner is None else self._corner
        steps = np.diff(np.vstack((corner, positions)), axis=0)
        covered = np.floor(np.cumsum(np.linalg.norm(steps, axis=1)) / self.spacing)
        new = np.flatnonzero(np.diff(covered, prepend=0.0) > 0)
        corners = np.vstack((corner, positions[new]))
        self._corner = corners[-1]
        return times[new], np.stack((corners[:-1], corners[1:]), axis=1)


ODOMETRY_TRAIL_Z = -0.001
"""Height of the odometry trail [m]: it is hidden below the true one while the two agree."""


class RobotColumns:
    """Collects one robot's messages into batches; call ``clear`` at a reset.

    ``frames`` holds the transforms of ``/tf_static`` and is updated by its owner. Odometry in a frame that is not among
    them is aligned with the first true pose.
    """

    def __init__(self, limit: int = MAX_ROWS, frames: TransformBuffer | None = None) -> None:
        self._frames = frames or TransformBuffer()
        self._scans = ScanBuffer(self._frames)
        self._truth, self._odometry, self._commands = RowBuffer(9, limit), RowBuffer(5, limit), RowBuffer(2, limit)
        self._limit = limit
        self._joint_names: tuple[str, ...] = ()
        self._joints, self._control = RowBuffer(1, limit), RowBuffer(5, limit)
        self.clear()

    def clear(self) -> None:
        """Reset everything except the count of dropped rows."""
        for buffer in self._buffers:
            buffer.drain()
        self._scans.clear()
        self._last_truth: Floats = np.empty((0, 9))
        self._last_command = np.nan
        self._trail, self._odometry_trail = Trail(), Trail()
        self._base = self._odometry_frame = ""
        self._alignment: Pose2 | None = None
        self._plan: Path | None = None
        self._reference: ReferencePath | None = None
        self._goal_changes: list[tuple[int, int, bool]] = []
        self._current_goal: tuple[int, bool] | None = None

    @property
    def dropped(self) -> int:
        """Rows lost because the buffers were full."""
        return sum(each.dropped for each in self._buffers) + self._scans.dropped

    @property
    def _buffers(self) -> tuple[RowBuffer, ...]:
        return self._truth, self._odometry, self._commands, self._joints, self._control

    def add_truth(self, messages: Sequence[Odometry]) -> None:
        """Add ground truth: pose in the world, speed in the body."""
        rows = []
        for m in messages:
            stamp, p, q = m.header.stamp, m.pose.pose.position, m.pose.pose.orientation
            speed = m.twist.twist.linear.x
            rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, p.x, p.y, p.z, q.x, q.y, q.z, q.w, speed))
            self._base = m.child_frame_id
        self._truth.extend(rows)

    def add_odometry(self, messages: Sequence[Odometry]) -> None:
        """Add the robot's odometry."""
        rows = []
        for m in messages:
            stamp, p, q = m.header.stamp, m.pose.pose.position, m.pose.pose.orientation
            rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, p.x, p.y, q.z, q.w))
            self._odometry_frame = m.header.frame_id
        self._odometry.extend(rows)

    def add_commands(self, messages: Sequence[Twist], now: int, dt: float) -> None:
        """Add commands received in the ``dt`` [s] before ``now`` [ns]; having no stamps, they are spread evenly."""
        step = dt * 1e9 / max(1, len(messages))
        first = now - step * (len(messages) - 1)
        self._commands.extend([(first + step * i, m.linear.x) for i, m in enumerate(messages)])

    def add_joints(self, messages: Sequence[JointState]) -> None:
        """Add joint angles. The first message determines the joints; messages with other joints are ignored."""
        if messages and not self._joint_names:
            self._joint_names = messages[0].name
            self._joints = RowBuffer(1 + len(self._joint_names), self._limit)
        rows: list[tuple[float, ...]] = []
        for m in messages:
            if m.name == self._joint_names and len(m.position) == len(m.name):
                stamp = m.header.stamp
                rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, *m.position))
        self._joints.extend(rows)

    def add_scans(self, messages: Sequence[LaserScan]) -> None:
        """Add laser scans."""
        self._scans.add(messages)

    def add_control(self, messages: Sequence[JointControllerState]) -> None:
        """Add the states of the robot's joint controller."""
        self._control.extend([(m.header.stamp.ns, m.set_point, m.process_value, m.error, m.command) for m in messages])

    def add_plan(self, plan: Path) -> None:
        """Set the goals from now on; setting the same goals again has no effect, except after a reset."""
        known = self._plan
        later = known is not None and known.header.stamp.ns <= plan.header.stamp.ns
        same = known is not None and _goals(known).tolist() == _goals(plan).tolist()
        if plan.poses and not (later and same):
            self._plan, self._reference, self._goal_changes, self._current_goal = plan, None, [], None

    def add_status(self, status: GoalStatus) -> None:
        """Add the robot's current goal."""
        if status.count:
            self._goal_changes.append((status.header.stamp.ns, status.index, status.state in ("driving", "reached")))

    def flush(self) -> Batch:
        """Return the columns of everything since the last call."""
        truth, joints, control = self._truth.drain(), self._joints.drain(), self._control.drain()
        times = _stamps(truth)
        known = np.vstack((self._last_truth, truth))
        odometry_times, odometry_error, odometry_positions = self._compare(known, self._odometry.drain())
        odometry_trail_times, odometry_trail = self._odometry_trail.extend(odometry_times, odometry_positions)
        scan_times, scans = self._scans.to_world(self._base, known)
        plan = self._start_reference(known)
        goal_times, goals = self._drain_goals()
        cross_track = distance = np.full(len(truth), np.nan)
        if self._reference is not None:
            cross_track, distance = self._reference.errors(times, truth[:, 1:3])
        trail_times, trail = self._trail.extend(times, truth[:, 1:4])
        if len(truth):
            self._last_truth = truth[-1:]
            if self._reference is not None:
                self._reference.trim(int(times[-1]))
        return Batch(
            times=times,
            positions=truth[:, 1:4],
            quaternions=truth[:, 4:8],
            scalars=np.column_stack((truth[:, 8], self._hold_commands(times), cross_track, distance)),
            odometry_times=odometry_times,
            odometry_error=odometry_error,
            trail_times=trail_times,
            trail=trail,
            joints=self._joint_names,
            joint_times=_stamps(joints),
            angles=joints[:, 1:],
            control_times=_stamps(control),
            control=control[:, 1:],
            odometry_trail_times=odometry_trail_times,
            odometry_trail=odometry_trail,
            goal_times=goal_times,
            goals=goals,
            scan_times=scan_times,
            scans=scans,
            plan_time=self._plan.header.stamp.ns if self._plan else 0,
            plan=plan,
        )

    def _compare(self, truth: Floats, odometry: Floats) -> tuple[Stamps, Floats, Floats]:
        """Return times, errors (n, 1) and positions (n, 3) in the world of the odometry whose true pose is known.

        Newer odometry is kept until its true pose arrives.
        """
        if not len(truth):
            self._odometry.extend([tuple(row) for row in odometry.tolist()])
            return _stamps(odometry[:0]), odometry[:0, :1], odometry[:0, :3]
        newer = odometry[:, 0] > truth[-1, 0]
        self._odometry.extend([tuple(row) for row in odometry[newer].tolist()])
        met = odometry[~newer & (odometry[:, 0] >= truth[0, 0])]
        if not len(met):
            return _stamps(met), met[:, :1], met[:, :3]
        x, y = (np.interp(met[:, 0], truth[:, 0], truth[:, column]) for column in (1, 2))
        alignment = world_transform(self._frames, self._odometry_frame) if self._odometry_frame else None
        if alignment is not None:
            self._alignment = alignment
        elif self._alignment is None:
            nearest = truth[np.argmin(np.abs(truth[:, 0] - met[0, 0]))]
            _, odometry_x, odometry_y, odometry_z, odometry_w = met[0].tolist()
            self._alignment = Pose2.aligning(
                Pose2(float(x[0]), float(y[0]), _yaw(*nearest[4:8].tolist())),
                Pose2(odometry_x, odometry_y, _yaw(0.0, 0.0, odometry_z, odometry_w)),
            )
        odometry_positions = transform_points(self._alignment, met[:, 1:3])
        off = np.hypot(odometry_positions[:, 0] - x, odometry_positions[:, 1] - y)[:, None]
        return _stamps(met), off, np.column_stack((odometry_positions, np.full(len(met), ODOMETRY_TRAIL_Z)))

    def _start_reference(self, truth: Floats) -> Floats | None:
        """Return the reference path (p, 3) once a new plan and the robot's start are known in the world; else None."""
        begun = None
        if self._plan is not None and self._reference is None and len(truth):
            here = world_transform(self._frames, self._plan.header.frame_id) or self._alignment
            if here is not None:
                since = self._plan.header.stamp.ns
                start = truth[min(int(np.searchsorted(truth[:, 0], since)), len(truth) - 1), 1:3]
                self._reference = ReferencePath(since, start, transform_points(here, _goals(self._plan)))
                begun = np.column_stack((self._reference.points, np.zeros(len(self._reference.points))))
        return begun

    def _drain_goals(self) -> tuple[Stamps, Floats]:
        """Return the goal changes since the last call: times (g,) and the goals (g, 3) from then on."""
        times, goals = [], []
        if self._reference is not None:
            for time, index, under_way in self._goal_changes:
                self._reference.set_goal(time, index)
                if self._current_goal != (index, under_way):
                    self._current_goal = index, under_way
                    times.append(time)
                    goals.append((*self._reference.goal(index), 0.0) if under_way else (np.nan, np.nan, np.nan))
            self._goal_changes = []
        return np.array(times, np.int64), np.array(goals, np.float64).reshape(-1, 3)

    def _hold_commands(self, times: Stamps) -> Floats:
        """Return the latest command at each time; NaN before the first."""
        commands = self._commands.drain()
        values = np.concatenate(([self._last_command], commands[:, 1]))
        self._last_command = values[-1]
        held: Floats = values[np.searchsorted(commands[:, 0], times, side="right")]
        return held


def _stamps(rows: Floats) -> Stamps:
    return rows[:, 0].astype(np.int64)


def _goals(plan: Path) -> Floats:
    return np.array([(each.pose.position.x, each.pose.position.y) for each in plan.poses]).reshape(-1, 2)


def _yaw(x: float, y: float, z: float, w: float) -> float:
    return Quaternion(x=x, y=y, z=z, w=w).yaw
