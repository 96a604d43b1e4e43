"""One instant of the simulation: its time, and the bodies as they are then, each read once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from messages.template import encode_stamp
from services.sim.physics.world import BodyState, JointReadings, World

Floats = NDArray[np.float64]

MANY = 0.5
"""Share of the bodies from which on all are read at once."""


class Moment:
    """The world at ``tick``, which is at ``now`` [ns]; it holds until the world changes."""

    def __init__(self, world: World, now: int, tick: int) -> None:
        self.now, self.tick = now, tick
        self._world = world
        self._rows: Floats | None = None
        """Of all bodies, where they are read together."""
        self._places: dict[str, int] = {}
        self._states: dict[str, BodyState] = {}
        self._joints: dict[str, JointReadings] = {}

    @cached_property
    def stamp(self) -> bytes:
        """The time in the form that message templates need."""
        return encode_stamp(self.now)

    def read_states(self, names: Sequence[str]) -> None:
        """Read what ``state`` will be asked for."""
        if self._rows is None and len(names) > MANY * len(self._world.names):
            self._rows = self._world.states()
            self._places = {name: place for place, name in enumerate(self._world.names)}

    def states(self, names: Sequence[str]) -> Floats:
        """Pose and velocity of the roots of bodies, shape (n, 13), as ``World.states`` has them."""
        self.read_states(names)
        if self._rows is None:
            return np.array([self.state(name).numbers for name in names]).reshape(-1, 13)
        if tuple(names) == self._world.names:
            return self._rows
        return self._rows[[self._places[name] for name in names]]

    def read_joints(self, names: Sequence[str]) -> None:
        """Read what ``joints`` will be asked for."""
        if not self._joints and len(names) > MANY * len(self._world.names):
            self._joints = dict(zip(self._world.names, self._world.joint_readings(), strict=True))

    def state(self, name: str) -> BodyState:
        """Pose and velocity of the root of a body."""
        if (state := self._states.get(name)) is None:
            if self._rows is None:
                state = self._world.body(name).state()
            else:
                state = BodyState.of_numbers(self._rows[self._places[name]].tolist())
            self._states[name] = state
        return state

    def joints(self, name: str) -> JointReadings:
        """The joints of a body."""
        if (readings := self._joints.get(name)) is None:
            readings = self._joints[name] = self._world.body(name).joint_readings()
        return readings
