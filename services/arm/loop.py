"""The loop of the arm service: reads joint states and the reference, publishes effort and controller state."""

from __future__ import annotations

from messages.control import JointControllerState
from messages.joints import JointEffort
from messages.std import Float32, Header, Time
from messages.topics import (
    CONTROL_ERROR,
    CONTROL_SIGNAL,
    CONTROL_STATE,
    JOINT_ANGLE,
    JOINT_EFFORT,
    JOINT_STATES,
    REFERENCE,
)
from services.arm import ArmParameters
from services.arm.joint import JointReader, JointReading
from services.arm.pid import ArmController, ControlInput, select_gains
from services.arm.reference_interpolator import ReferenceInterpolator, SetPoint
from services.runtime.context import Context, Tick
from services.runtime.errors import BadInput

MAX_PERIODS = 5
"""Periods since the last tick beyond which time has jumped: nothing is integrated or differentiated over the gap."""
MIN_PERIODS = 2
"""Minimum duration of an effort in periods, so that a late tick does not release the arm."""
RANGE_TOLERANCE = 0.5
"""Angle [deg] by which a reference may exceed the joint's range."""
WARN_PERIOD_S = 5.0
"""Minimum wall time between repeated log lines."""


def run(ctx: Context[ArmParameters]) -> None:
    """Control the arm until asked to stop, then release it."""
    if not ctx.params.lower < ctx.params.upper:
        raise BadInput(f"lower = {ctx.params.lower:g} deg is not below upper = {ctx.params.upper:g} deg")
    loop = _ArmLoop(ctx)
    try:
        for tick in ctx.ticks(ctx.params.rate):
            loop.step(tick)
    finally:
        loop.release(ctx.now)


