"""The controller of the local planner: towards the goal, around others, with detours when there is no progress."""

from __future__ import annotations

import math
from random import Random

from messages.se2 import ZERO_TWIST, Pose2, Twist2, wrap
from services.driving.guidance import limit_slew, stopping_speed, turn_rate
from services.driving.plan import Goal, Plan, Progress, State
from services.local_planner import LocalPlannerParameters
from services.local_planner.avoidance import ZERO_VELOCITY, Velocity, choose_velocity, forward_limit
from services.local_planner.tracking import Obstacles

APPROACH_LAG_S = 0.2
"""Time constant of the approach to a goal and to a heading."""
PROGRESS = 0.1
"""Decrease of the distance to the goal [m] that counts as progress."""
DETOUR_ANGLES = -2.2, 0.5
"""Range of a detour's direction relative to the goal's [rad], drawn uniformly: most are to the right."""
DETOUR_TIMES = 2.0, 4.0
"""Range of a detour's duration [s], drawn uniformly."""


def plan_of(p: LocalPlannerParameters) -> Plan:
    """Return the plan of the parameters."""
    return Plan.through(p.goals, p.laps, p.final_yaw)


class Detour:
    """Rotates the direction to the goal for a while if a robot has made no progress for longer than its patience.

    Robots that block each other stay stuck only until one of them changes direction. Each draws its own detours
    repeatedly, independently of the others: a jam that some choice of directions dissolves persists with probability 0.
    The draws depend only on ``seed``, so that a run is repeatable.
    """

    def __init__(self, seed: str) -> None:
        self._random = Random(seed)
        self.angle = 0.0
        self._left = 0.0
        self._idle = 0.0
        self._nearest = math.inf

    def start(self) -> None:
        """Reset for another goal."""
        self.angle, self._left, self._idle, self._nearest = 0.0, 0.0, 0.0, math.inf

    def update(self, distance: float, dt: float, patience: float) -> None:
        """Update with the distance to the goal [m] after ``dt`` [s]."""
        if self._left > 0:
            self._left -= dt
            if self._left <= 0:
                self.start()
            return
        self._idle += dt
        if distance < self._nearest - PROGRESS:
            self._nearest, self._idle = distance, 0.0
        if self._idle > patience:
            self.angle, self._left = self._random.uniform(*DETOUR_ANGLES), self._random.uniform(*DETOUR_TIMES)


class LocalPlanner:
    """Drives along a plan among obstacles. ``seed`` determines its detours, e.g. its name."""

    def __init__(self, parameters: LocalPlannerParameters, seed: str = "") -> None:
        self._params = parameters
        self.plan = plan_of(parameters)
        self._index = 0
        self._done = False
        self._command = ZERO_TWIST
        self._chosen = ZERO_VELOCITY
        self._detour = Detour(seed)

    def set_plan(self, plan: Plan) -> None:
        """Replace the plan; the command continues from its current value, so that the robot does not jerk."""
        self.plan, self._index, self._done = plan, 0, False
        self._detour.start()

    def reconfigure(self, parameters: LocalPlannerParameters) -> None:
        """Change the parameters but keep the plan."""
        self._params = parameters

    def hold(self) -> Progress:
        """Stand still while there is no odometry or no scan; afterwards, continue from where the robot is."""
        self._command, self._chosen = ZERO_TWIST, ZERO_VELOCITY
        if not self.plan.goals:
            return Progress("idle", None)
        return Progress("waiting", ZERO_TWIST, self._index, len(self.plan.goals), self._goal)

    def step(self, here: Pose2, moving: Twist2, around: Obstacles, dt: float) -> Progress:
        """Run one control tick.

        Args:
            here: Present pose of the axle's centre.
            moving: Measured velocity.
            around: The present obstacles.
            dt: Time since the last tick [s].
        """
        if not self.plan.goals:
            return Progress("idle", None)
        if self._done:
            self._command = ZERO_TWIST
            return self._progress("finished", here)
        if self._reached(here):
            progress = self._progress("reached", here)
            self._advance()
            return progress
        p, goal = self._params, self._goal
        distance = self._distance(here)
        if distance <= p.tolerance and goal.yaw is not None:
            self._chosen = ZERO_VELOCITY
            target = Twist2(0.0, self._turn(wrap(goal.yaw - here.yaw)))
        else:
            self._detour.update(distance, dt, p.patience)
            target = self._drive(here, moving, around, distance)
        self._command = limit_slew(
            self._command, target, p.acceleration * dt, p.deceleration * dt, p.angular_acceleration * dt
        )
        return self._progress("driving", here)

    def _drive(self, here: Pose2, moving: Twist2, around: Obstacles, distance: float) -> Twist2:
        p, goal = self._params, self._goal
        speed = stopping_speed(distance, p.max_linear, p.deceleration, APPROACH_LAG_S)
        course = math.atan2(goal.y - here.y, goal.x - here.x) + self._detour.angle
        towards = Velocity(speed * math.cos(course), speed * math.sin(course))
        velocity = Velocity(moving.v * math.cos(here.yaw), moving.v * math.sin(here.yaw))
        self._chosen = choose_velocity(towards, velocity, self._chosen, here, around, p)
        error = wrap(math.atan2(self._chosen.y, self._chosen.x) - here.yaw)
        ahead = max(0.0, math.cos(error)) ** 3  # with a heading error, turn rather than drive
        return Twist2(min(math.hypot(*self._chosen) * ahead, forward_limit(here, around, p)), self._turn(error))

    def _turn(self, error: float) -> float:
        p = self._params
        return turn_rate(error, p.max_angular, p.angular_acceleration, APPROACH_LAG_S)

    def _reached(self, here: Pose2) -> bool:
        p, goal = self._params, self._goal
        if self._distance(here) > p.tolerance:
            return False
        return goal.yaw is None or abs(wrap(goal.yaw - here.yaw)) <= p.heading_tolerance

    def _advance(self) -> None:
        following = self.plan.next_index(self._index)
        self._done = following is None
        self._index = self._index if following is None else following
        self._detour.start()

    @property
    def _goal(self) -> Goal:
        return self.plan.goals[self._index]

    def _distance(self, here: Pose2) -> float:
        return math.hypot(self._goal.x - here.x, self._goal.y - here.y)

    def _progress(self, state: State, here: Pose2) -> Progress:
        return Progress(state, self._command, self._index, len(self.plan.goals), self._goal, self._distance(here))
