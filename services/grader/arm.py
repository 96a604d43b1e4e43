"""The meter of one arm: joint states are its truth, the states of its controller say what was wanted."""

from __future__ import annotations

import math

from messages.control import JointControllerState
from messages.sensor import JointState
from services.grader import Arm
from services.grader.exercise import Exercise
from services.grader.records import ArmFigures
from services.grader.trajectory import Fingerprint, Trail

STILL = 0.1
"""deg/s; an arm that is slower rests."""
RESTED_S = 1.0
"""An arm whose set-point and itself have rested for so long has finished."""


class ArmMeter:
    """Figures of one arm so far; ``arm`` is what is known of it at present."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.fingerprint, self.trail, self.exercise = Fingerprint(), Trail(), Exercise()
        self.finished_at: float | None = None
        self._joint: tuple[float, float] | None = None
        self._samples = self._ticks = 0
        self._last: float | None = None
        self._controlled = self._saturated_s = self._gap = self._effort = self._squares = 0.0

    def joints(self, state: JointState) -> None:
        """Take joint states; those without the arm's joint are of another robot."""
        if self.arm.joint not in state.name or not state.position:
            return
        index = state.name.index(self.arm.joint)
        rate = state.velocity[index] if state.velocity else 0.0
        self.fingerprint.add_joint(state.header.stamp.ns, state.position[index], rate)
        self._joint = math.degrees(state.position[index]), math.degrees(rate)
        self._samples += 1

    def control(self, state: JointControllerState) -> None:
        """Take one tick of the controller, after the joint states of its time."""
        if self._joint is None:
            return
        time, (angle, rate) = state.header.stamp.ns / 1e9, self._joint
        if self._last is not None:
            passed = time - self._last
            self._gap = max(self._gap, passed)
            self._controlled += passed
            self._saturated_s += passed if abs(state.command) >= self.arm.saturation else 0.0
        self._last = time
        self._ticks += 1
        self._effort = max(self._effort, abs(state.command))
        self._squares += state.command * state.command
        self.exercise.at(time, state.set_point, angle)
        rests = self.exercise.rests(time) >= RESTED_S and abs(rate) < STILL
        if not rests or self.finished_at is None:
            self.trail.add((time, state.set_point, angle, state.set_point - angle, state.command))
        self.finished_at = (self.finished_at or time) if rests else None

    def figures(self, messages_lost: int) -> ArmFigures:
        """All figures so far."""
        steps, step, tracking = self.exercise.steps, self.exercise.largest, self.exercise.tracking
        moved = tracking.rms is not None
        return ArmFigures(
            steps=steps,
            step_final_deg=step.final_deg if step else None,
            step_rise_s=step.rise_s if step else None,
            step_overshoot_percent=step.overshoot_percent if step else None,
            step_settling_s=step.settling_s if step else None,
            step_steady_error_deg=step.steady_error_deg if step else None,
            tracking_rms_deg=tracking.rms,
            tracking_max_deg=tracking.largest if moved else None,
            effort_max_nm=self._effort if self._ticks else None,
            effort_rms_nm=math.sqrt(self._squares / self._ticks) if self._ticks else None,
            saturated_s=self._saturated_s,
            saturated_share=self._saturated_s / self._controlled if self._controlled else 0.0,
            control_gap_s=self._gap if self._ticks else None,
            time_s=self.finished_at,
            messages_lost=messages_lost,
            samples=self._samples,
        )
