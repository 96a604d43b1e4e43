"""What came from one robot since the last batch, as columns ready to be recorded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from messages.control import JointControllerState
from messages.elea import GoalStatus
from messages.geometry import Twist
from messages.nav import Odometry, Path
from messages.sensor import JointState, LaserScan
from services.logger.alignment import Alignment
from services.logger.batch import Batch
from services.logger.buffer import LIMIT, Buffer
from services.logger.course import Course
from services.logger.fixed import lies_in_world
from services.logger.scans import Scans
from services.logger.trail import Trail
from services.runtime.frames.buffer import FrameBuffer

BENEATH = -0.001
"""Height of the trail by odometry, m: as long as it agrees with the true one, it lies hidden under it."""

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class RobotColumns:
    """Takes one robot's messages and gives batches; ``clear`` at a reset.

    ``frames`` is what ``/tf_static`` tells, kept by who made it. An odometry whose frame it does not know is laid over
    the first true pose.
    """

    def __init__(self, limit: int = LIMIT, frames: FrameBuffer | None = None) -> None:
        self._frames = frames or FrameBuffer()
        self._scans = Scans(self._frames)
        self._truth, self._odometry, self._commands = Buffer(9, limit), Buffer(5, limit), Buffer(2, limit)
        self._limit = limit
        self._joint_names: tuple[str, ...] = ()
        self._joints, self._control = Buffer(1, limit), Buffer(5, limit)
        self.clear()

    def clear(self) -> None:
        """Forget everything but the count of dropped rows."""
        for buffer in self._buffers:
            buffer.take()
        self._scans.clear()
        self._last_truth: Floats = np.empty((0, 9))
        self._last_command = np.nan
        self._trail, self._belief = Trail(), Trail()
        self._base = self._odometry_frame = ""
        self._alignment: Alignment | None = None
        self._plan: Path | None = None
        self._course: Course | None = None
        self._turns: list[tuple[int, int, bool]] = []
        self._heading: tuple[int, bool] | None = None

    @property
    def dropped(self) -> int:
        """Rows lost because more came than the buffers hold."""
        return sum(each.dropped for each in self._buffers) + self._scans.dropped

    @property
    def _buffers(self) -> tuple[Buffer, ...]:
        return self._truth, self._odometry, self._commands, self._joints, self._control

    def add_truth(self, messages: Sequence[Odometry]) -> None:
        """Ground truth: pose in the world, speed in the body."""
        rows = []
        for m in messages:
            stamp, p, q = m.header.stamp, m.pose.pose.position, m.pose.pose.orientation
            speed = m.twist.twist.linear.x
            rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, p.x, p.y, p.z, q.x, q.y, q.z, q.w, speed))
            self._base = m.child_frame_id
        self._truth.extend(rows)

    def add_odometry(self, messages: Sequence[Odometry]) -> None:
        """What the robot itself believes."""
        rows = []
        for m in messages:
            stamp, p, q = m.header.stamp, m.pose.pose.position, m.pose.pose.orientation
            rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, p.x, p.y, q.z, q.w))
            self._odometry_frame = m.header.frame_id
        self._odometry.extend(rows)

    def add_commands(self, messages: Sequence[Twist], now: int, dt: float) -> None:
        """Commands of the ``dt`` [s] before ``now`` [ns]; they bear no stamp and are spread over it evenly."""
        step = dt * 1e9 / max(1, len(messages))
        first = now - step * (len(messages) - 1)
        self._commands.extend([(first + step * i, m.linear.x) for i, m in enumerate(messages)])

    def add_joints(self, messages: Sequence[JointState]) -> None:
        """Joint angles. The first message fixes which joints; others are not recorded."""
        if messages and not self._joint_names:
            self._joint_names = messages[0].name
            self._joints = Buffer(1 + len(self._joint_names), self._limit)
        rows: list[tuple[float, ...]] = []
        for m in messages:
            if m.name == self._joint_names and len(m.position) == len(m.name):
                stamp = m.header.stamp
                rows.append((stamp.sec * 1_000_000_000 + stamp.nanosec, *m.position))
        self._joints.extend(rows)

    def add_scans(self, messages: Sequence[LaserScan]) -> None:
        """What the laser saw."""
        self._scans.add(messages)

    def add_control(self, messages: Sequence[JointControllerState]) -> None:
        """What the controller of the robot's joint wants, sees and does."""
        self._control.extend([(m.header.stamp.ns, m.set_point, m.process_value, m.error, m.command) for m in messages])

    def add_plan(self, plan: Path) -> None:
        """The goals from now on; the same goals again change nothing, unless time has begun anew."""
        known = self._plan
        later = known is not None and known.header.stamp.ns <= plan.header.stamp.ns
        same = known is not None and _goals(known).tolist() == _goals(plan).tolist()
        if plan.poses and not (later and same):
            self._plan, self._course, self._turns, self._heading = plan, None, [], None

    def add_status(self, status: GoalStatus) -> None:
        """Which goal the robot heads for."""
        if status.count:
            self._turns.append((status.header.stamp.ns, status.index, status.state in ("driving", "reached")))

    def flush(self) -> Batch:
        """Everything since the last call, as columns."""
        truth, joints, control = self._truth.take(), self._joints.take(), self._control.take()
        times = _stamps(truth)
        known = np.vstack((self._last_truth, truth))
        odometry_times, odometry_error, believed = self._compare(known, self._odometry.take())
        belief_times, belief = self._belief.extend(odometry_times, believed)
        scan_times, scans = self._scans.place(self._base, known)
        plan = self._begin_course(known)
        goal_times, goals = self._head()
        cross_track = distance = np.full(len(truth), np.nan)
        if self._course is not None:
            cross_track, distance = self._course.errors(times, truth[:, 1:3])
        trail_times, trail = self._trail.extend(times, truth[:, 1:4])
        if len(truth):
            self._last_truth = truth[-1:]
            if self._course is not None:
                self._course.forget(int(times[-1]))
        return Batch(
            times=times,
            positions=truth[:, 1:4],
            quaternions=truth[:, 4:8],
            gauges=np.column_stack((truth[:, 8], self._hold_commands(times), cross_track, distance)),
            odometry_times=odometry_times,
            odometry_error=odometry_error,
            trail_times=trail_times,
            trail=trail,
            joints=self._joint_names,
            joint_times=_stamps(joints),
            angles=joints[:, 1:],
            control_times=_stamps(control),
            control=control[:, 1:],
            belief_times=belief_times,
            belief=belief,
            goal_times=goal_times,
            goals=goals,
            scan_times=scan_times,
            scans=scans,
            plan_time=self._plan.header.stamp.ns if self._plan else 0,
            plan=plan,
        )

    def _compare(self, truth: Floats, odometry: Floats) -> tuple[Stamps, Floats, Floats]:
        """Odometry's distance from the truth and its positions (n, 3) in the world, where both are known.

        Newer odometry waits for its truth.
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
        told = lies_in_world(self._frames, self._odometry_frame) if self._odometry_frame else None
        if told is not None:
            self._alignment = told
        elif self._alignment is None:
            nearest = truth[np.argmin(np.abs(truth[:, 0] - met[0, 0]))]
            self._alignment = Alignment.of(
                (float(x[0]), float(y[0]), _yaw(nearest[4:8])), (met[0, 1], met[0, 2], _yaw((0.0, 0.0, *met[0, 3:5])))
            )
        believed = self._alignment.apply(met[:, 1:3])
        off = np.hypot(believed[:, 0] - x, believed[:, 1] - y)[:, None]
        return _stamps(met), off, np.column_stack((believed, np.full(len(met), BENEATH)))

    def _begin_course(self, truth: Floats) -> Floats | None:
        """The reference path (p, 3), once a new plan and the place where it began are both known in the world."""
        begun = None
        if self._plan is not None and self._course is None and len(truth):
            here = lies_in_world(self._frames, self._plan.header.frame_id) or self._alignment
            if here is not None:
                since = self._plan.header.stamp.ns
                start = truth[min(int(np.searchsorted(truth[:, 0], since)), len(truth) - 1), 1:3]
                self._course = Course(since, start, here.apply(_goals(self._plan)))
                begun = np.column_stack((self._course.points, np.zeros(len(self._course.points))))
        return begun

    def _head(self) -> tuple[Stamps, Floats]:
        """Follow the robot from goal to goal: times (g,) and the goals (g, 3) that it heads for from then on."""
        times, goals = [], []
        if self._course is not None:
            for time, index, under_way in self._turns:
                self._course.head_for(time, index)
                if self._heading != (index, under_way):
                    self._heading = index, under_way
                    times.append(time)
                    goals.append((*self._course.goal(index), 0.0) if under_way else (np.nan, np.nan, np.nan))
            self._turns = []
        return np.array(times, np.int64), np.array(goals, np.float64).reshape(-1, 3)

    def _hold_commands(self, times: Stamps) -> Floats:
        """The command in force at each time; NaN before the first."""
        commands = self._commands.take()
        values = np.concatenate(([self._last_command], commands[:, 1]))
        self._last_command = values[-1]
        held: Floats = values[np.searchsorted(commands[:, 0], times, side="right")]
        return held


def _stamps(rows: Floats) -> Stamps:
    return rows[:, 0].astype(np.int64)


def _goals(plan: Path) -> Floats:
    return np.array([(each.pose.position.x, each.pose.position.y) for each in plan.poses]).reshape(-1, 2)


def _yaw(q: Sequence[float] | Floats) -> float:
    x, y, z, w = (float(each) for each in q)
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
