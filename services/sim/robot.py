"""One robot in the world: its body, its base, and what it reads."""

from __future__ import annotations

from typing import Any

from messages.elea import ModelState
from messages.geometry import TwistStamped
from messages.requests import DriveSettings
from messages.topics import CMD_VEL, E_STOP, Topic
from models import model_path
from models.figures import read_model
from services.runtime.errors import BadInput
from services.runtime.inputs import Input
from services.runtime.node import Node
from services.sim import RobotEntry
from services.sim.base import Base
from services.sim.base_set import BaseSet
from services.sim.commanders import Ages, Commanders
from services.sim.odometer import Odometer
from services.sim.odometry import body_twist, pose_of
from services.sim.settings import Settings, effective, odometry_settings
from services.sim.telemetry import Telemetry
from services.sim.world import Body, Motor, Placement, World

CMD_VEL_STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, CMD_VEL.quality, "velocity command with its time")
"""What a base reads instead of ``CMD_VEL`` when ``use_stamped_vel`` is set."""


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
        wait: bool = False,
    ) -> None:
        self.entry, self.name, self.model = entry, entry.name, read_model(entry.model)
        self.namespace = "/" + (entry.namespace or entry.name).strip("/")
        # A model without wheels has no base; the parameters of its joints would be a set of their own beside this one.
        self._set = BaseSet(node, self.namespace, entry, wait) if self.model.wheels else None
        settings = self._set.settings if self._set else None
        parameters = self._set.parameters if self._set else effective(entry.model, self.model, entry.parameters)
        try:
            world.spawn(Body(entry.name, model_path(entry.model), place, _motors(settings)))
        except BadInput:
            if self._set is not None:
                self._set.close()
            raise
        self.base = Base(settings, commanders, ages, node.log) if settings else None
        self._node, self._world = node, world
        commands = CMD_VEL_STAMPED if settings and settings.stamped else CMD_VEL
        self._cmd_vel: Input[Any] = node.read(commands, f"{self.namespace}/cmd_vel")
        self._e_stop: Input[Any] = node.read(E_STOP, f"{self.namespace}/e_stop")
        self._all_stop: Input[Any] = node.read(E_STOP, "/e_stop")
        self._touching: frozenset[str] = frozenset()
        self._collisions = 0
        odometer = Odometer(odometry_settings(self.model, parameters), world, entry.name, self.base)
        self.telemetry = Telemetry(node, world, entry, self.model, self.namespace, seed, self.base, odometer)
        self.telemetry.noise = parameters.noise
        self._follows = self.base is not None and odometer.settings.source == "open loop"

    def close(self) -> None:
        """Leave the world and the network."""
        if self._set is not None:
            self._set.close()
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

    def follow(self, now: int) -> None:
        """Take the changes of parameters that were admitted at this tick, all of one or none."""
        if self._set is not None and self._set.follow():
            self._retune(now)

    def obey(self, now: int, governed: set[bytes], factor: float) -> None:
        """Take the commands and emergency stops that were admitted at this tick."""
        if self.base is not None:
            self.base.stop("robot", self._e_stop.batch)
            self.base.stop("all", self._all_stop.batch)
            if self._cmd_vel.batch:
                self.base.obey(self._cmd_vel.batch, now, governed, factor)

    def drive(self, now: int) -> None:
        """Set the wheels for the step that begins at ``now``."""
        base = self.base
        if base is None:
            return
        speeds = base.step(now)
        if base.settings.gains is not None:
            self._world.set_torques(self.name, base.torques(self._turns()))
        elif speeds is not None:
            self._world.set_speeds(self.name, speeds)
        if self._follows:
            self.telemetry.odometer.step()

    def touch(self, others: frozenset[str]) -> None:
        """Note what the body touches; a collision counts once, when it begins."""
        self._collisions += len(others - self._touching)
        self._touching = others

    def report(self, now: int) -> None:
        """Publish what the base obeys and refuses."""
        if self.base is not None:
            touching, hits = bool(self._touching), self._collisions
            self.telemetry.status(self.base.status(now, self.entry.model, self._cmd_vel.refused, touching, hits))

    def change(self, asked: DriveSettings, now: int) -> DriveSettings:
        """Replace the base's live parameters; returns all of them. Raises BadInput for a robot without a base."""
        if self._set is None:
            raise BadInput(f"{self.name} is a {self.entry.model}, which has no driven wheels")
        self._set.change(asked)
        self.follow(now)
        return self._set.drive_settings()

    def state(self) -> ModelState:
        """Pose and twist, as requests tell them."""
        body = self._world.state(self.name)
        return ModelState(name=self.name, model=self.entry.model, pose=pose_of(body), twist=body_twist(body))

    def _retune(self, now: int) -> None:
        assert self._set is not None
        assert self.base is not None
        rate, made = self.base.live.publish_rate, self._set.settings
        self.base.retune(made, now)
        self.telemetry.noise = self._set.parameters.noise
        self.telemetry.odometer.retune(odometry_settings(self.model, self._set.parameters))
        if made.live.publish_rate != rate:
            self.telemetry.odometer.retime()

    def _turns(self) -> tuple[float, float]:
        """How fast the wheels turn, rad/s."""
        assert self.base is not None
        turns = dict(zip(self._world.joints(self.name), self._world.joint_readings(self.name).velocity, strict=True))
        return turns[self.base.settings.left_joint], turns[self.base.settings.right_joint]


def _motors(settings: Settings | None) -> tuple[Motor, ...]:
    if settings is None:
        return ()
    return Motor(settings.left_joint, settings.torque), Motor(settings.right_joint, settings.torque)
