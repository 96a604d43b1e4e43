"""What is recorded of one robot at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Batch:
    """One robot's columns. Times are simulation time [ns]; positions [m] lie in the world.

    At ``times`` (n,): ``positions`` (n, 3), ``quaternions`` (n, 4) as x, y, z, w, and ``gauges`` (n, 4), which are
    speed and command [m/s], cross-track error and distance to the goal [m]; NaN where there is nothing to tell.
    ``odometry_error`` (k, 1) [m] stands at ``odometry_times``, the segments ``trail`` (m, 2, 3) at ``trail_times``,
    those of where odometry believes the robot to be, ``belief`` (b, 2, 3), at ``belief_times``, ``angles`` (j, joints)
    [rad] at ``joint_times``, ``control`` (c, 4) at ``control_times``: what a joint's controller wants, sees, misses and
    does, deg, deg, deg, N m. ``plan`` (p, 3) is a new reference path, from ``plan_time`` on; ``goals`` (g, 3) tells
    from ``goal_times`` on where the robot heads for, NaN for nowhere. ``scans`` holds for each of ``scan_times`` the
    echoes (e, 3) of its laser.
    """

    times: Stamps
    positions: Floats
    quaternions: Floats
    gauges: Floats
    odometry_times: Stamps
    odometry_error: Floats
    trail_times: Stamps
    trail: Floats
    joints: tuple[str, ...]
    joint_times: Stamps
    angles: Floats
    control_times: Stamps
    control: Floats
    belief_times: Stamps
    belief: Floats
    plan_time: int
    plan: Floats | None
    goal_times: Stamps
    goals: Floats
    scan_times: Stamps
    scans: list[Floats]
