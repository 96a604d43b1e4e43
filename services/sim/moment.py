"""One instant of the simulation: its time, and the bodies as they are then, each read once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from messages.template import encode_stamp
from services.sim.physics.world import BodyState, JointReadings, World

MANY = 0.5
"""Share of the bodies from which on all are read at once."""


class Moment:
    """The world at ``tick``, which is at ``now`` [ns]; it holds until the world changes."""

    def __init__(self, world: World, now: int, tick: int) -> None:
        self.now, self.tick = now, tick
        self._world = world
        self._states: dict[str, BodyState] = {}
        self._joints: dict[str, JointReadings] = {}

    @cached_property
    def stamp(self) -> bytes:
        """The time, as templates of messages take it."""
        return encode_stamp(self.now)

    def read_states(self, names: Sequence[str]) -> None:
        """Read what ``state`` will be asked for."""
        if not self._states and len(names) > MANY * len(self._world.names):
            self._states = dict(zip(self._world.names, self._world.states(), strict=True))

    def read_joints(self, names: Sequence[str]) -> None:
        """Read what ``joints`` will be asked for."""
        if not self._joints and len(names) > MANY * len(self._world.names):
            self._joints = dict(zip(self._world.names, self._world.joint_readings(), strict=True))

    def state(self, name: str) -> BodyState:
        """Pose and velocity of the root of a body."""
        if (state := self._states.get(name)) is None:
            state = self._states[name] = self._world.body(name).state()
        return state

    def joints(self, name: str) -> JointReadings:
        """The joints of a body."""
        if (readings := self._joints.get(name)) is None:
            readings = self._joints[name] = self._world.body(name).joint_readings()
        return readings
