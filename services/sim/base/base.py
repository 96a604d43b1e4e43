"""The base of one robot: which command it obeys, and the wheel speeds that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from messages.base import Message
from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped
from messages.std import Header, Time
from services.runtime.log import Log
from services.runtime.network.wire import MEMBER_BYTES, Origin
from services.runtime.service import STEP_NS
from services.sim.ages import Ages
from services.sim.base.arbiter import BRAKE, Arbiter
from services.sim.base.settings import Settings
from services.sim.commanders import FOREIGN, Commanders
from services.sim.diffdrive.driver import AT_REST, advance, commanded, wheel_speeds
from services.sim.diffdrive.pid import FRESH, torque

STEP_S = STEP_NS / 1e9

UNKNOWN_NS = 10**18
"""Simulation time by which a command of unknown age is old: beyond every time-out."""

Batch = list[tuple[Message, Origin | None]]
"""What an input admitted at this tick."""


class Base:
    """Two driven wheels that obey one commander at a time; settings are replaced as a whole, never changed."""

    def __init__(self, settings: Settings, commanders: Commanders, ages: Ages, log: Log) -> None:
        self.settings, self.drive, self.live = settings, settings.drive, settings.live
        self.arbiter = Arbiter(settings.timeout, settings.exclusive)
        self._commanders, self._ages, self._log = commanders, ages, log
        self._told_of_zero = False
        self.restart()

    def restart(self) -> None:
        """Stand still and forget all commands."""
        self.arbiter.clear()
        self._state, self._obeyed, self._steady, self._anew = AT_REST, BRAKE, True, False
        self._memories = (FRESH, FRESH)

    def obey(self, batch: Batch, now: int, governed: set[bytes], factor: float) -> None:
        """Offer commands to the arbiter.

        Publishers in lockstep (``governed``, ids of members) are on time by construction; the age of all other
        commands is measured in wall time and turned into simulation time by ``factor``. A command with a stamp is as
        old as that says, too.
        """
        for command, origin in batch:
            source, priority, made, age = FOREIGN, 1, None, 0.0
            if origin is not None:
                source = origin.publisher
                priority = self._commanders.find(source).priority
                if source[:MEMBER_BYTES] not in governed:
                    age = self._ages.of(origin)
                    made = now - (round(age * factor * 1e9) if age < inf else UNKNOWN_NS)
            stale = self.arbiter.stale_dropped
            if isinstance(command, TwistStamped):
                made = self._stamp(command, made, now)
                command = command.twist
            assert isinstance(command, Twist)
            self.arbiter.offer(source, priority, command.linear.x, command.angular.z, made, now)
            if self.arbiter.stale_dropped == stale:
                continue
            if age == inf or age * factor > self.settings.timeout:
                self._tell_of_age(source, age)
            elif made is not None and self.settings.stamped:
                self._log.warn(
                    f"a TwistStamped made at {made / 1e9:.3f} s of simulation time is dropped: older than the time-out "
                    f"of {self.settings.timeout:g} s or from the future. Is it stamped by /clock?",
                    every=1.0,
                )
        if self.arbiter.contested:
            self._log.warn(
                "several nodes publish cmd_vel and allow_multiple_cmd_vel_publishers is false: the base brakes until "
                "one alone is left",
                every=1.0,
            )

    def stop(self, on: bool) -> None:
        """Brake and stay, or obey commands again that come from now on."""
        if self.arbiter.e_stopped != on:
            self.arbiter.e_stop(on)

    def step(self, now: int) -> tuple[float, float] | None:
        """The wheels' new target speeds [rad/s] for the step that begins at ``now``; None when they stay."""
        decision = self.arbiter.decide(now)
        if self._steady and decision is self._obeyed:
            return None
        before = self._state
        state = advance(self.drive, before, decision.v, decision.w, decision.braking, STEP_S)
        self._obeyed, self._steady = decision, state is before
        if self._steady and not self._anew:
            return None
        self._state, self._anew = state, False
        return wheel_speeds(self.drive, state)

    def torques(self, speeds: Sequence[float]) -> tuple[float, float]:
        """The wheels' torques [N m] for one step, where a PID drives them that now turn at ``speeds`` [rad/s]."""
        gains = self.settings.gains
        assert gains is not None
        wanted, (left, right) = wheel_speeds(self.drive, self._state), self._memories
        one, left = torque(gains, left, wanted[0] - speeds[0], STEP_S)
        other, right = torque(gains, right, wanted[1] - speeds[1], STEP_S)
        self._memories = left, right
        return one, other

    def retune(self, settings: Settings, now: int) -> None:
        """Replace all settings from the step that begins at ``now`` [ns] on."""
        self.settings, self.drive, self.live = settings, settings.drive, settings.live
        self.arbiter.retune(settings.timeout, settings.exclusive, now)
        self._steady, self._anew = False, True

    @property
    def motion(self) -> tuple[float, float]:
        """What the wheels are told, as speed [m/s] and turn rate [rad/s] of the base."""
        return commanded(self.drive, self._state)

    def status(
        self, now: int, model: str, refused: int, colliding: bool, collisions: int, stopped_by: tuple[str, ...] = ()
    ) -> BaseStatus:
        """What the base obeys and refuses, and what its robot hits."""
        arbiter = self.arbiter
        source = arbiter.decide(now).source
        return BaseStatus(
            header=Header(stamp=Time.of(now)),
            model=model,
            source="" if source is None else self._commanders.find(source).node or "(foreign)",
            timed_out=arbiter.timed_out,
            e_stopped=arbiter.e_stopped,
            commands=arbiter.commands,
            commands_timed_out=arbiter.commands_timed_out,
            stale_dropped=arbiter.stale_dropped,
            refused=arbiter.refused + refused,
            last_command=Time.of(arbiter.last_command),
            colliding=colliding,
            collisions=collisions,
            stopped_by=stopped_by,
        )

    def _tell_of_age(self, source: bytes, age: float) -> None:
        node = self._commanders.find(source).node or "a node without a token"
        why = (
            f"it is {age:.2f} s old: its sender or a link was stuck, or the clock of its machine was set back"
            if age < inf
            else "by its stamp it is newer than any before could be: the clock of its machine was set ahead, or differs"
        )
        self._log.warn(f"a command of {node} is dropped: {why}", every=5.0)

    def _stamp(self, command: TwistStamped, made: int | None, now: int) -> int | None:
        """When a command was made, ns, by its stamp and by its way; a stamp of 0 means that it has none.

        A stamp from the future stays one, to be refused.
        """
        stamp = command.header.stamp.ns
        if stamp == 0:
            if not self._told_of_zero:
                self._told_of_zero = True
                self._log.warn(
                    "a TwistStamped on cmd_vel has no stamp: this one, and all like it, counts from its arrival"
                )
            return made
        return stamp if made is None or stamp > now else min(stamp, made)
