"""The tutorial's control law for the square, which repeats its loop step by step, and a prediction of its result.

It acts at 10 Hz on unsynchronised odometry at 10 Hz: the pose is up to 0.1 s old. It turns at full speed until the
error is below 0.05 rad and then considers the turn done, though the base needs another w^2 / (2 a) = 0.07 rad to stop.
The next side starts from the pose at that moment, and the next turn from the heading at its own start, so that the
errors add up in one direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from messages.se2 import ZERO_TWIST, Pose2, Twist2, wrap
from services.driving.guidance import STANDSTILL
from services.runtime.step import STEP_NS, STEP_S
from services.square import SERVICE, SquareParameters
from services.square.corners import Square, State, StepResult

PERIOD_NS = 100_000_000
"""Period of its loop and of its odometry [ns]."""
ANGLE_THRESHOLD = 0.05
"""Heading error [rad] below which it considers a turn done."""
DISTANCE_THRESHOLD = 0.05
"""Distance [m] before the end of a side at which it stops driving."""


@dataclass(frozen=True, slots=True)
class TutorialState:
    """The variables of the tutorial's script.

    ``last_odometry`` is its last sampled pose; ``sample_index`` and ``action_index`` count periods of simulation time.
    """

    square: Square
    side_start: Pose2
    last_odometry: Pose2
    rotating: bool = False
    sides_done: int = 0
    target_heading: float = 0.0
    command: Twist2 = ZERO_TWIST
    sample_index: int = -1
    action_index: int = -1
    finished: bool = False

    @classmethod
    def at_start(cls, square: Square) -> TutorialState:
        """Return the initial state. The tutorial starts at (0, 0, 0); here, it is the robot's pose."""
        return cls(square, square.start, square.start)


def step(
    state: TutorialState, time: int, here: Pose2, velocity: Twist2, p: SquareParameters
) -> tuple[TutorialState, StepResult]:
    """Return the state and result at ``time`` [ns]; between two periods of the loop, the result has no command."""
    if (sampled := time // PERIOD_NS) != state.sample_index:
        state = replace(state, last_odometry=here, sample_index=sampled)
    acted = (time - round(p.phase * 1e9)) // PERIOD_NS
    if acted == state.action_index:
        return state, StepResult(
            "finished" if state.finished else "driving", None, _index(state), _desired(state, p), _phase(state)
        )
    state = replace(state, action_index=acted)
    if state.sides_done == state.square.corner_count:
        standing = abs(velocity.v) <= STANDSTILL.v and abs(velocity.w) <= STANDSTILL.w
        state = replace(state, command=ZERO_TWIST, finished=state.finished or standing)
        progress: State = "finished" if state.finished else "driving"
        return state, StepResult(progress, ZERO_TWIST, _index(state), _desired(state, p), _phase(state))
    before = state.sides_done
    state = _act(state, p)
    reached = state.sides_done > before
    progress = "reached" if reached else "driving"
    return state, StepResult(
        progress,
        state.command,
        state.sides_done - 1 if reached else state.sides_done,
        _desired(state, p),
        _phase(state),
    )


def _act(state: TutorialState, p: SquareParameters) -> TutorialState:
    """Run the tutorial's loop once."""
    seen = state.last_odometry
    if not state.rotating:
        if math.hypot(seen.x - state.side_start.x, seen.y - state.side_start.y) < p.side - DISTANCE_THRESHOLD:
            return replace(state, command=Twist2(p.linear_speed, 0.0))
        return replace(
            state, command=ZERO_TWIST, rotating=True, side_start=seen, target_heading=wrap(seen.yaw + math.pi / 2)
        )
    error = wrap(state.target_heading - seen.yaw)
    if abs(error) > ANGLE_THRESHOLD:
        return replace(state, command=Twist2(0.0, math.copysign(p.angular_speed, error)))
    return replace(state, command=ZERO_TWIST, rotating=False, sides_done=state.sides_done + 1, side_start=seen)


def _desired(state: TutorialState, p: SquareParameters) -> Pose2:
    """Return the desired pose as the tutorial logs it: the end of the side, or the target heading while turning."""
    if state.rotating:
        return Pose2(state.last_odometry.x, state.last_odometry.y, state.target_heading)
    yaw = state.side_start.yaw
    return Pose2(
        state.side_start.x + p.side * math.cos(yaw),
        state.side_start.y + p.side * math.sin(yaw),
        state.last_odometry.yaw,
    )


def _index(state: TutorialState) -> int:
    return state.sides_done - 1 if state.sides_done == state.square.corner_count else state.sides_done


def _phase(state: TutorialState) -> str:
    if state.sides_done == state.square.corner_count:
        return "done"
    return "ROTATE" if state.rotating else "MOVE_FORWARD"


MAX_DURATION_S = 3600.0

BaseStep = Callable[[Twist2], Twist2]
"""Model of a base: from the command to the velocity during one physics step, after all limits."""


class Prediction(NamedTuple):
    """Predicted end of a square: distance from the start [m], and excess turn [rad], not wrapped."""

    closure: float
    excess_turn: float


def predict(p: SquareParameters, base: BaseStep) -> Prediction | None:
    """Predict where the squares (one if endless) end by the tutorial's law; None if not within MAX_DURATION_S.

    The base moves along the mean heading of each step; a command acts from the next step on.
    """
    assert SERVICE.rate is not None
    tick = round(1 / SERVICE.rate / STEP_S)
    rounds = p.count or 1
    loop = TutorialState.at_start(Square(Pose2(0.0, 0.0), p.side, rounds))
    here, velocity, command = Pose2(0.0, 0.0), ZERO_TWIST, ZERO_TWIST
    for number in range(round(MAX_DURATION_S / STEP_S)):
        if number % tick == 0:
            loop, result = step(loop, number * STEP_NS, here, velocity, p)
            command = result.command or command
            if result.state == "finished":
                return Prediction(math.hypot(here.x, here.y), here.yaw - rounds * math.tau)
        velocity = base(command)
        middle, ahead = here.yaw + velocity.w * STEP_S / 2, velocity.v * STEP_S
        here = Pose2(
            here.x + ahead * math.cos(middle), here.y + ahead * math.sin(middle), here.yaw + velocity.w * STEP_S
        )
    return None


def overrun(base: BaseStep, w: float) -> float:
    """Return the angle [rad] that a base turning at ``w`` [rad/s] continues to turn after the command to stop."""
    for _ in range(round(60 / STEP_S)):
        base(Twist2(0.0, w))
    angle = 0.0
    while (velocity := base(ZERO_TWIST)).w:
        angle += velocity.w * STEP_S
    return angle
