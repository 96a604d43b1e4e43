"""One robot in the world: its body, its base, and what it reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from messages.elea import ModelState
from messages.geometry import TwistStamped
from messages.simulation import DriveSettings
from messages.topics import CMD_VEL, E_STOP, JOINT_EFFORT, Topic
from models import model_path
from models.figures import Model, read_model
from models.limits import read_limits
from services.runtime.errors import BadInput
from services.runtime.inputs import Input
from services.runtime.node import Node
from services.sim import RobotEntry
from services.sim.ages import Ages
from services.sim.base.base import Base
from services.sim.base.parameter_set import BaseSet
from services.sim.base.settings import effective, odometry_settings
from services.sim.commanders import Commanders
from services.sim.joints.actuators import Actuators
from services.sim.joints.parameter_set import JointSet
from services.sim.joints.terms import positions
from services.sim.physics.world import Body, Motor, Placement, Resistance, World
from services.sim.sensors.odometer import Odometer
from services.sim.sensors.odometry import body_twist, pose_of
from services.sim.telemetry import Telemetry

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
        kind = BaseSet if self.model.wheels else JointSet
        self._set = kind(node, self.namespace, entry, wait)
        try:
            positions(entry.model, entry.joints)
            world.spawn(_body(entry, self.model, place, self._set))
        except BadInput:
            self._set.close()
            raise
        self.base, self.actuators = None, None
        if isinstance(self._set, BaseSet):
            parameters, settings = self._set.parameters, self._set.settings
            noise = parameters.noise
            self.base = Base(settings, commanders, ages, node.log)
            commands: Topic[Any] = CMD_VEL_STAMPED if settings.stamped else CMD_VEL
        else:
            parameters = effective(entry.model, self.model, entry.parameters)
            noise, limits, commands = self._set.noise, read_limits(entry.model), JOINT_EFFORT
            self.actuators = Actuators(world, entry.name, limits, self._set.terms.rule, ages, node.log)
        self._node, self._world = node, world
        self._commands: Input[Any] = node.read(commands, f"{self.namespace}/{commands.name}")
        self.e_stop: Input[Any] = node.read(E_STOP, f"{self.namespace}/e_stop")
        self._stopped_by: tuple[str, ...] = ()
        self._touching: frozenset[str] = frozenset()
        self._collisions = 0
        odometer = Odometer(odometry_settings(self.model, parameters), world, entry.name, self.base)
        self.telemetry = Telemetry(
            node, world, entry, self.model, self.namespace, seed, self.base, self.actuators, odometer, noise
        )
        self._follows = self.base is not None and odometer.settings.source == "open loop"

    def close(self) -> None:
        """Leave the world and the network."""
        self._set.close()
        self._node.forget(self._commands, self.e_stop)
        self.telemetry.close()
        self._world.delete(self.name)

    def restart(self) -> None:
        """Begin anew where the world has put the body."""
        self._touching = frozenset()
        if self.base is not None:
            self.base.restart()
            self._world.set_speeds(self.name, (0.0, 0.0))
        if self.actuators is not None:
            self.actuators.restart()
        self.telemetry.restart()

    def follow(self, now: int) -> None:
        """Take the changes of parameters that were admitted at this tick, all of one or none."""
        if not self._set.follow():
            return
        if isinstance(self._set, BaseSet):
            self._retune(self._set, now)
        else:
            self._stiffen(self._set)

    def obey(self, now: int, governed: set[bytes], factor: float) -> None:
        """Take the commands that were admitted at this tick."""
        if self.base is not None and self._commands.batch:
            self.base.obey(self._commands.batch, now, governed, factor)
        if self.actuators is not None:
            self.actuators.obey(self._commands, now, governed, factor)

    def stop(self, holders: tuple[str, ...], asked: bool = False) -> None:
        """Stand still while there are ``holders`` of an emergency stop.

        ``asked`` tells that a stop has come since the last call, were it reset already: what was commanded before it
        moves nothing after it.
        """
        self._stopped_by = holders
        for driven in (self.base, self.actuators):
            if driven is not None:
                if asked:
                    driven.stop(True)
                driven.stop(bool(holders))

    def lost(self, source: bytes, now: int) -> None:
        """The publisher ``source`` is gone."""
        if self.base is not None:
            self.base.arbiter.lost(source, now)
        if self.actuators is not None:
            self.actuators.lost(source)

    def drive(self, now: int) -> None:
        """Set the wheels, or put efforts on the joints, for the step that begins at ``now``."""
        if self.actuators is not None:
            self.actuators.step(now)
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
            refused = self._commands.refused
            self.telemetry.status(self.base.status(now, self.entry.model, refused, touching, hits, self._stopped_by))

    def change(self, asked: DriveSettings, now: int) -> DriveSettings:
        """Replace the base's live parameters; returns all of them. Raises BadInput for a robot without a base."""
        if not isinstance(self._set, BaseSet):
            raise BadInput(f"{self.name} is a {self.entry.model}, which has no driven wheels")
        self._set.change(asked)
        self.follow(now)
        return self._set.drive_settings()

    def state(self) -> ModelState:
        """Pose and twist, as requests tell them."""
        body = self._world.state(self.name)
        return ModelState(name=self.name, model=self.entry.model, pose=pose_of(body), twist=body_twist(body))

    @property
    def placement(self) -> Placement:
        """Where the root is now."""
        state = self._world.state(self.name)
        return Placement(state.position, state.orientation)

    @property
    def resistance(self) -> Mapping[str, Resistance]:
        """What the joints of a model without wheels resist; of one with wheels nothing is told."""
        return self._set.terms.resistance if isinstance(self._set, JointSet) else {}

    def _retune(self, to: BaseSet, now: int) -> None:
        assert self.base is not None
        rate, made, parameters = self.base.live.publish_rate, to.settings, to.parameters
        self.base.retune(made, now)
        self.telemetry.noise = parameters.noise
        self.telemetry.odometer.retune(odometry_settings(self.model, parameters))
        if made.live.publish_rate != rate:
            self.telemetry.odometer.retime()

    def _stiffen(self, to: JointSet) -> None:
        assert self.actuators is not None
        self.actuators.rule, self.telemetry.noise = to.terms.rule, to.noise
        self._world.resist(self.name, to.terms.resistance)

    def _turns(self) -> tuple[float, float]:
        """How fast the wheels turn, rad/s."""
        assert self.base is not None
        turns = dict(zip(self._world.joints(self.name), self._world.joint_readings(self.name).velocity, strict=True))
        return turns[self.base.settings.left_joint], turns[self.base.settings.right_joint]


def _body(entry: RobotEntry, model: Model, place: Placement, of: BaseSet | JointSet) -> Body:
    urdf, start = model_path(entry.model), tuple(entry.joints.items())
    if isinstance(of, JointSet):
        return Body(entry.name, urdf, place, (), model.fixed_base, start, tuple(of.terms.resistance.items()))
    settings = of.settings
    motors = Motor(settings.left_joint, settings.torque), Motor(settings.right_joint, settings.torque)
    return Body(entry.name, urdf, place, motors, model.fixed_base, start)
