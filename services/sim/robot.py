"""One robot in the world: its body, its controllers, its inputs and its publishers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from messages.elea import ModelState
from messages.geometry import TwistStamped
from messages.se3 import Pose3
from messages.simulation import DriveSettings
from messages.topics import CMD_VEL, E_STOP, JOINT_EFFORT, Topic
from models import urdf_path
from models.model import RobotModel, read_model
from models.urdf import read_joint_limits
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.sim import RobotEntry
from services.sim.command_sources import CommandSources
from services.sim.drive.config import effective_parameters, odometry_config
from services.sim.drive.controller import DiffDriveController
from services.sim.drive.odometry import Odometer, body_pose, body_twist
from services.sim.joints.config import check_positions
from services.sim.joints.effort_controller import JointEffortController
from services.sim.physics.world import Body, JointFriction, Motor, World
from services.sim.publishers import RobotPublishers
from services.sim.robot_parameters import BaseParameterSet, JointParameterSet
from services.sim.transit_delay import TransitDelayEstimator

CMD_VEL_STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, CMD_VEL.quality, "velocity command with its time")
"""What a base reads instead of ``CMD_VEL`` when ``use_stamped_vel`` is set."""


class Robot:
    """A model in the world as ``entry.name``; its topics lie in its namespace, its frames carry its name."""

    def __init__(
        self,
        node: Node,
        world: World,
        entry: RobotEntry,
        pose: Pose3,
        seed: int,
        command_sources: CommandSources,
        delays: TransitDelayEstimator,
        wait: bool = False,
    ) -> None:
        self.entry, self.name, self.model = entry, entry.name, read_model(entry.model)
        self.namespace = "/" + (entry.namespace or entry.name).strip("/")
        kind = BaseParameterSet if self.model.wheels else JointParameterSet
        self._parameter_set = kind(node, self.namespace, entry, wait)
        try:
            check_positions(entry.model, entry.joints)
            world.spawn(_body(entry, self.model, pose, self._parameter_set))
        except BadInput:
            self._parameter_set.close()
            raise
        self.drive_controller, self.effort_controller = None, None
        if isinstance(self._parameter_set, BaseParameterSet):
            parameters, settings = self._parameter_set.parameters, self._parameter_set.config
            noise = parameters.noise
            self.drive_controller = DiffDriveController(settings, command_sources, delays, node.log)
            commands: Topic[Any] = CMD_VEL_STAMPED if settings.stamped else CMD_VEL
        else:
            parameters = effective_parameters(entry.model, self.model, entry.parameters)
            noise, limits, commands = self._parameter_set.noise, read_joint_limits(entry.model), JOINT_EFFORT
            self.effort_controller = JointEffortController(
                world, entry.name, limits, self._parameter_set.config.effort_rule, delays, node.log
            )
        self._node, self._world = node, world
        self._command_subscriber: Subscriber[Any] = node.subscribe(commands, f"{self.namespace}/{commands.name}")
        self.e_stop_subscriber: Subscriber[Any] = node.subscribe(E_STOP, f"{self.namespace}/e_stop")
        self._stopped_by: tuple[str, ...] = ()
        self._contacts: frozenset[str] = frozenset()
        self._collisions = 0
        odometer = Odometer(odometry_config(self.model, parameters), world, entry.name, self.drive_controller)
        self.publishers = RobotPublishers(
            node,
            world,
            entry,
            self.model,
            self.namespace,
            seed,
            self.drive_controller,
            self.effort_controller,
            odometer,
            noise,
        )
        self._open_loop = self.drive_controller is not None and odometer.config.source == "open loop"

    def close(self) -> None:
        """Leave the world and the network."""
        self._parameter_set.close()
        self._node.unregister(self._command_subscriber, self.e_stop_subscriber)
        self.publishers.close()
        self._world.delete(self.name)

    def reset(self) -> None:
        """Begin anew where the world has put the body."""
        self._contacts = frozenset()
        if self.drive_controller is not None:
            self.drive_controller.reset()
            self._world.set_speeds(self.name, (0.0, 0.0))
        if self.effort_controller is not None:
            self.effort_controller.reset()
        self.publishers.reset()

    def update_parameters(self, now: int) -> None:
        """Take the changes of parameters that were admitted at this tick, all of one or none."""
        if not self._parameter_set.update():
            return
        if isinstance(self._parameter_set, BaseParameterSet):
            self._apply_drive_config(self._parameter_set, now)
        else:
            self._apply_joint_config(self._parameter_set)

    def apply_commands(self, now: int, lockstep_members: set[bytes], factor: float) -> None:
        """Take the commands that were admitted at this tick."""
        if self.drive_controller is not None and self._command_subscriber.messages:
            self.drive_controller.apply_commands(self._command_subscriber.messages, now, lockstep_members, factor)
        if self.effort_controller is not None:
            self.effort_controller.apply_commands(self._command_subscriber, now, lockstep_members, factor)

    def stop(self, holders: tuple[str, ...], new_stop: bool = False) -> None:
        """Stand still while there are ``holders`` of an emergency stop.

        ``new_stop`` tells that a stop has come since the last call, were it reset already: what was commanded before it
        moves nothing after it.
        """
        self._stopped_by = holders
        for driven in (self.drive_controller, self.effort_controller):
            if driven is not None:
                if new_stop:
                    driven.stop(True)
                driven.stop(bool(holders))

    def publisher_lost(self, source: bytes, now: int) -> None:
        """The publisher ``source`` is gone."""
        if self.drive_controller is not None:
            self.drive_controller.arbiter.publisher_lost(source, now)
        if self.effort_controller is not None:
            self.effort_controller.publisher_lost(source)

    def actuate(self, now: int) -> None:
        """Set the wheels, or put efforts on the joints, for the step that begins at ``now``."""
        if self.effort_controller is not None:
            self.effort_controller.step(now)
        base = self.drive_controller
        if base is None:
            return
        speeds = base.step(now)
        if base.config.gains is not None:
            self._world.set_torques(self.name, base.torques(self._wheel_speeds()))
        elif speeds is not None:
            self._world.set_speeds(self.name, speeds)
        if self._open_loop:
            self.publishers.odometer.update_from_commands()

    def update_contacts(self, others: frozenset[str]) -> None:
        """Note what the body touches; a collision counts once, when it begins."""
        self._collisions += len(others - self._contacts)
        self._contacts = others

    def publish_status(self, now: int) -> None:
        """Publish what the base obeys and refuses."""
        if self.drive_controller is not None:
            touching, hits = bool(self._contacts), self._collisions
            refused = self._command_subscriber.refused
            self.publishers.publish_status(
                self.drive_controller.status(now, self.entry.model, refused, touching, hits, self._stopped_by)
            )

    def set_drive(self, request: DriveSettings, now: int) -> DriveSettings:
        """Replace the base's live parameters; returns all of them. Raises BadInput for a robot without a base."""
        if not isinstance(self._parameter_set, BaseParameterSet):
            raise BadInput(f"{self.name} is a {self.entry.model}, which has no driven wheels")
        self._parameter_set.set_drive(request)
        self.update_parameters(now)
        return self._parameter_set.drive_settings()

    def state(self) -> ModelState:
        """Pose and twist, as requests tell them."""
        body = self._world.state(self.name)
        return ModelState(name=self.name, model=self.entry.model, pose=body_pose(body), twist=body_twist(body))

    @property
    def pose(self) -> Pose3:
        """Where the root is now."""
        state = self._world.state(self.name)
        return Pose3(state.position, state.orientation)

    @property
    def joint_friction(self) -> Mapping[str, JointFriction]:
        """What the joints of a model without wheels resist; of one with wheels nothing is told."""
        return self._parameter_set.config.joint_friction if isinstance(self._parameter_set, JointParameterSet) else {}

    def _apply_drive_config(self, to: BaseParameterSet, now: int) -> None:
        assert self.drive_controller is not None
        rate, made, parameters = self.drive_controller.live.publish_rate, to.config, to.parameters
        self.drive_controller.reconfigure(made, now)
        self.publishers.noise = parameters.noise
        self.publishers.odometer.reconfigure(odometry_config(self.model, parameters))
        if made.live.publish_rate != rate:
            self.publishers.odometer.reset_phase()

    def _apply_joint_config(self, to: JointParameterSet) -> None:
        assert self.effort_controller is not None
        self.effort_controller.effort_rule, self.publishers.noise = to.config.effort_rule, to.noise
        self._world.set_joint_friction(self.name, to.config.joint_friction)

    def _wheel_speeds(self) -> tuple[float, float]:
        """How fast the wheels turn, rad/s."""
        assert self.drive_controller is not None
        turns = dict(zip(self._world.joints(self.name), self._world.joint_readings(self.name).velocity, strict=True))
        return turns[self.drive_controller.config.left_joint], turns[self.drive_controller.config.right_joint]


def _body(entry: RobotEntry, model: RobotModel, pose: Pose3, of: BaseParameterSet | JointParameterSet) -> Body:
    urdf, start = urdf_path(entry.model), tuple(entry.joints.items())
    if isinstance(of, JointParameterSet):
        return Body(entry.name, urdf, pose, (), model.fixed_base, start, tuple(of.config.joint_friction.items()))
    settings = of.config
    motors = Motor(settings.left_joint, settings.torque), Motor(settings.right_joint, settings.torque)
    return Body(entry.name, urdf, pose, motors, model.fixed_base, start)
