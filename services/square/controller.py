"""The square controller: latches the start and drives the robot around by one of the control laws."""

from __future__ import annotations

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from services.square import SquareParameters, profile, tutorial
from services.square.corners import Square, StepResult


class SquareController:
    """A pose goes in, a step result comes out. ``square`` is None until the first pose: the square begins there."""

    def __init__(self, parameters: SquareParameters) -> None:
        self._params = parameters
        self.square: Square | None = None
        self._profile_state: profile.ProfileState | None = None
        self._tutorial_state: tutorial.TutorialState | None = None
        self._held = False
        self._last = StepResult("waiting", ZERO_TWIST, 0, Pose2(0.0, 0.0), "waiting")

    def reconfigure(self, parameters: SquareParameters) -> None:
        """Drive on by other parameters around the same square."""
        self._params = parameters

    def step(self, time: int, here: Pose2, moving: Twist2, dt: float) -> StepResult:
        """One tick at ``time`` [ns]: the robot is ``here``, moves at ``moving``; the last tick was ``dt`` [s] ago."""
        if self.square is None:
            self.square = Square(here, self._params.side, self._params.count)
            if self._params.law == "tutorial":
                self._tutorial_state = tutorial.TutorialState.at_start(self.square)
            else:
                self._profile_state = profile.ProfileState(self.square)
        if self._tutorial_state is not None:
            self._tutorial_state, self._last = tutorial.step(self._tutorial_state, time, here, moving, self._params)
        elif self._profile_state is not None:
            course = profile.resume(self._profile_state, here) if self._held else self._profile_state
            self._profile_state, self._last = profile.step(course, here, moving, self._params, dt)
        self._held = False
        return self._last

    def hold(self) -> StepResult:
        """Stand still for want of odometry; the way goes on from where the robot is afterwards."""
        self._held = True
        return StepResult("waiting", ZERO_TWIST, self._last.index, self._last.desired, "waiting")
