"""One robot in the world: its body, its base, and what it reads."""

from __future__ import annotations

from typing import Any

from messages.elea import ModelState
from messages.topics import CMD_VEL, E_STOP
from models import model_path
from models.figures import read_model
from services.runtime.inputs import Input
from services.runtime.node import Node
from services.sim import RobotEntry
from services.sim.base import Base
from services.sim.commanders import Ages, Commanders
from services.sim.odometry import body_twist, pose_of
from services.sim.telemetry import Telemetry
from services.sim.world import Body, Motor, Placement, World


class Robot:
    """A model in the world as ``entry.name``; its topics lie in its namespace, its frames carry its name."""

    def __init__(
        self,
        node: Node,
        world: World,
        entry: RobotEntry,
        place: Placement,
        seed: int,
        commanders: Commanders,
        ages: Ages,
    ) -> None:
        self.entry, self.name, self.model = entry, entry.name, read_model(entry.model)
        self.namespace = "/" + (entry.namespace or entry.name).strip("/")
        wheels = self.model.wheels
        motors = (Motor(wheels.left_joint, wheels.torque), Motor(wheels.right_joint, wheels.torque)) if wheels else ()
        world.spawn(Body(entry.name, model_path(entry.model), place, motors))
        self.base = Base(wheels, entry.parameters, commanders, ages) if wheels else None
        self._node, self._world = node, world
        self._cmd_vel: Input[Any] = node.read(CMD_VEL, f"{self.namespace}/cmd_vel")
        self._e_stop: Input[Any] = node.read(E_STOP, f"{self.namespace}/e_stop")
        self._all_stop: Input[Any] = node.read(E_STOP, "/e_stop")
        self._touching: frozenset[str] = frozenset()
        self._collisions = 0
        self.telemetry = Telemetry(node, world, entry, self.model, self.namespace, seed)

    def close(self) -> None:
        """Leave the world and the network."""
        self._node.forget(self._cmd_vel, self._e_stop)
        self.telemetry.close()
        self._world.delete(self.name)

    def restart(self) -> None:
        """Begin anew where the world has put the body."""
        self._touching = frozenset()
        if self.base is not None:
            self.base.restart()
            self._world.set_speeds(self.name, (0.0, 0.0))
        self.telemetry.restart()

    def obey(self, now: int, governed: set[bytes], factor: float) -> None:
        """Take the commands and emergency stops that were admitted at this tick."""
        if self.base is not None:
            self.base.stop("robot", self._e_stop.batch)
            self.base.stop("all", self._all_stop.batch)
            if self._cmd_vel.batch:
                self.base.obey(self._cmd_vel.batch, now, governed, factor)

    def drive(self, now: int) -> None:
        """Set the wheels for the step that begins at ``now``."""
        if self.base is not None and (speeds := self.base.step(now)) is not None:
            self._world.set_speeds(self.name, speeds)

    def touch(self, others: frozenset[str]) -> None:
        """Note what the body touches; a collision counts once, when it begins."""
        self._collisions += len(others - self._touching)
        self._touching = others

    def report(self, now: int) -> None:
        """Publish what the base obeys and refuses."""
        if self.base is not None:
            touching, hits = bool(self._touching), self._collisions
            self.telemetry.status(self.base.status(now, self.entry.model, self._cmd_vel.refused, touching, hits))

    def state(self) -> ModelState:
        """Pose and twist, as requests tell them."""
        body = self._world.state(self.name)
        return ModelState(name=self.name, model=self.entry.model, pose=pose_of(body), twist=body_twist(body))
