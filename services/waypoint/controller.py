"""The waypoint controller: the stop-and-turn control law and the tutorial's."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum, auto
from typing import NamedTuple

from messages.se2 import ZERO_TWIST, Pose2, Twist2, wrap
from services.driving.guidance import STANDSTILL, Segment, limit_slew, line_of_sight_heading, stopping_speed, turn_rate
from services.driving.plan import Goal, Plan, Progress, State
from services.waypoint import WaypointParameters

TUTORIAL_SWITCH_DISTANCE = 0.3
"""Distance [m] at which the tutorial switches to the next point."""
TUTORIAL_LINEAR_GAIN = 0.1
"""Speed per distance in the tutorial [1/s]."""
TUTORIAL_ANGULAR_GAIN = 0.7
"""Turn rate per heading error in the tutorial [1/s]."""


def tutorial_command(here: Pose2, x: float, y: float) -> Twist2:
    """Return the tutorial's command towards (x, y): v = 0.1 D, w = 0.7 e, for any heading and without limits.

    The original's eight-way case distinction is atan2, except that it keeps the last bearing exactly on the point.
    """
    dx, dy = x - here.x, y - here.y
    return Twist2(
        TUTORIAL_LINEAR_GAIN * math.hypot(dx, dy), TUTORIAL_ANGULAR_GAIN * wrap(math.atan2(dy, dx) - here.yaw)
    )


ALIGNED = 0.02
"""Heading error [rad] below which the robot starts to drive; at 0.22 m/s and 0.2 s of lag, this is 1 mm of offset."""
REALIGN_ERROR = 0.6
"""Heading error [rad] above which a driving robot stops and turns."""
REJOIN_DISTANCE = 0.1
"""Offset [m] from the segment beyond which a robot that was pushed or moved plans a new one from where it is."""
STOP_DISTANCE = 0.001
"""Remaining distance [m] at which the robot stops; its approach speed there is 5 mm/s."""
MAX_START_TURN_RATE = 0.05
"""Measured turn rate [rad/s] below which an aligned robot starts to drive."""


class Phase(Enum):
    """Phases of driving to one goal."""

    TURN = auto()
    DRIVE = auto()
    SETTLE = auto()
    ALIGN = auto()
    DONE = auto()


class GoalState(NamedTuple):
    """State of driving to one goal: the segment, the phase, and the last command, which limits the next."""

    goal: Goal
    segment: Segment
    phase: Phase = Phase.TURN
    command: Twist2 = ZERO_TWIST


def start_goal(goal: Goal, here: Pose2, previous: Goal | None, command: Twist2 = ZERO_TWIST) -> GoalState:
    """Start driving to ``goal``: on the segment from ``previous`` if the robot is near it, else straight from here."""
    if previous is not None:
        segment = Segment(previous.x, previous.y, goal.x, goal.y)
        if segment.length > REJOIN_DISTANCE and math.hypot(here.x - previous.x, here.y - previous.y) < REJOIN_DISTANCE:
            return GoalState(goal, segment, command=command)
    return GoalState(goal, Segment(here.x, here.y, goal.x, goal.y), command=command)


def step_goal(state: GoalState, here: Pose2, velocity: Twist2, p: WaypointParameters, dt: float) -> GoalState:
    """Return the next state and command from the pose, the measured velocity and the time step [s]."""
    state = _next_phase(state, here, velocity, p)
    target = _target_command(state, here, p)
    command = limit_slew(state.command, target, p.acceleration * dt, p.deceleration * dt, p.angular_acceleration * dt)
    return state._replace(command=command)


def _next_phase(state: GoalState, here: Pose2, velocity: Twist2, p: WaypointParameters) -> GoalState:
    away = state.segment.distance_to_end(here)
    standing = abs(velocity.v) < STANDSTILL.v and abs(velocity.w) < STANDSTILL.w
    match state.phase:
        case Phase.TURN if away <= p.tolerance:
            return state._replace(phase=Phase.SETTLE)
        case Phase.TURN if abs(_heading_error(state, here, p)) < ALIGNED and abs(velocity.w) < MAX_START_TURN_RATE:
            return state._replace(phase=Phase.DRIVE)
        case Phase.DRIVE:
            remaining, offset = state.segment.remaining_and_offset(here)
            if remaining <= STOP_DISTANCE:
                return state._replace(phase=Phase.SETTLE)
            if abs(offset) > REJOIN_DISTANCE:
                return start_goal(state.goal, here, None, state.command)
            if abs(_heading_error(state, here, p)) > REALIGN_ERROR:
                return state._replace(phase=Phase.TURN)
        case Phase.SETTLE if standing and away > p.tolerance:
            return start_goal(state.goal, here, None, state.command)
        case Phase.SETTLE if standing:
            return state._replace(phase=Phase.DONE if state.goal.yaw is None else Phase.ALIGN)
        case Phase.ALIGN if standing and abs(_heading_error(state, here, p)) < p.heading_tolerance:
            return state._replace(phase=Phase.DONE)
    return state


def _target_command(state: GoalState, here: Pose2, p: WaypointParameters) -> Twist2:
    if state.phase in (Phase.SETTLE, Phase.DONE):
        return ZERO_TWIST
    error = _heading_error(state, here, p)
    w = turn_rate(error, p.max_angular, p.angular_acceleration, p.lag)
    if state.phase is not Phase.DRIVE:
        return Twist2(0.0, w)
    remaining, _ = state.segment.remaining_and_offset(here)
    return Twist2(stopping_speed(remaining, p.max_linear, p.deceleration, p.lag) * max(0.0, math.cos(error)), w)


def _heading_error(state: GoalState, here: Pose2, p: WaypointParameters) -> float:
    """Return the heading error [rad].

    A lookahead below 4 lag v makes the offset oscillate: s^2 lag + s + v / lookahead = 0.
    """
    if state.phase is Phase.ALIGN and state.goal.yaw is not None:
        return wrap(state.goal.yaw - here.yaw)
    return wrap(line_of_sight_heading(state.segment, here, max(p.lookahead, 4 * p.lag * p.max_linear)) - here.yaw)


def plan_of(p: WaypointParameters) -> Plan:
    """Return the plan of the parameters."""
    return Plan.through(p.goals, p.laps, p.final_yaw)


class WaypointController:
    """Drives along a plan by the selected control law."""

    def __init__(self, parameters: WaypointParameters) -> None:
        self._params = parameters
        self.plan = plan_of(parameters)
        self._index = 0
        self._done = False
        self._goal_state: GoalState | None = None
        self._command = ZERO_TWIST

    def set_plan(self, plan: Plan) -> None:
        """Replace the plan; the command continues from its current value, so that the robot does not jerk."""
        self.plan, self._index, self._done = plan, 0, False
        self._goal_state = None

    def reconfigure(self, parameters: WaypointParameters) -> None:
        """Change the parameters but keep the plan; the command continues from its current value."""
        if parameters.law != self._params.law:
            self._goal_state = None
        self._params = parameters

    def step(self, here: Pose2, velocity: Twist2, dt: float) -> Progress:
        """Run one control tick.

        Args:
            here: Measured pose.
            velocity: Measured velocity.
            dt: Time since the last tick [s].
        """
        if not self.plan.goals:
            return Progress("idle", None)
        if self._done:
            return self._finish(here)
        return (
            self._step_tutorial(here)
            if self._params.law == "tutorial"
            else self._step_stop_and_turn(here, velocity, dt)
        )

    def hold(self) -> Progress:
        """Stand still while there is no odometry; afterwards, continue from where the robot is."""
        self._command, self._goal_state = ZERO_TWIST, None
        if not self.plan.goals:
            return Progress("idle", None)
        return Progress("waiting", ZERO_TWIST, self._index, len(self.plan.goals), self.plan.goals[self._index])

    def _step_stop_and_turn(self, here: Pose2, velocity: Twist2, dt: float) -> Progress:
        if self._goal_state is not None and self._goal_state.phase is Phase.DONE and not self._advance():
            return self._finish(here)
        if self._goal_state is None:
            self._goal_state = start_goal(self._goal, here, self.plan.previous_goal(self._index), self._command)
        self._goal_state = step_goal(self._goal_state, here, velocity, self._params, dt)
        self._command = self._goal_state.command
        return self._progress("reached" if self._goal_state.phase is Phase.DONE else "driving", here)

    def _step_tutorial(self, here: Pose2) -> Progress:
        """Run the tutorial's law. As in the original, the command of the switching tick is still for the old point."""
        self._command = tutorial_command(here, self._goal.x, self._goal.y)
        if self._distance(here) >= TUTORIAL_SWITCH_DISTANCE:
            return self._progress("driving", here)
        reached = self._progress("reached", here)
        return reached if self._advance() else replace(reached, command=ZERO_TWIST)

    @property
    def _goal(self) -> Goal:
        return self.plan.goals[self._index]

    def _advance(self) -> bool:
        following = self.plan.next_index(self._index)
        self._done = following is None
        self._index = self._index if following is None else following
        self._goal_state = None
        return not self._done

    def _finish(self, here: Pose2) -> Progress:
        self._command = ZERO_TWIST
        return self._progress("finished", here)

    def _distance(self, here: Pose2) -> float:
        return math.hypot(self._goal.x - here.x, self._goal.y - here.y)

    def _progress(self, state: State, here: Pose2) -> Progress:
        return Progress(state, self._command, self._index, len(self.plan.goals), self._goal, self._distance(here))
