"""The world in PyBullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.scene import Scene
from services.runtime.errors import BadInput, unknown
from services.sim.physics.camera import render
from services.sim.physics.clearance import Clearance
from services.sim.physics.engine import configure, connect, load_scene
from services.sim.physics.loaded import Loaded, load
from services.sim.physics.quiet import pybullet
from services.sim.physics.world import (
    Body,
    BodyState,
    Contact,
    Inertia,
    JointReadings,
    Lens,
    Placement,
    Resistance,
    Stance,
    Vector,
)

SECOND = 1_000_000_000


class BulletWorld:
    """Implements ``World``. Opened by ``with``; bodies, obstacles and ground follow ``scene``.

    Bodies are kept in the order of their spawning, since PyBullet's numbers depend on it: two robots swapped differ by
    7e-6 m after 4 s.
    """

    def __init__(self, scene: Scene, step_ns: int) -> None:
        self.scene, self._step_ns = scene, step_ns
        self._bodies: dict[str, Loaded] = {}

    def __enter__(self) -> Self:
        self._client = connect(self._step_ns / SECOND)
        self._obstacles = load_scene(self._client, self.scene)
        self._clearance = Clearance(self.scene)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def step_ns(self) -> int:
        """Simulation time of one step, ns."""
        return self._step_ns

    @property
    def names(self) -> tuple[str, ...]:
        """All bodies, in the order of their spawning."""
        return tuple(self._bodies)

    def spawn(self, body: Body) -> None:
        """Add a body; raises BadInput for a taken name, an overlap, or a URDF without a motor's joint."""
        if body.name in self._bodies:
            raise BadInput(f"a body named {body.name!r} is already in the world; delete it first")
        if body.name in self._obstacles.values():
            raise BadInput(f"{body.name!r} is an obstacle of this world; take another name")
        self._clearance.admit(body, self._stances())
        try:
            self._bodies[body.name] = self._load(body)
        except BadInput:
            self._clearance.forget(body.name)
            raise

    def delete(self, name: str) -> None:
        """Take a body out."""
        pybullet.removeBody(self._find(name).number, physicsClientId=self._client)
        self._clearance.forget(name)
        del self._bodies[name]

    def reset(self) -> None:
        """Empty the client and load everything in the order of its spawning: bit for bit a fresh start."""
        pybullet.resetSimulation(physicsClientId=self._client)
        configure(self._client, self._step_ns / SECOND)
        self._obstacles = load_scene(self._client, self.scene)
        self._bodies = {name: self._load(loaded.body) for name, loaded in self._bodies.items()}

    def step(self) -> None:
        """Advance by ``step_ns``."""
        pybullet.stepSimulation(self._client)

    def state(self, name: str) -> BodyState:
        """Pose and velocity of a body's root frame; about 6 us."""
        number = self._find(name).number
        pose = pybullet.getBasePositionAndOrientation(number, self._client)
        return BodyState(*pose, *pybullet.getBaseVelocity(number, self._client))

    def set_state(self, name: str, state: BodyState) -> None:
        """Move a body; raises BadInput where it would overlap."""
        loaded = self._find(name)
        number, placement = loaded.number, Placement(state.position, state.orientation)
        others = {other: where for other, where in self._stances().items() if other != name}
        self._clearance.check(name, Stance(placement, self._stance(loaded).joints), others)
        pybullet.resetBasePositionAndOrientation(number, *placement, physicsClientId=self._client)
        pybullet.resetBaseVelocity(number, state.linear, state.angular, physicsClientId=self._client)

    def joints(self, name: str) -> tuple[str, ...]:
        """The movable joints of a body, in the URDF's order."""
        return tuple(self._find(name).joints)

    def joint_readings(self, name: str) -> JointReadings:
        """Angles, speeds and motor torques of the movable joints."""
        return self._find(name).readings()

    def set_joints(self, name: str, positions: Mapping[str, float]) -> None:
        """Put joints at positions, at rest; raises BadInput where the body would overlap then."""
        loaded = self._find(name)
        stance = self._stance(loaded)
        for joint in positions:
            loaded.index(joint)
        others = {other: where for other, where in self._stances().items() if other != name}
        self._clearance.check(name, Stance(stance.placement, {**stance.joints, **positions}), others)
        loaded.set_joints(positions)

    def set_efforts(self, name: str, efforts: Mapping[str, float]) -> None:
        """Put efforts on joints for one step; 4 us for one joint."""
        self._find(name).set_efforts(efforts)

    def resist(self, name: str, resistance: Mapping[str, Resistance]) -> None:
        """Let joints resist so from now on, also after a reset."""
        self._bodies[name] = self._find(name).resisting(resistance)

    def push(self, name: str, link: str, force: Vector, torque: Vector, point: Vector) -> None:
        """Act on a link for one step."""
        self._find(name).push(link, force, torque, point)

    def set_speeds(self, name: str, speeds: Sequence[float]) -> None:
        """Set the target speeds [rad/s] of a body's motors."""
        loaded = self._find(name)
        pybullet.setJointMotorControlArray(
            loaded.number,
            loaded.motors,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds,
            forces=loaded.torques,
            physicsClientId=self._client,
        )

    def set_torques(self, name: str, torques: Sequence[float]) -> None:
        """Let a body's motors give these torques [N m] for one step."""
        loaded, client = self._find(name), self._client
        arms = loaded.number, loaded.motors
        idle = [0.0] * len(loaded.motors)
        pybullet.setJointMotorControlArray(*arms, pybullet.VELOCITY_CONTROL, forces=idle, physicsClientId=client)
        pybullet.setJointMotorControlArray(*arms, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client)

    def link_placement(self, name: str, link: str) -> Placement:
        """Where the frame of a link is."""
        return self._find(name).link_placement(link)

    def links(self, name: str) -> tuple[str, ...]:
        """The links of a body, its root first."""
        return tuple(self._find(name).links)

    def link_state(self, name: str, link: str) -> BodyState:
        """Pose of a link's frame, and how its origin moves."""
        return self._find(name).link_state(link)

    def inertia(self, name: str, link: str) -> Inertia:
        """What a link weighs and how."""
        return self._find(name).inertia(link)

    def contacts(self) -> tuple[Contact, ...]:
        """The pairs that touched in the last step."""
        named = {loaded.number: name for name, loaded in self._bodies.items()}
        everything = self._obstacles | named
        pairs = set()
        for point in pybullet.getContactPoints(physicsClientId=self._client):
            one, other = point[1], point[2]
            # Bullet lists what comes near, too; a touch has depth or transmits a force.
            if one in everything and other in everything and (point[8] <= 0 or point[9] > 0):
                first, second = sorted((everything[one], everything[other]))
                pairs.add(Contact(first, second) if first in self._bodies else Contact(second, first))
        return tuple(sorted(pairs))

    def rays(self, origins: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far rays get, as a fraction of their length; inf where nothing is hit. 360 rays take about 1 ms."""
        hits = pybullet.rayTestBatch(origins, ends, physicsClientId=self._client)
        return np.fromiter((hit[2] if hit[0] >= 0 else inf for hit in hits), np.float64, len(hits))

    def picture(self, eye: Placement, lens: Lens) -> bytes:
        """A picture, drawn in software: 320 by 240 pixels take about 30 ms."""
        return render(self._client, eye, lens)

    def close(self) -> None:
        """End both clients."""
        self._clearance.close()
        pybullet.disconnect(physicsClientId=self._client)

    def _find(self, name: str) -> Loaded:
        if (loaded := self._bodies.get(name)) is None:
            raise unknown("body", name, self._bodies)
        return loaded

    def _stances(self) -> dict[str, Stance]:
        return {name: self._stance(loaded) for name, loaded in self._bodies.items()}

    def _stance(self, loaded: Loaded) -> Stance:
        placement = Placement(*pybullet.getBasePositionAndOrientation(loaded.number, self._client))
        return Stance(placement, dict(zip(loaded.joints, loaded.readings().position, strict=True)))

    def _load(self, body: Body) -> Loaded:
        loaded = self._bodies[body.name] = load(self._client, body)
        self.set_speeds(body.name, (0.0,) * len(body.motors))
        return loaded
