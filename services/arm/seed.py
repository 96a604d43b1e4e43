"""The seed's law, as the tutorial's node computes it, but on simulation time: for teaching, and to compare with.

The derivative is that of the error, so a step of the reference is a kick that only the saturation bounds. The guard
bounds the summed error, not its share of the effort: 20 deg s times 0.3 are 6 N m, less than the arm's weight. Changing
the controller changes the gains under the sums as they stand, which is a bump.
"""

from __future__ import annotations

from services.arm.gains import Gains


class SeedPid:
    """u = kp e + ki s + kd de/dt, within the saturation; s sums up e dt within the guard."""

    def __init__(self) -> None:
        self.summed = 0.0
        self._error: float | None = None

    def step(self, gains: Gains, guard: float, error: float, angle: float, dt: float) -> float:
        """The effort [N m] at an ``error`` [deg], ``dt`` [s] after the last; 0 when that is not known.

        ``guard`` [deg s]; ``angle`` [deg] is for the weight, which the tutorial does not feed forward.
        """
        slope = (error - self._error) / dt if self._error is not None and dt > 0 else 0.0
        self._error = error
        self.summed = max(-guard, min(guard, self.summed + error * dt))
        asked = gains.kp * error + gains.ki * self.summed + gains.kd * slope + gains.holding(angle)
        return max(-gains.saturation, min(gains.saturation, asked))
