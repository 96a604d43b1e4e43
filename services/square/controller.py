"""The square controller: latches the start pose and drives around the square by the selected control law."""

from __future__ import annotations

from messages.se2 import ZERO_TWIST, Pose2, Twist2
from services.square import SquareParameters, profile, tutorial
from services.square.corners import Square, StepResult


class SquareController:
    """Drives around a square that starts at the first pose; ``square`` is None until then."""

    def __init__(self, parameters: SquareParameters) -> None:
        self._params = parameters
        self.square: Square | None = None
        self._profile_state: profile.ProfileState | None = None
        self._tutorial_state: tutorial.TutorialState | None = None
        self._held = False
        self._last = StepResult("waiting", ZERO_TWIST, 0, Pose2(0.0, 0.0), "waiting")

    def reconfigure(self, parameters: SquareParameters) -> None:
        """Change the parameters but keep the square."""
        self._params = parameters

    def step(self, time: int, here: Pose2, velocity: Twist2, dt: float) -> StepResult:
        """Run one control tick.

        Args:
            time: Simulation time [ns].
            here: Measured pose.
            velocity: Measured velocity.
            dt: Time since the last tick [s].
        """
        if self.square is None:
            self.square = Square(here, self._params.side, self._params.count)
            if self._params.law == "tutorial":
                self._tutorial_state = tutorial.TutorialState.at_start(self.square)
            else:
                self._profile_state = profile.ProfileState(self.square)
        if self._tutorial_state is not None:
            self._tutorial_state, self._last = tutorial.step(self._tutorial_state, time, here, velocity, self._params)
        elif self._profile_state is not None:
            state = profile.resume(self._profile_state, here) if self._held else self._profile_state
            self._profile_state, self._last = profile.step(state, here, velocity, self._params, dt)
        self._held = False
        return self._last

    def hold(self) -> StepResult:
        """Stand still while there is no odometry; afterwards, continue from where the robot is."""
        self._held = True
        return StepResult("waiting", ZERO_TWIST, self._last.index, self._last.desired, "waiting")
