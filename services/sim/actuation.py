"""Moves a robot, behind one Protocol: by the driver of a base, or by efforts on joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from messages.elea import BaseStatus
from messages.names import join
from messages.se3 import Pose3
from messages.simulation import DriveSettings
from messages.topics import BASE_STATUS, CMD_VEL, CMD_VEL_OUT, CMD_VEL_STAMPED, JOINT_COMMAND, JOINT_EFFORT, Topic
from models import display_name, physics_urdf_path
from models.model import RobotModel
from models.urdf import read_joint_limits
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.subscriber import Subscriber
from services.sim.adaptation import adapt_body
from services.sim.command_sources import CommandSources
from services.sim.drive.config import effective_parameters, odometry_config
from services.sim.drive.controller import DiffDriveController
from services.sim.drive.odometry import Odometer
from services.sim.drive.odometry_error import NO_ERROR
from services.sim.drive.planar_velocity import set_planar_velocity
from services.sim.drive.side_grip import SideGrip
from services.sim.drive.steering import SteeringServo
from services.sim.joints.config import check_positions
from services.sim.joints.effort_controller import JointEffortController
from services.sim.parameters import RobotEntry
from services.sim.physics.world import Body, BodyHandle, JointFriction, JointReadings, Motor, World
from services.sim.robot_names import robot_namespace
from services.sim.robot_parameters import BaseParameterSet, JointParameterSet
from services.sim.transit_delay import TransitDelayEstimator


class Actuation(Protocol):
    """Moves one robot according to commands, parameters and emergency stops. All times are simulation time, ns."""

    odometer: Odometer
    noise: bool
    """Whether the robot's sensors have noise."""
    command_topic: Topic[Any]
    """The topic of its commands."""
    extra_topics: tuple[Topic[Any], ...]
    """The topics that it publishes beside those of every robot."""
    applies_efforts: bool
    """Whether ``with_efforts`` returns anything but the measured efforts."""

    @property
    def parameters(self) -> ParameterSubscription[Any]:
        """The parameter subscription that ``reconfigure`` applies."""
        ...

    @property
    def step_controller(self) -> DiffDriveController | None:
        """The controller, if steps before its ``idle_until`` change nothing; None if every step has to be taken."""
        ...

    @property
    def odometry_rate(self) -> float:
        """Rate of odometry, Hz."""
        ...

    @property
    def publishes_odom_tf(self) -> bool:
        """Whether odometry is also published on ``/tf``."""
        ...

    @property
    def publishes_link_tf(self) -> bool:
        """Whether link transforms are published on ``/tf``; otherwise that is left to the service ``state``."""
        ...

    @property
    def commanded_velocity(self) -> tuple[float, float]:
        """The base's command after all limits: speed [m/s] and turn rate [rad/s]."""
        ...

    @property
    def joint_friction(self) -> Mapping[str, JointFriction]:
        """The joint friction set by parameters; for all other joints the URDF's holds."""
        ...

    def with_efforts(self, measured: JointReadings) -> JointReadings:
        """Return the measured joint readings with the efforts that act on the joints."""
        ...

    def effort_controller(self, joint: str) -> JointEffortController:
        """Return the effort controller of ``joint``; raises BadInput for a robot with a base."""
        ...

    def job_count(self, joint: str) -> int:
        """Return the number of jobs queued or acting on a joint."""
        ...

    def set_joints(self, positions: Mapping[str, float]) -> None:
        """Set joint positions [rad or m]; raises BadInput for a robot with a base, an overlap, or a position beyond a
        limit."""
        ...

    def set_drive(self, request: DriveSettings, now: int) -> DriveSettings:
        """Change a base's live parameters, and return all of them; raises BadInput for a robot without a base."""
        ...

    def apply_commands(self, commands: Subscriber[Any], now: int, lockstep_members: set[bytes], factor: float) -> None:
        """Apply the commands admitted at this tick."""
        ...

    def publisher_lost(self, source: bytes, now: int) -> None:
        """Handle the loss of the publisher ``source``."""
        ...

    def stop(self, on: bool) -> None:
        """Begin or end an emergency stop."""
        ...

    def step(self, now: int) -> None:
        """Set the motors for the physics step that begins at ``now``."""
        ...

    def reset(self, time_too: bool) -> None:
        """Discard all commands after a reset of the world; with ``time_too``, their counts restart at 0."""
        ...

    def reconfigure(self, now: int) -> None:
        """Apply the parameter changes admitted at this tick, each of them as a whole or not at all."""
        ...

    def status(
        self, now: int, refused: int, colliding: bool, collisions: int, stopped_by: tuple[str, ...]
    ) -> BaseStatus | None:
        """Return the status of the base; None without one."""
        ...

    def close(self) -> None:
        """Unsubscribe from the parameters."""
        ...


