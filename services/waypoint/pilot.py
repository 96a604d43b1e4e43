"""The pilot: takes a robot through its plan by one of the laws; a pose goes in, a command and the progress come out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from services.motion.planar import STILL, Motion, Planar
from services.waypoint import WaypointParameters
from services.waypoint.law import SEED_SWITCH, seed
from services.waypoint.plan import ORIGIN, Goal, Plan
from services.waypoint.steady import Approach, Stage, begin, step

State = Literal["idle", "driving", "reached", "finished", "waiting"]


@dataclass(frozen=True, slots=True)
class Progress:
    """The outcome of one tick. ``command`` is None without a plan: an idle pilot leaves the base to others."""

    state: State
    command: Motion | None
    index: int = 0
    count: int = 0
    goal: Goal = ORIGIN
    distance: float = 0.0


class Pilot:
    """Holds the plan, the index of the present goal, and for the steady law the approach to it."""

    def __init__(self, parameters: WaypointParameters) -> None:
        self._p = parameters
        self.plan = Plan.of(parameters)
        self._index = 0
        self._done = False
        self._approach: Approach | None = None
        self._command = STILL

    def follow(self, plan: Plan) -> None:
        """Drop the present plan for another; the command goes on from where it is, so the robot does not jerk."""
        self.plan, self._index, self._done = plan, 0, False
        self._approach = None

    def retune(self, parameters: WaypointParameters) -> None:
        """Drive on by other parameters, on the same plan; the command goes on from where it is."""
        if parameters.law != self._p.law:
            self._approach = None
        self._p = parameters

    def step(self, here: Planar, moving: Motion, dt: float) -> Progress:
        """One control tick: the robot stands at ``here`` and moves at ``moving``; the last tick was ``dt`` [s] ago."""
        if not self.plan.goals:
            return Progress("idle", None)
        if self._done:
            return self._finish(here)
        return self._seed(here) if self._p.law == "seed" else self._steady(here, moving, dt)

    def wait(self) -> Progress:
        """Stand still for want of odometry; the way goes on from where the robot is afterwards."""
        self._command, self._approach = STILL, None
        if not self.plan.goals:
            return Progress("idle", None)
        return Progress("waiting", STILL, self._index, len(self.plan.goals), self.plan.goals[self._index])

    def _steady(self, here: Planar, moving: Motion, dt: float) -> Progress:
        if self._approach is not None and self._approach.stage is Stage.DONE and not self._advance():
            return self._finish(here)
        if self._approach is None:
            self._approach = begin(self._goal, here, self.plan.before(self._index), self._command)
        self._approach = step(self._approach, here, moving, self._p, dt)
        self._command = self._approach.command
        return self._progress("reached" if self._approach.stage is Stage.DONE else "driving", here)

    def _seed(self, here: Planar) -> Progress:
        """As in the original, the command of the tick at which it switches still belongs to the old point."""
        self._command = seed(here, self._goal.x, self._goal.y)
        if self._away(here) >= SEED_SWITCH:
            return self._progress("driving", here)
        reached = self._progress("reached", here)
        return reached if self._advance() else replace(reached, command=STILL)

    @property
    def _goal(self) -> Goal:
        return self.plan.goals[self._index]

    def _advance(self) -> bool:
        following = self.plan.after(self._index)
        self._done = following is None
        self._index = self._index if following is None else following
        self._approach = None
        return not self._done

    def _finish(self, here: Planar) -> Progress:
        self._command = STILL
        return self._progress("finished", here)

    def _away(self, here: Planar) -> float:
        return math.hypot(self._goal.x - here.x, self._goal.y - here.y)

    def _progress(self, state: State, here: Planar) -> Progress:
        return Progress(state, self._command, self._index, len(self.plan.goals), self._goal, self._away(here))
