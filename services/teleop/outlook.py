"""What teleop knows of the world beside the keys: simulation time, and the robot that it drives."""

from __future__ import annotations

from typing import Any

from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.topics import BASE_STATUS, CLOCK, ODOM
from services.runtime.context import Context
from services.runtime.health import State
from services.runtime.network.wire import Origin
from services.runtime.views import Latest

SILENCE_S = 1.0
"""Wall time after which what tells nothing is taken to be gone; a clock tells 50 times a second, a base 5 times."""


class Outlook:
    """The clock, the odometry and the base of one robot, as the last look saw them. Wall times are s."""

    def __init__(self, ctx: Context[Any], wall: float) -> None:
        self._ctx = ctx
        self._clock, self._status, self._odom = ctx.latest(CLOCK), ctx.latest(BASE_STATUS), ctx.latest(ODOM)
        self._origins: list[Origin | None] = [None, None, None]
        self._heard = [wall, wall, wall]
        self._wall = wall
        self._epoch = -1

    def look(self, wall: float) -> bool:
        """Take what has come; True when simulation time has begun anew. The context's time follows."""
        self._wall = wall
        self._ctx.kernel.admit()
        views: tuple[Latest[Any], ...] = self._clock, self._status, self._odom
        for index, view in enumerate(views):
            view.refresh()
            if view.origin != self._origins[index]:
                self._origins[index], self._heard[index] = view.origin, wall
        clock = self._clock.value
        if clock is None:
            return False
        anew = clock.epoch != self._epoch or clock.clock.ns < self._ctx.now
        self._epoch, self._ctx.now = clock.epoch, clock.clock.ns
        return anew

    @property
    def seconds(self) -> float:
        """Simulation time, s."""
        return self._ctx.now / 1e9

    @property
    def state(self) -> State:
        """What the heartbeat says of time."""
        if self._silent(0):
            return "waiting"
        return "paused" if self._clock.value is not None and self._clock.value.paused else "running"

    @property
    def trouble(self) -> str:
        """What is wrong with time, in a few words; empty when nothing is."""
        if self._silent(0):
            return f"no clock for {self._wall - self._heard[0]:.0f} s: is the simulation running?"
        if self._clock.value is None:
            return "waiting for the clock"
        return "the simulation is paused" if self._clock.value.paused else ""

    @property
    def base(self) -> BaseStatus | None:
        """What the base tells, None when it tells nothing although time goes on."""
        return None if self._silent(1) and self.state == "running" else self._status.value

    @property
    def moving(self) -> Twist | None:
        """The motion by odometry, None when there is none although time goes on."""
        if self._odom.value is None or (self._silent(2) and self.state == "running"):
            return None
        return self._odom.value.twist.twist

    def _silent(self, index: int) -> bool:
        return self._wall - self._heard[index] > SILENCE_S