def spawn_actuation(
    node: Node,
    world: World,
    entry: RobotEntry,
    model: RobotModel,
    namespace: str,
    pose: Pose3,
    seed: int,
    command_sources: CommandSources,
    delays: TransitDelayEstimator,
    wait: bool,
) -> Actuation:
    """Spawn the body of a robot with its actuation; raises BadInput, and then leaves nothing behind."""
    if model.has_base:
        base = BaseParameterSet(node, namespace, entry, wait)
        body, grip = _spawn_body(world, entry, model, pose, base, motors=base.config.motors)
        return BaseActuation(node, body, entry, model, base, seed, command_sources, delays, grip)
    parameters = JointParameterSet(node, namespace, entry, wait)
    friction = tuple(parameters.config.joint_friction.items())
    body, _ = _spawn_body(world, entry, model, pose, parameters, joint_friction=friction)
    return JointActuation(node, world, body, entry, model, parameters, delays)


def _spawn_body(
    world: World,
    entry: RobotEntry,
    model: RobotModel,
    pose: Pose3,
    parameters: BaseParameterSet | JointParameterSet,
    motors: tuple[Motor, ...] = (),
    joint_friction: tuple[tuple[str, JointFriction], ...] = (),
) -> tuple[BodyHandle, SideGrip | None]:
    try:
        check_positions(entry.model, entry.joints)
        start = tuple(entry.joints.items())
        urdf = physics_urdf_path(entry.model)
        body = Body(entry.name, urdf, pose, motors, model.fixed_base, start, joint_friction)
        adapted = adapt_body(body, entry.model)
        spawned = world.spawn(adapted.body)
        return spawned, adapted.side_grip(spawned)
    except BadInput:
        parameters.close()
        raise


