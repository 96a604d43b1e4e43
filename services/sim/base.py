"""The base of one robot: which command it obeys, and the wheel speeds that follow from it."""

from __future__ import annotations

from messages.base import Message
from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.std import Bool, Header, Time
from models.figures import Wheels
from services.runtime.service import STEP_NS
from services.runtime.wire import MEMBER_BYTES, Origin
from services.sim import BaseParameters
from services.sim.arbiter import Arbiter
from services.sim.commanders import FOREIGN, Ages, Commanders
from services.sim.drive import AT_REST, Limits, advance, wheel_speeds

STEP_S = STEP_NS / 1e9

Batch = list[tuple[Message, Origin | None]]
"""What an input admitted at this tick."""


class Base:
    """Two driven wheels that obey one commander at a time."""

    def __init__(self, wheels: Wheels, parameters: BaseParameters, commanders: Commanders, ages: Ages) -> None:
        self.limits = Limits.of(wheels, clamp=parameters.clamp, jump=parameters.jump)
        self.arbiter = Arbiter(parameters.cmd_vel_timeout)
        self._commanders, self._ages = commanders, ages
        self._rims = AT_REST
        self._stops: dict[str, bool] = {}

    def restart(self) -> None:
        """Stand still and forget all commands."""
        self.arbiter.clear()
        self._rims = AT_REST

    def obey(self, batch: Batch, now: int, governed: set[bytes], factor: float) -> None:
        """Offer commands to the arbiter.

        Publishers in lockstep (``governed``, ids of members) are on time by construction; the age of all other
        commands is measured in wall time and turned into simulation time by ``factor``.
        """
        for command, origin in batch:
            assert isinstance(command, Twist)
            source, priority, stamp = FOREIGN, 1, None
            if origin is not None:
                source = origin.publisher
                priority = self._commanders.find(source).priority
                if source[:MEMBER_BYTES] not in governed:
                    stamp = now - round(self._ages.of(origin) * factor * 1e9)
            self.arbiter.offer(source, priority, command.linear.x, command.angular.z, stamp, now)

    def stop(self, who: str, batch: Batch) -> None:
        """Follow an emergency stop; the base moves again when the stops of all who asked are reset."""
        for message, _ in batch:
            assert isinstance(message, Bool)
            self._stops[who] = message.data
        if batch and self.arbiter.e_stopped != (wanted := any(self._stops.values())):
            self.arbiter.e_stop(wanted)

    def step(self, now: int) -> tuple[float, float] | None:
        """The wheels' new target speeds [rad/s] for the step that begins at ``now``; None when they stay."""
        decision = self.arbiter.decide(now)
        rims = advance(self.limits, self._rims, decision.v, decision.w, decision.braking, STEP_S)
        if rims is self._rims:
            return None
        self._rims = rims
        return wheel_speeds(self.limits, rims)

    def status(self, now: int, model: str, refused: int, colliding: bool, collisions: int) -> BaseStatus:
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
        )
