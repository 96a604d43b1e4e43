"""A kinematic simulation of many burgers with a local planner each; commands act one tick late.

Laser detections of other robots are computed from their positions, with noise but without casting rays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.se2 import Pose2, Twist2
from services.local_planner import LocalPlannerParameters
from services.local_planner.controller import LocalPlanner
from services.local_planner.detection import NOTHING, Detections
from services.local_planner.tracking import Tracker

Floats = NDArray[np.float64]
Point = tuple[float, float]

TICK_NS, SCAN_TICKS = 100_000_000, 2
TICK_S = TICK_NS / 1e9
BODY = 0.11
"""Radius [m] of the circle around a burger's laser head that its body fills."""
HEAD, LASER = -0.017, -0.032
"""Positions [m] of laser head and ray origin ahead of the axle."""
NOISE = 0.005
"""Noise [m] of a detected centre: that of a ray is 0.01, and several rays hit a head."""


class Outcome(NamedTuple):
    """Simulation time at the end [s], robots at their goals, and the smallest free distance between two bodies [m]."""

    seconds: float
    arrived: int
    nearest: float


def drive(starts: Sequence[Point], goals: Sequence[Point], seed: int, limit: float) -> Outcome:
    """Drive all robots until each is at its goal, or until ``limit`` [s]; return the outcome."""
    random, count = np.random.default_rng(seed), len(starts)
    place, yaw = np.array(starts, float), random.uniform(-math.pi, math.pi, count)
    speeds, late, commands = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    params = [LocalPlannerParameters(goals=(goal,)) for goal in goals]
    planners = [LocalPlanner(p, f"/{seed}/{number}") for number, p in enumerate(params)]
    trackers = [Tracker() for _ in planners]
    nearest, tick, finished = math.inf, 0, [False] * count
    while not all(finished) and tick * TICK_S < limit:
        heads = place + HEAD * np.column_stack((np.cos(yaw), np.sin(yaw)))
        apart = np.hypot(*(heads[:, None] - heads[None]).transpose(2, 0, 1))
        np.fill_diagonal(apart, math.inf)
        nearest = min(nearest, float(apart.min()) - 2 * BODY)
        now = tick * TICK_NS
        for number, (planner, tracker) in enumerate(zip(planners, trackers, strict=True)):
            if finished[number]:
                continue  # its last command, to stop, stays in effect
            here = Pose2(float(place[number, 0]), float(place[number, 1]), float(yaw[number]))
            if tick % SCAN_TICKS == 0:
                laser = here @ Pose2(LASER)
                tracker.update(now, laser, _scan(laser, heads[apart[number] < params[number].view], random))
            progress = planner.step(here, Twist2(*speeds[number].tolist()), tracker.obstacles(now), TICK_S)
            finished[number] = progress.state == "finished"
            assert progress.command is not None
            commands[number] = progress.command
        speeds, late = late, commands.copy()  # the previous tick's command acts now
        middle = yaw + speeds[:, 1] * TICK_S / 2
        place = place + TICK_S * speeds[:, :1] * np.column_stack((np.cos(middle), np.sin(middle)))
        yaw = yaw + speeds[:, 1] * TICK_S
        tick += 1
    return Outcome(tick * TICK_S, sum(finished), nearest)


def _scan(laser: Pose2, heads: Floats, random: np.random.Generator) -> Detections:
    c, s = math.cos(laser.yaw), math.sin(laser.yaw)
    x, y = heads[:, 0] - laser.x, heads[:, 1] - laser.y
    discs = np.column_stack((c * x + s * y, c * y - s * x))
    return Detections(discs + random.normal(0.0, NOISE, discs.shape), NOTHING.points)