class BaseActuation:
    """A base that follows velocity commands: by its driven wheels or, if it is holonomic, with its whole body."""

    applies_efforts = False

    def __init__(
        self,
        node: Node,
        body: BodyHandle,
        entry: RobotEntry,
        model: RobotModel,
        parameters: BaseParameterSet,
        seed: int,
        command_sources: CommandSources,
        delays: TransitDelayEstimator,
        side_grip: SideGrip | None = None,
    ) -> None:
        self._body, self._entry, self._model, self._parameters = body, entry, model, parameters
        self._side_grip = side_grip
        steering = parameters.config.drive.steering
        self._servo = None if steering is None else SteeringServo(body, steering)
        self._wheel_targets: tuple[float, ...] = parameters.config.per_wheel((0.0, 0.0))
        self.controller = DiffDriveController(parameters.config, command_sources, delays, node.log)
        self.noise = parameters.parameters.noise
        config = odometry_config(model, parameters.parameters)
        self.odometer = Odometer(config, body, entry.name, self.controller, seed)
        if config.source == "encoder" and self.odometer.error != NO_ERROR:
            error = self.odometer.error.describe()
            node.log.info(
                f"{entry.name}: wheel odometry assumes a wrong wheel geometry (drawn from seed {seed}): {error}"
            )
        self._open_loop = config.source == "open loop"
        speed_driven = model.wheels is not None and parameters.config.gains is None
        self._only_speeds = speed_driven and side_grip is None and steering is None and not self._open_loop
        """Whether a physics step needs nothing but new wheel speeds, as for most bases."""
        self.command_topic: Topic[Any] = CMD_VEL_STAMPED if parameters.config.stamped else CMD_VEL
        self.extra_topics: tuple[Topic[Any], ...] = (
            (BASE_STATUS, CMD_VEL_OUT) if parameters.config.publish_cmd else (BASE_STATUS,)
        )

    @property
    def parameters(self) -> ParameterSubscription[Any]:
        return self._parameters.subscription

    @property
    def step_controller(self) -> DiffDriveController | None:
        return self.controller if self._only_speeds else None

    @property
    def odometry_rate(self) -> float:
        return self.controller.live.publish_rate

    @property
    def publishes_odom_tf(self) -> bool:
        return self.controller.live.enable_odom_tf

    @property
    def publishes_link_tf(self) -> bool:
        return self._entry.parameters.enable_link_tf is not False

    @property
    def commanded_velocity(self) -> tuple[float, float]:
        return self.controller.commanded_velocity

    @property
    def joint_friction(self) -> Mapping[str, JointFriction]:
        return {}

    def with_efforts(self, measured: JointReadings) -> JointReadings:
        return measured

    def effort_controller(self, joint: str) -> JointEffortController:
        name, namespace = self._entry.name, robot_namespace(self._entry)
        if joint in self._body.motor_joints:
            topic = join(namespace, CMD_VEL.name)
            raise BadInput(f"{name}::{joint} is a wheel, which its base drives: command {topic} instead")
        topic = join(namespace, JOINT_COMMAND.name)
        raise BadInput(
            f"{name}::{joint}: robots with a base accept no effort jobs: command the joint on {topic}, for example by "
            "a controller_manager"
        )

    def job_count(self, joint: str) -> int:
        return 0

    def set_joints(self, positions: Mapping[str, float]) -> None:
        raise BadInput(
            f"the joints of {self._entry.name} cannot be set, as they include the wheels, which odometry counts: use "
            "set_state"
        )

    def set_drive(self, request: DriveSettings, now: int) -> DriveSettings:
        self._parameters.set_drive(request)
        self.reconfigure(now)
        return self._parameters.drive_settings()

    def apply_commands(self, commands: Subscriber[Any], now: int, lockstep_members: set[bytes], factor: float) -> None:
        self.controller.apply_commands(commands.messages, now, lockstep_members, factor)

    def publisher_lost(self, source: bytes, now: int) -> None:
        self.controller.publisher_lost(source, now)

    def stop(self, on: bool) -> None:
        self.controller.stop(on)

    def step(self, now: int) -> None:
        speeds = self.controller.step(now)
        if speeds is None and self._only_speeds:
            return
        config = self.controller.config
        if self._model.wheels is None:
            set_planar_velocity(self._body, *self.controller.planar_velocity)
        elif self._servo is not None:
            if speeds is not None:
                self._wheel_targets = config.per_wheel(speeds)
            self._body.set_speeds((*self._wheel_targets, *self._servo.speeds(self.controller.steer)))
        elif config.gains is not None:
            self._body.set_torques(config.per_wheel(self.controller.torques(self._wheel_speeds())))
        elif speeds is not None:
            self._body.set_speeds(config.per_wheel(speeds))
        if self._side_grip is not None:
            self._side_grip.step()
        if self._open_loop:
            self.odometer.update_from_commands()

    def reset(self, time_too: bool) -> None:
        self.controller.reset()
        if time_too:
            self.controller.arbiter.clear_counts()
        if self._model.wheels is not None:
            config = self.controller.config
            self._wheel_targets = config.per_wheel((0.0, 0.0))
            self._body.set_speeds((*self._wheel_targets, *[0.0] * (len(config.motors) - len(self._wheel_targets))))

    def reconfigure(self, now: int) -> None:
        if not self._parameters.update():
            return
        self.controller.reconfigure(self._parameters.config, now)
        parameters = self._parameters.parameters
        self.noise = parameters.noise
        self.odometer.reconfigure(odometry_config(self._model, parameters))

    def status(
        self, now: int, refused: int, colliding: bool, collisions: int, stopped_by: tuple[str, ...]
    ) -> BaseStatus | None:
        return self.controller.status(now, display_name(self._entry.model), refused, colliding, collisions, stopped_by)

    def close(self) -> None:
        self._parameters.close()

    def _wheel_speeds(self) -> tuple[float, float]:
        """Return the mean turn rates of the left and the right wheels, rad/s."""
        speeds = dict(zip(self._body.joints, self._body.joint_readings().velocity, strict=True))
        return self.controller.config.side_means(speeds)