class _ArmLoop:
    """Reads inputs, computes the effort and publishes it, once per tick.

    Before the first reference, the arm is held where it was found; when references stop arriving, at the last one.
    Without joint states it is released, and its controller restarts when they return.
    """

    def __init__(self, ctx: Context[ArmParameters]) -> None:
        self._ctx = ctx
        self._states, self._references = ctx.latest(JOINT_STATES), ctx.stream(REFERENCE)
        self._efforts, self._signals = ctx.advertise(JOINT_EFFORT), ctx.advertise(CONTROL_SIGNAL)
        self._angles, self._errors = ctx.advertise(JOINT_ANGLE), ctx.advertise(CONTROL_ERROR)
        self._control_states = ctx.advertise(CONTROL_STATE)
        self._started_at: int | None = None
        self._holding = self._reference_lost = False
        self._hold_at: float | None = None
        self._joint, self._interpolator, self._controller = (
            JointReader(ctx.params.joint),
            ReferenceInterpolator(),
            ArmController(),
        )

    def step(self, tick: Tick) -> None:
        """Run one control tick."""
        p = self._ctx.params
        if self._started_at is None or tick.reset:
            self._start(tick.time)
        self._read_references(p, tick.time)
        reading = self._read_joint(p, tick.time)
        if reading is None:
            self._release_and_restart(tick.time)
            return
        set_point = self._set_point(p, tick.time, reading)
        if not self._holding:
            self._holding = True
            self._ctx.log.info(f"holding {p.joint}, starting at {reading.angle:.2f} deg")
        inputs = ControlInput(set_point.angle, set_point.rate, reading.angle, reading.rate, set_point.acceleration)
        dt = tick.dt if 0 < tick.dt <= MAX_PERIODS / p.rate else 0.0
        self._publish(p, tick, inputs, self._controller.step(p, inputs, dt))

    def release(self, now: int) -> None:
        """Release the arm at once, if it is held."""
        if self._holding:
            self._efforts.publish(JointEffort(joint_name=self._joint.name, start_time=Time.of(now)))

    def _start(self, now: int) -> None:
        self._started_at = now
        self._joint, self._interpolator = JointReader(self._ctx.params.joint), ReferenceInterpolator()
        self._controller, self._hold_at = ArmController(), None
        self._holding = self._reference_lost = False

    def _has_waited(self, now: int, seconds: float) -> bool:
        """Whether ``seconds`` have passed since the start, so that inputs not received by now count as missing."""
        return self._started_at is not None and now - self._started_at > seconds * 1e9

    def _read_references(self, p: ArmParameters, now: int) -> None:
        for reference in self._references.drain():
            if p.lower - RANGE_TOLERANCE <= reference.data <= p.upper + RANGE_TOLERANCE:
                self._interpolator.add_sample(reference.data, now)
            else:
                self._ctx.log.warn(
                    f"reference of {reference.data:g} deg refused, {p.joint} moves from {p.lower:g} to {p.upper:g} deg",
                    every=WARN_PERIOD_S,
                )

    def _read_joint(self, p: ArmParameters, now: int) -> JointReading | None:
        state = self._states.fresh(p.state_timeout)
        if state is not None:
            reading = self._joint.read(state, round(MIN_PERIODS / p.rate * 1e9))
            if reading is None:
                self._ctx.log.warn(f"{self._joint.error}, releasing the joint: is joint right?", every=WARN_PERIOD_S)
            return reading
        if self._has_waited(now, p.state_timeout):
            self._ctx.log.warn(
                f"no joint states on {self._ctx.namespace.rstrip('/')}/joint_states for {p.state_timeout:g} s, "
                "releasing the joint: is the arm in the simulation?",
                every=WARN_PERIOD_S,
            )
        return None

    def _release_and_restart(self, now: int) -> None:
        self.release(now)
        self._joint, self._controller = JointReader(self._ctx.params.joint), ArmController()
        self._hold_at, self._holding = None, False

    def _set_point(self, p: ArmParameters, now: int, reading: JointReading) -> SetPoint:
        target = self._interpolator
        if target.sample is None:
            self._hold_at = reading.angle if self._hold_at is None else self._hold_at
            if self._has_waited(now, p.reference_timeout):
                self._ctx.log.warn(
                    f"no reference on {REFERENCE.name} yet, holding {self._hold_at:.2f} deg: is its service running?",
                    every=WARN_PERIOD_S,
                )
            return SetPoint(self._hold_at)
        silent = target.age(now) > p.reference_timeout
        if silent:
            target.hold()
            self._ctx.log.warn(
                f"no reference for {target.age(now):.1f} s, holding {target.sample:.2f} deg: is its service still "
                "running?",
                every=WARN_PERIOD_S,
            )
        elif self._reference_lost:
            self._ctx.log.info("references are arriving again")
        self._reference_lost = silent
        set_point = target.at(now, smooth=p.law == "default", span=reading.span)
        return set_point._replace(angle=max(p.lower, min(p.upper, set_point.angle)))

    def _publish(self, p: ArmParameters, tick: Tick, inputs: ControlInput, effort: float) -> None:
        stamp, duration = Time.of(tick.time), max(p.duration, MIN_PERIODS / p.rate)
        command = JointEffort(joint_name=p.joint, effort=effort, start_time=stamp, duration=duration)
        self._efforts.publish(command)
        self._signals.publish(Float32(data=effort))
        self._angles.publish(Float32(data=inputs.angle))
        if self._interpolator.sample is None:
            return
        self._errors.publish(Float32(data=inputs.error))
        gains = select_gains(p)
        clamp = p.saturation if p.law == "default" else gains.ki * p.windup_guard
        self._control_states.publish(
            JointControllerState(
                header=Header(stamp=stamp),
                set_point=inputs.set_point,
                process_value=inputs.angle,
                process_value_dot=inputs.rate,
                error=inputs.error,
                time_step=tick.dt,
                command=effort,
                p=gains.kp,
                i=gains.ki,
                d=gains.kd,
                i_clamp=clamp,
                antiwindup=p.law == "default",
            )
        )
