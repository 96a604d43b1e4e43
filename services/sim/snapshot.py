"""A snapshot of the simulation: its time, and the states of bodies and joints, each read once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from messages.template import encode_stamp
from services.sim.physics.world import BodyState, JointReadings, World

Floats = NDArray[np.float64]

FEW = 8
"""Number of bodies up to which each is read and computed by itself: operations on arrays would take longer."""
MANY = 0.5
"""Share of the bodies above which all are read at once."""


class Snapshot:
    """The world at ``tick``, whose time is ``now`` [ns]; valid until the world changes."""

    def __init__(self, world: World, now: int, tick: int) -> None:
        self.now, self.tick = now, tick
        self._world = world
        self._stamp = b""
        self._rows: Floats | None = None
        """States of all bodies, if they were read together."""
        self._indices: dict[str, int] = {}
        self._states: dict[str, BodyState] = {}
        self._joint_rows: Floats | None = None
        """Readings of all joints, if they were read together."""
        self._joint_slices: dict[str, slice] = {}
        self._joints: dict[str, JointReadings] = {}

    @property
    def stamp(self) -> bytes:
        """The time, encoded for message templates."""
        if not self._stamp:
            self._stamp = encode_stamp(self.now)
        return self._stamp

    def read_states(self, names: Sequence[str]) -> None:
        """Prepare for ``states`` of these bodies: read all at once if there are many."""
        if self._rows is None and len(names) > max(FEW, MANY * len(self._world.names)):
            self._rows = self._world.states()
            self._indices = {name: index for index, name in enumerate(self._world.names)}

    def states(self, names: Sequence[str]) -> Floats:
        """Return pose and velocity of the roots of bodies, shape (n, 13), see ``World.states``."""
        self.read_states(names)
        if self._rows is None:
            return np.array([self.state(name).numbers for name in names]).reshape(-1, 13)
        if tuple(names) == self._world.names:
            return self._rows
        return self._rows[[self._indices[name] for name in names]]

    def read_joints(self, names: Sequence[str]) -> None:
        """Prepare for ``joints`` of these bodies: read all at once if there are many."""
        if self._joint_rows is None and len(names) > max(FEW, MANY * len(self._world.names)):
            self._joint_rows = self._world.joint_readings()

    def joint_rows(self, names: Sequence[str]) -> Floats:
        """Return the joints of bodies, one body after another, shape (3, n), see ``World.joint_readings``."""
        self.read_joints(names)
        if self._joint_rows is None:
            readings = [self.joints(name) for name in names]
            return np.array([[number for each in readings for number in each[row]] for row in range(3)])
        if tuple(names) == self._world.names:
            return self._joint_rows
        return np.concatenate((np.empty((3, 0)), *map(self._joint_columns, names)), axis=1)

    def state(self, name: str) -> BodyState:
        """Return pose and velocity of a body's root."""
        if (state := self._states.get(name)) is None:
            if self._rows is None:
                state = self._world.body(name).state()
            else:
                state = BodyState.of_numbers(self._rows[self._indices[name]].tolist())
            self._states[name] = state
        return state

    def joints(self, name: str) -> JointReadings:
        """Return the readings of a body's joints."""
        if (readings := self._joints.get(name)) is None:
            if self._joint_rows is None:
                readings = self._world.body(name).joint_readings()
            else:
                readings = JointReadings(*map(tuple, self._joint_columns(name).tolist()))
            self._joints[name] = readings
        return readings

    def _joint_columns(self, name: str) -> Floats:
        """Return a body's columns of the joint readings that were read together, shape (3, n)."""
        assert self._joint_rows is not None
        if not self._joint_slices:
            end = 0
            for each in self._world.names:
                start, end = end, end + len(self._world.body(each).joints)
                self._joint_slices[each] = slice(start, end)
        return self._joint_rows[:, self._joint_slices[name]]