class JointActuation:
    """Joints driven by efforts, from a topic and by request; odometry, if any, is the true pose in the world."""

    command_topic: Topic[Any] = JOINT_EFFORT
    extra_topics: tuple[Topic[Any], ...] = ()
    commanded_velocity = 0.0, 0.0
    publishes_odom_tf = True
    step_controller = None
    applies_efforts = True

    def __init__(
        self,
        node: Node,
        world: World,
        body: BodyHandle,
        entry: RobotEntry,
        model: RobotModel,
        parameters: JointParameterSet,
        delays: TransitDelayEstimator,
    ) -> None:
        self._world, self._body, self._entry, self._parameters = world, body, entry, parameters
        limits, rule = read_joint_limits(entry.model), parameters.config.effort_rule
        self.controller = JointEffortController(body, entry.name, limits, rule, delays, node.log)
        config = odometry_config(model, effective_parameters(entry.model, model, entry.parameters))
        self.odometer = Odometer(config, body, entry.name, None)
        self.odometry_rate = model.odometry_rate
        self.noise = parameters.noise

    @property
    def parameters(self) -> ParameterSubscription[Any]:
        return self._parameters.subscription

    @property
    def publishes_link_tf(self) -> bool:
        return self._entry.joint_parameters.enable_link_tf

    @property
    def joint_friction(self) -> Mapping[str, JointFriction]:
        return self._parameters.config.joint_friction

    def with_efforts(self, measured: JointReadings) -> JointReadings:
        return JointReadings(measured.position, measured.velocity, tuple(self.controller.applied_efforts.values()))

    def effort_controller(self, joint: str) -> JointEffortController:
        return self.controller

    def job_count(self, joint: str) -> int:
        return len(self.controller.jobs(joint))

    def set_joints(self, positions: Mapping[str, float]) -> None:
        check_positions(self._entry.model, positions)
        self._world.set_joints(self._entry.name, positions)

    def set_drive(self, request: DriveSettings, now: int) -> DriveSettings:
        raise BadInput(f"{self._entry.name} is a {display_name(self._entry.model)}, which has no driven wheels")

    def apply_commands(self, commands: Subscriber[Any], now: int, lockstep_members: set[bytes], factor: float) -> None:
        self.controller.apply_commands(commands, now, lockstep_members, factor)

    def publisher_lost(self, source: bytes, now: int) -> None:
        self.controller.publisher_lost(source)

    def stop(self, on: bool) -> None:
        self.controller.stop(on)

    def step(self, now: int) -> None:
        self.controller.step(now)

    def reset(self, time_too: bool) -> None:
        self.controller.reset()

    def reconfigure(self, now: int) -> None:
        if self._parameters.update():
            self.controller.effort_rule, self.noise = self._parameters.config.effort_rule, self._parameters.noise
            self._body.set_joint_friction(self._parameters.config.joint_friction)

    def status(
        self, now: int, refused: int, colliding: bool, collisions: int, stopped_by: tuple[str, ...]
    ) -> BaseStatus | None:
        return None

    def close(self) -> None:
        self._parameters.close()
