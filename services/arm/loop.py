"""The loop of the arm service: joint states and the reference in; effort, and what it tells of itself, out."""

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
from services.arm.controller import Controller
from services.arm.gains import gains_of
from services.arm.joint import Joint, Reading
from services.arm.pid import Sight
from services.arm.target import Motion, Target
from services.runtime.context import Context, Tick
from services.runtime.errors import BadInput

PERIODS = 5
"""More than so many periods after the last tick, time has jumped: nothing is summed up or derived over it."""
LEAST_PERIODS = 2
"""An effort acts for at least so many periods, so that one late tick does not let the arm go."""
SLACK = 0.5
"""deg by which a reference may lie beyond the joint's range."""
COMPLAINT_S = 5.0
"""Wall time between two lines about one and the same trouble."""


def run(ctx: Context[ArmParameters]) -> None:
    """Control until told to stop, then let the arm go."""
    if not ctx.params.lower < ctx.params.upper:
        raise BadInput(f"lower = {ctx.params.lower:g} deg is not below upper = {ctx.params.upper:g} deg")
    hand = _Hand(ctx)
    try:
        for tick in ctx.ticks(ctx.params.rate):
            hand.step(tick)
    finally:
        hand.release(ctx.now)


class _Hand:
    """Reads, decides and tells, once a tick.

    Before the first reference the arm is held where it was found; when references no longer come, at the last one.
    Without joint states it is let go, and its controller begins anew when they are back.
    """

    def __init__(self, ctx: Context[ArmParameters]) -> None:
        self._ctx = ctx
        self._states, self._references = ctx.latest(JOINT_STATES), ctx.stream(REFERENCE)
        self._efforts, self._signals = ctx.writer(JOINT_EFFORT), ctx.writer(CONTROL_SIGNAL)
        self._angles, self._errors = ctx.writer(JOINT_ANGLE), ctx.writer(CONTROL_ERROR)
        self._whole = ctx.writer(CONTROL_STATE)
        self._since: int | None = None
        self._holds = self._astray = False
        self._found: float | None = None
        self._joint, self._target, self._controller = Joint(ctx.params.joint), Target(), Controller()

    def step(self, tick: Tick) -> None:
        """One tick."""
        p = self._ctx.params
        if self._since is None or tick.reset:
            self._begin(tick.time)
        self._hear(p, tick.time)
        seen = self._see(p, tick.time)
        if seen is None:
            self._let_go(tick.time)
            return
        wanted = self._wanted(p, tick.time, seen)
        if not self._holds:
            self._holds = True
            self._ctx.log.info(f"holding {p.joint} from {seen.angle:.2f} deg on")
        now = Sight(wanted.angle, wanted.rate, seen.angle, seen.rate, wanted.acceleration)
        dt = tick.dt if 0 < tick.dt <= PERIODS / p.rate else 0.0
        self._tell(p, tick, now, self._controller.step(p, now, dt))

    def release(self, now: int) -> None:
        """Let the arm go at once, if it is held."""
        if self._holds:
            self._efforts.publish(JointEffort(joint_name=self._joint.name, start_time=Time.of(now)))

    def _begin(self, now: int) -> None:
        self._since = now
        self._joint, self._target = Joint(self._ctx.params.joint), Target()
        self._controller, self._found = Controller(), None
        self._holds = self._astray = False

    def _waited(self, now: int, seconds: float) -> bool:
        """Whether the beginning is so long ago that what has not come since is missing."""
        return self._since is not None and now - self._since > seconds * 1e9

    def _hear(self, p: ArmParameters, now: int) -> None:
        for reference in self._references.take():
            if p.lower - SLACK <= reference.data <= p.upper + SLACK:
                self._target.take(reference.data, now)
            else:
                self._ctx.log.warn(
                    f"reference of {reference.data:g} deg refused, {p.joint} moves from {p.lower:g} to {p.upper:g} deg",
                    every=COMPLAINT_S,
                )

    def _see(self, p: ArmParameters, now: int) -> Reading | None:
        state = self._states.fresh(p.state_timeout)
        if state is not None:
            seen = self._joint.read(state, round(LEAST_PERIODS / p.rate * 1e9))
            if seen is None:
                self._ctx.log.warn(f"{self._joint.trouble}, letting go: is joint right?", every=COMPLAINT_S)
            return seen
        if self._waited(now, p.state_timeout):
            self._ctx.log.warn(
                f"no joint states on {self._ctx.namespace.rstrip('/')}/joint_states for {p.state_timeout:g} s, "
                "letting go: is the arm in the simulation?",
                every=COMPLAINT_S,
            )
        return None

    def _let_go(self, now: int) -> None:
        self.release(now)
        self._joint, self._controller = Joint(self._ctx.params.joint), Controller()
        self._found, self._holds = None, False

    def _wanted(self, p: ArmParameters, now: int, seen: Reading) -> Motion:
        target = self._target
        if target.sample is None:
            self._found = seen.angle if self._found is None else self._found
            if self._waited(now, p.reference_timeout):
                self._ctx.log.warn(
                    f"no reference on {REFERENCE.name} yet, holding {self._found:.2f} deg: is its service running?",
                    every=COMPLAINT_S,
                )
            return Motion(self._found)
        silent = target.age(now) > p.reference_timeout
        if silent:
            target.rest()
            self._ctx.log.warn(
                f"no reference for {target.age(now):.1f} s, holding {target.sample:.2f} deg: has its service died?",
                every=COMPLAINT_S,
            )
        elif self._astray:
            self._ctx.log.info("references are back")
        self._astray = silent
        wanted = target.at(now, smooth=p.law == "default", span=seen.span)
        return wanted._replace(angle=max(p.lower, min(p.upper, wanted.angle)))

    def _tell(self, p: ArmParameters, tick: Tick, now: Sight, effort: float) -> None:
        stamp, duration = Time.of(tick.time), max(p.duration, LEAST_PERIODS / p.rate)
        job = JointEffort(joint_name=p.joint, effort=effort, start_time=stamp, duration=duration)
        self._efforts.publish(job)
        self._signals.publish(Float32(data=effort))
        self._angles.publish(Float32(data=now.angle))
        if self._target.sample is None:
            return
        self._errors.publish(Float32(data=now.error))
        gains = gains_of(p)
        clamp = p.saturation if p.law == "default" else gains.ki * p.windup_guard
        self._whole.publish(
            JointControllerState(
                header=Header(stamp=stamp),
                set_point=now.wanted,
                process_value=now.angle,
                process_value_dot=now.rate,
                error=now.error,
                time_step=tick.dt,
                command=effort,
                p=gains.kp,
                i=gains.ki,
                d=gains.kd,
                i_clamp=clamp,
                antiwindup=p.law == "default",
            )
        )
