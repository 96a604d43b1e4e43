"""The world in PyBullet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.scene import Scene
from services.runtime.errors import BadInput, unknown
from services.sim.camera import render
from services.sim.clearance import Clearance
from services.sim.engine import configure, connect, load_body, load_scene
from services.sim.quiet import pybullet
from services.sim.world import Body, BodyState, Contact, JointReadings, Lens, Placement

SECOND = 1_000_000_000


@dataclass(frozen=True)
class _Loaded:
    """A body in the client: its number, the indices of its joints and links."""

    body: Body
    number: int
    joints: tuple[str, ...]
    indices: tuple[int, ...]
    motors: tuple[int, ...]
    torques: tuple[float, ...]
    links: dict[str, int]


class BulletWorld:
    """Implements ``services.sim.world.World``. Opened by ``with``; bodies, obstacles and ground follow ``scene``.

    Bodies are kept in the order of their spawning, since PyBullet's numbers depend on it: two robots swapped differ by
    7e-6 m after 4 s.
    """

    def __init__(self, scene: Scene, step_ns: int) -> None:
        self.scene, self._step_ns = scene, step_ns
        self._bodies: dict[str, _Loaded] = {}

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
        self._clearance.admit(body.name, body.urdf, body.placement, self._placements())
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
        number = self._find(name).number
        placement = Placement(state.position, state.orientation)
        others = {other: where for other, where in self._placements().items() if other != name}
        self._clearance.check(name, placement, others)
        pybullet.resetBasePositionAndOrientation(number, *placement, physicsClientId=self._client)
        pybullet.resetBaseVelocity(number, state.linear, state.angular, physicsClientId=self._client)

    def joints(self, name: str) -> tuple[str, ...]:
        """The movable joints of a body, in the URDF's order."""
        return self._find(name).joints

    def joint_readings(self, name: str) -> JointReadings:
        """Angles, speeds and motor torques of the movable joints."""
        loaded = self._find(name)
        rows = pybullet.getJointStates(loaded.number, loaded.indices, self._client)
        return JointReadings(
            tuple(row[0] for row in rows), tuple(row[1] for row in rows), tuple(row[3] for row in rows)
        )

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
        loaded = self._find(name)
        if link not in loaded.links:
            raise unknown("link", link, loaded.links, name)
        if (index := loaded.links[link]) < 0:
            return Placement(*pybullet.getBasePositionAndOrientation(loaded.number, self._client))
        found = pybullet.getLinkState(loaded.number, index, computeForwardKinematics=1, physicsClientId=self._client)
        return Placement(found[4], found[5])

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

    def _find(self, name: str) -> _Loaded:
        if (loaded := self._bodies.get(name)) is None:
            raise unknown("body", name, self._bodies)
        return loaded

    def _placements(self) -> dict[str, Placement]:
        return {
            name: Placement(*pybullet.getBasePositionAndOrientation(loaded.number, self._client))
            for name, loaded in self._bodies.items()
        }

    def _load(self, body: Body) -> _Loaded:
        number = load_body(self._client, body.urdf, body.placement)
        count = pybullet.getNumJoints(number, self._client)
        rows = [pybullet.getJointInfo(number, index, self._client) for index in range(count)]
        movable = {row[1].decode(): row[0] for row in rows if row[2] != pybullet.JOINT_FIXED}
        for motor in body.motors:
            if motor.joint not in movable:
                pybullet.removeBody(number, physicsClientId=self._client)
                raise unknown("joint", motor.joint, movable, f"{body.name}: motor")
        root = pybullet.getBodyInfo(number, self._client)[0].decode()
        loaded = _Loaded(
            body=body,
            number=number,
            joints=tuple(movable),
            indices=tuple(movable.values()),
            motors=tuple(movable[motor.joint] for motor in body.motors),
            torques=tuple(motor.torque for motor in body.motors),
            links={root: -1} | {row[12].decode(): row[0] for row in rows},
        )
        self._bodies[body.name] = loaded
        self.set_speeds(body.name, (0.0,) * len(body.motors))
        return loaded
