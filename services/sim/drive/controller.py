"""The differential drive controller of one robot: chooses the command to follow, and computes the wheel speeds."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from messages.base import Message
from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped
from messages.std import Header, Time
from services.driving.pid import INITIAL_PID_STATE, pid_command
from services.runtime.log import Log
from services.runtime.step import STEP_S
from services.runtime.transport.wire import MEMBER_BYTES, SampleInfo
from services.sim.command_sources import FOREIGN_SOURCE, CommandSources
from services.sim.drive.arbiter import Arbiter
from services.sim.drive.config import DriveConfig
from services.sim.drive.driver import AT_REST, commanded_velocity, step_drive, wheel_speeds
from services.sim.transit_delay import TransitDelayEstimator

UNKNOWN_AGE_NS = 10**18
"""Assumed age, in simulation time, of a command of unknown age: beyond every time-out."""
_NOT_IDLE = -1
"""Earlier than any step: the next step has to be taken."""

ReceivedCommands = list[tuple[Message, SampleInfo | None]]
"""The commands admitted at this tick, each with its origin."""


class DiffDriveController:
    """Two driven wheels that follow one commander at a time; the configuration is only replaced as a whole."""

    def __init__(
        self, config: DriveConfig, command_sources: CommandSources, delays: TransitDelayEstimator, log: Log
    ) -> None:
        self.config, self.drive, self.live = config, config.drive, config.live
        self.arbiter = Arbiter(config.timeout, config.exclusive)
        self._command_sources, self._delays, self._log = command_sources, delays, log
        self._warned_unstamped = False
        self.reset()

    def reset(self) -> None:
        """Stand still and discard all commands."""
        self.arbiter.clear()
        self._state, self._force_update = AT_REST, False
        self.idle_until: float = _NOT_IDLE
        """The time [ns] until which ``step`` changes nothing, unless an input arrives."""
        self._pid_states = (INITIAL_PID_STATE, INITIAL_PID_STATE)

    def apply_commands(self, commands: ReceivedCommands, now: int, lockstep_members: set[bytes], factor: float) -> None:
        """Pass commands to the arbiter.

        Commands of lockstep members (``lockstep_members``, ids of members) are on time by construction; the age of all
        others is measured in wall time and converted to simulation time by ``factor``. A command with a stamp is at
        least as old as its stamp.
        """
        self.idle_until = _NOT_IDLE
        for command, origin in commands:
            source, priority, issued, age = FOREIGN_SOURCE, 1, None, 0.0
            if origin is not None:
                source = origin.publisher
                priority = self._command_sources.find(source).priority
                if source[:MEMBER_BYTES] not in lockstep_members:
                    age = self._delays.estimate(origin)
                    issued = now - (round(age * factor * 1e9) if age < inf else UNKNOWN_AGE_NS)
            stale = self.arbiter.stale_dropped
            if isinstance(command, TwistStamped):
                issued = self._command_time(command, issued, now)
                command = command.twist
            assert isinstance(command, Twist)
            sideways = command.linear.y if self.drive.holonomic else 0.0
            self.arbiter.accept(source, priority, command.linear.x, command.angular.z, issued, now, sideways)
            if self.arbiter.stale_dropped == stale:
                continue
            if age == inf or age * factor > self.config.timeout:
                self._warn_stale(source, age)
            elif issued is not None and self.config.stamped:
                self._log.warn(
                    f"a TwistStamped with the stamp {issued / 1e9:.3f} s is dropped: it is older than the time-out of "
                    f"{self.config.timeout:g} s, or in the future. Does its publisher use /clock?",
                    every=1.0,
                )
        if self.arbiter.conflict:
            self._log.warn(
                "several nodes publish cmd_vel and allow_multiple_cmd_vel_publishers is false: the base brakes until "
                "only one is left",
                every=1.0,
            )

    def publisher_lost(self, source: bytes, now: int) -> None:
        """Discard the command of the publisher ``source``, which is gone."""
        self.idle_until = _NOT_IDLE
        self.arbiter.publisher_lost(source, now)

    def stop(self, on: bool) -> None:
        """Brake and stay stopped; or, with ``on`` false, follow commands again that arrive from now on."""
        if self.arbiter.e_stopped != on:
            self.idle_until = _NOT_IDLE
            self.arbiter.set_e_stop(on)

    def step(self, now: int) -> tuple[float, float] | None:
        """Return the wheels' new target speeds [rad/s] for the step that begins at ``now``; None if unchanged."""
        if now <= self.idle_until:
            return None
        decision = self.arbiter.decide(now)
        before = self._state
        state = step_drive(self.drive, before, decision.v, decision.w, decision.braking, STEP_S, decision.vy)
        self.idle_until = self.arbiter.until if state is before else _NOT_IDLE
        if state is before and not self._force_update:
            return None
        self._state, self._force_update = state, False
        return wheel_speeds(self.drive, state)

    def torques(self, speeds: Sequence[float]) -> tuple[float, float]:
        """Return the torques [N m] of PID-driven wheels for one step; they currently turn at ``speeds`` [rad/s]."""
        gains = self.config.gains
        assert gains is not None
        target, (left, right) = wheel_speeds(self.drive, self._state), self._pid_states
        one, left = pid_command(gains, left, target[0] - speeds[0], STEP_S)
        other, right = pid_command(gains, right, target[1] - speeds[1], STEP_S)
        self._pid_states = left, right
        return one, other

    def reconfigure(self, config: DriveConfig, now: int) -> None:
        """Replace the configuration, from the step that begins at ``now`` [ns] on."""
        self.config, self.drive, self.live = config, config.drive, config.live
        self.arbiter.reconfigure(config.timeout, config.exclusive, now)
        self.idle_until, self._force_update = _NOT_IDLE, True

    @property
    def steer(self) -> float:
        """The steering angle, that of the virtual middle wheel, rad."""
        return self._state.steer

    @property
    def planar_velocity(self) -> tuple[float, float, float]:
        """The limited command of a holonomic base: forward and sideways [m/s], turn rate [rad/s]."""
        return self._state.v, self._state.vy, self._state.w

    @property
    def commanded_velocity(self) -> tuple[float, float]:
        """The commanded wheel speeds, as speed [m/s] and turn rate [rad/s] of the base."""
        return commanded_velocity(self.drive, self._state)

    def status(
        self, now: int, model: str, refused: int, colliding: bool, collisions: int, stopped_by: tuple[str, ...] = ()
    ) -> BaseStatus:
        """Return the status of the base: the command it follows, its counts, and its collisions."""
        arbiter = self.arbiter
        source = arbiter.decide(now).source
        return BaseStatus(
            header=Header(stamp=Time.of(now)),
            model=model,
            source="" if source is None else self._command_sources.find(source).node or "(foreign)",
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

    def _warn_stale(self, source: bytes, age: float) -> None:
        node = self._command_sources.find(source).node or "a node without a token"
        why = (
            f"it is {age:.2f} s old: its sender or a link was stuck, or the clock of its machine was set back"
            if age < inf
            else "its stamp is implausibly new: its machine's clock was set forward, or is not synchronised"
        )
        self._log.warn(f"a command of {node} is dropped: {why}", every=5.0)

    def _command_time(self, command: TwistStamped, issued: int | None, now: int) -> int | None:
        """Return when a command was issued, ns, by its stamp and its transit delay; a stamp of 0 means none.

        A stamp in the future is kept, so that the command is refused.
        """
        stamp = command.header.stamp.ns
        if stamp == 0:
            if not self._warned_unstamped:
                self._warned_unstamped = True
                self._log.warn(
                    "a TwistStamped on cmd_vel has no stamp: the age of such commands is counted from their arrival"
                )
            return issued
        return stamp if issued is None or stamp > now else min(stamp, issued)
