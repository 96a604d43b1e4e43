"""Metrics of one arm: step responses, tracking error and effort."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from messages.control import JointControllerState
from messages.sensor import JointState
from services.grader import ArmSpec
from services.grader.records import ArmFigures, StepFigures
from services.grader.trajectory import Fingerprint, Trail

MAX_DURATION_S = 20.0
"""Longest measured duration [s] of a step response."""
MIN_DURATION_S = 1.0
"""Shortest time [s] of a constant set-point that counts as a step."""
FINAL_WINDOW_S = 0.5
"""Time [s] at the end over which the final angle is averaged."""
SETTLING_BAND = 0.02
"""Settling band relative to the step."""

Sample = tuple[float, float]


class StepResponse:
    """Measures the response to a step of the set-point from ``before`` to ``after`` [deg] at ``begin`` [s]."""

    def __init__(self, begin: float, before: float, after: float) -> None:
        self.start_time, self.before, self.after = begin, before, after
        self._samples: list[Sample] = []

    @property
    def size(self) -> float:
        """Size of the step [deg], without sign."""
        return abs(self.after - self.before)

    def add_sample(self, time: float, angle: float) -> None:
        """Add the true ``angle`` [deg] at ``time`` [s]."""
        if time - self.start_time <= MAX_DURATION_S:
            self._samples.append((time, angle))

    def result(self) -> StepFigures | None:
        """Return the figures; None if the step is too short, or if the arm did not move."""
        samples = self._samples
        if not samples or samples[-1][0] - self.start_time < MIN_DURATION_S:
            return None
        end = [angle for time, angle in samples if time > samples[-1][0] - FINAL_WINDOW_S]
        start, final = samples[0][1], sum(end) / len(end)
        way = final - start
        if abs(way) < 0.1 * self.size:
            return None
        shares = [(time, (angle - start) / way) for time, angle in samples]
        return StepFigures(
            at_s=self.start_time,
            from_deg=self.before,
            to_deg=self.after,
            final_deg=final,
            rise_s=_crossing_time(shares, 0.9) - _crossing_time(shares, 0.1),
            overshoot_percent=100.0 * max(0.0, max(share for _, share in shares) - 1.0),
            settling_s=_settling_time(shares) - self.start_time,
            steady_error_deg=abs(self.after - final),
        )


def _settling_time(shares: Sequence[Sample]) -> float:
    """Return the time at which the angle entered the band for good, interpolated linearly."""
    last = max(number for number, (_, share) in enumerate(shares) if abs(share - 1.0) > SETTLING_BAND)
    (t0, a), (t1, b) = shares[last], shares[min(last + 1, len(shares) - 1)]
    edge = 1.0 + math.copysign(SETTLING_BAND, a - 1.0)
    return t0 if a == b else min(t1, t0 + (t1 - t0) * (edge - a) / (b - a))


def _crossing_time(shares: Sequence[Sample], level: float) -> float:
    """Return the time of the first crossing of a level, interpolated linearly."""
    for (t0, a), (t1, b) in pairwise(shares):
        if a < level <= b:
            return t0 + (t1 - t0) * (level - a) / (b - a)
    return shares[-1][0]


SET_POINT_REST_S = 0.5
"""Time [s] without a change after which a set-point counts as resting."""
TRANSIENT_S = 1.0
"""Time [s] at the start of each motion that is excluded."""
MIN_STEP_DEG = 1.0
"""Smallest change [deg] of a resting set-point that counts as a step."""


class TrackingError:
    """Root mean square and maximum of the tracking error in motion.

    A set-point that arrives less often than the controller runs is a staircase, which nothing can follow exactly: the
    error is averaged over the ticks with the same set-point.
    """

    def __init__(self) -> None:
        self.max_error = self._squares = 0.0
        self._count = 0
        self._stair: list[float] = []
        self._since = math.inf

    @property
    def rms(self) -> float | None:
        """Root mean square error [deg]; None if there was no motion."""
        return math.sqrt(self._squares / self._count) if self._count else None

    def start(self, time: float) -> None:
        """Start a motion at ``time`` [s]."""
        self._since, self._stair = time, []

    def end(self) -> None:
        """End the motion; errors since the last change of the set-point do not count."""
        self._since, self._stair = math.inf, []

    def add_error(self, error: float) -> None:
        """Add the error [deg] at one tick of the current set-point."""
        self._stair.append(error)

    def end_stair(self, time: float) -> None:
        """End the current set-point at ``time`` [s]."""
        if self._stair and time - self._since > TRANSIENT_S:
            error = sum(self._stair) / len(self._stair)
            self._squares, self._count = self._squares + error * error, self._count + 1
            self.max_error = max(self.max_error, abs(error))
        self._stair = []


class SetPointMetrics:
    """Splits the run into steps and motions of the set-point, and measures them tick by tick."""

    def __init__(self) -> None:
        self.tracking = TrackingError()
        self._steps: list[StepResponse] = []
        self._step: StepResponse | None = None
        self._set_point: float | None = None
        self._changed = 0.0
        self._moving = False

    @property
    def steps(self) -> tuple[StepFigures, ...]:
        """The measured steps, in order."""
        return tuple(found for each in self._steps if (found := each.result()) is not None)

    @property
    def largest_step(self) -> StepFigures | None:
        """The largest step, the first of several equal ones."""
        return max(self.steps, key=lambda each: abs(each.to_deg - each.from_deg), default=None)

    def resting_time(self, time: float) -> float:
        """Return how long [s] the set-point has rested at ``time``."""
        return 0.0 if self._set_point is None or self._moving else time - self._changed

    def add_sample(self, time: float, set_point: float, angle: float) -> None:
        """Add set-point and true angle [deg] at ``time`` [s]."""
        if self._set_point is None:
            self._set_point, self._changed = set_point, time
        if set_point != self._set_point:
            self._on_change(time, self._set_point, set_point)
        elif self._moving and time - self._changed >= SET_POINT_REST_S:
            self._moving = False
            self.tracking.end()
        if self._step is not None:
            self._step.add_sample(time, angle)
        if self._moving:
            self.tracking.add_error(set_point - angle)

    def _on_change(self, time: float, before: float, after: float) -> None:
        if self._moving:
            self.tracking.end_stair(time)
        elif time - self._changed >= SET_POINT_REST_S:
            self._step = StepResponse(time, before, after) if abs(after - before) >= MIN_STEP_DEG else None
            self._steps += [self._step] if self._step else []
        else:
            # The previous change was the beginning of a motion, not a step.
            if self._step is not None and self._step.start_time == self._changed:
                self._steps.remove(self._step)
            self._step, self._moving = None, True
            self.tracking.start(self._changed)
        self._set_point, self._changed = after, time


REST_RATE = 0.1
"""Rate [deg/s] below which an arm counts as resting."""
FINISHED_REST_S = 1.0
"""Time [s] of rest, of arm and set-point, after which an arm has finished."""


class ArmMeter:
    """Metrics of one arm so far; ``arm`` is its current specification."""

    def __init__(self, arm: ArmSpec) -> None:
        self.arm = arm
        self.fingerprint, self.trail, self.set_point_metrics = Fingerprint(), Trail(), SetPointMetrics()
        self.finished_at: float | None = None
        self._joint: tuple[float, float] | None = None
        self._samples = self._ticks = 0
        self._last: float | None = None
        self._controlled_s = self._saturated_s = self._max_gap = self._max_effort = self._effort_squares = 0.0

    def add_joint_state(self, state: JointState) -> None:
        """Add joint states; those without the arm's joint belong to another robot."""
        if self.arm.joint not in state.name or not state.position:
            return
        index = state.name.index(self.arm.joint)
        rate = state.velocity[index] if state.velocity else 0.0
        self.fingerprint.add_joint(state.header.stamp.ns, state.position[index], rate)
        self._joint = math.degrees(state.position[index]), math.degrees(rate)
        self._samples += 1

    def add_control_state(self, state: JointControllerState) -> None:
        """Add one tick of the controller, after the joint states of the same time."""
        if self._joint is None:
            return
        time, (angle, rate) = state.header.stamp.ns / 1e9, self._joint
        if self._last is not None:
            passed = time - self._last
            self._max_gap = max(self._max_gap, passed)
            self._controlled_s += passed
            self._saturated_s += passed if abs(state.command) >= self.arm.saturation else 0.0
        self._last = time
        self._ticks += 1
        self._max_effort = max(self._max_effort, abs(state.command))
        self._effort_squares += state.command * state.command
        self.set_point_metrics.add_sample(time, state.set_point, angle)
        rests = self.set_point_metrics.resting_time(time) >= FINISHED_REST_S and abs(rate) < REST_RATE
        if not rests or self.finished_at is None:
            self.trail.add((time, state.set_point, angle, state.set_point - angle, state.command))
        self.finished_at = (self.finished_at or time) if rests else None

    def result(self, messages_lost: int) -> ArmFigures:
        """Return all figures so far."""
        steps, step, tracking = (
            self.set_point_metrics.steps,
            self.set_point_metrics.largest_step,
            self.set_point_metrics.tracking,
        )
        moved = tracking.rms is not None
        return ArmFigures(
            steps=steps,
            step_final_deg=step.final_deg if step else None,
            step_rise_s=step.rise_s if step else None,
            step_overshoot_percent=step.overshoot_percent if step else None,
            step_settling_s=step.settling_s if step else None,
            step_steady_error_deg=step.steady_error_deg if step else None,
            tracking_rms_deg=tracking.rms,
            tracking_max_deg=tracking.max_error if moved else None,
            effort_max_nm=self._max_effort if self._ticks else None,
            effort_rms_nm=math.sqrt(self._effort_squares / self._ticks) if self._ticks else None,
            saturated_s=self._saturated_s,
            saturated_share=self._saturated_s / self._controlled_s if self._controlled_s else 0.0,
            control_gap_s=self._max_gap if self._ticks else None,
            time_s=self.finished_at,
            messages_lost=messages_lost,
            samples=self._samples,
        )
