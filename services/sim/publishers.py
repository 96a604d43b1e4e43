"""The publishers of each robot's topics, and of the states of all models, links and bodies of the world."""

from __future__ import annotations

from collections.abc import Sequence
from time import time_ns
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages.base import Packed36
from messages.elea import BaseStatus
from messages.gazebo import LinkStates, ModelStates, WorldStates
from messages.geometry import Twist, TwistStamped
from messages.std import Header, String, Time
from messages.template import Template
from messages.topics import (
    BASE_STATUS,
    CMD_VEL_OUT,
    GROUND_TRUTH,
    JOINT_FEEDBACK,
    JOINT_STATES,
    LINK_STATES,
    MODEL_STATES,
    ODOM,
    ROBOT_DESCRIPTION,
    WORLD_STATES,
    Topic,
)
from models import urdf_path
from models.model import RobotModel
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.sim.actuation import Actuation
from services.sim.drive.odometry import (
    ZERO_COVARIANCE,
    OdometrySample,
    odometry_message,
    odometry_motions,
    world_motions,
)
from services.sim.entities import pose_and_twist
from services.sim.joints.motors import JointMotors
from services.sim.parameters import RobotEntry
from services.sim.physics.world import BodyHandle, BodyState, JointReadings, World
from services.sim.robot_names import odometry_child, robot_frame_prefix
from services.sim.robot_topics import RobotPublisher, RobotTopicGroup, is_due, steps_of, topic_names
from services.sim.sensor_publishers import SensorContext, robot_sensors
from services.sim.sensors import joint_state
from services.sim.snapshot import FEW, Snapshot
from services.sim.template_groups import GroupEncoder, TemplateGroup


class RobotPublishers:
    """The publishers of one robot. Costly messages are made only while the topic has subscribers."""

    def __init__(
        self,
        node: Node,
        world: World,
        entry: RobotEntry,
        model: RobotModel,
        namespace: str,
        seed: int,
        actuation: Actuation,
        motors: JointMotors,
    ) -> None:
        self._node, self._model, self._namespace = node, model, namespace
        self._actuation, self.odometer, self.name = actuation, actuation.odometer, entry.name
        self._motors, self.joints = motors, world.body(entry.name).joints
        self._frame_prefix = robot_frame_prefix(entry)
        self.odometry_child = odometry_child(model, entry.parameters, self._frame_prefix)
        """The child frame of odometry, without the frame prefix."""
        self._base_frame = self.frame_id(model.base_frame)
        self.joint_state_steps = max(1, steps_of(entry.joint_state_rate or model.joint_rate or model.odometry_rate))
        self.truth_rate = model.odometry_rate
        self._publishers: list[RobotPublisher] = []
        self.truth, self.joint_states = self._publisher(GROUND_TRUTH), self._publisher(JOINT_STATES)
        self._publisher(ROBOT_DESCRIPTION).publish(String(data=urdf_path(entry.model).read_text(encoding="utf-8")))
        self.odometry_publisher = None if model.fixed_base else self._publisher(ODOM)
        extra = {topic: self._publisher(topic) for topic in actuation.extra_topics}
        self._status, self._commanded = extra.get(BASE_STATUS), extra.get(CMD_VEL_OUT)
        self._feedback: RobotPublisher | None = None
        context = SensorContext(
            world, entry.name, entry.model, seed, self._publisher, self.frame_id, actuation, node.log.warn
        )
        self.sensors = robot_sensors(context, model)
        for each in self._publishers:  # not before all topics have their own names
            each.advertise_aliases()
        self.truth_template = self._odometry_template("world", self._base_frame, ZERO_COVARIANCE, ZERO_COVARIANCE)
        self._odometry_template_of: tuple[Packed36, Packed36, Template[Any]] | None = None
        self.joint_template = Template(self._joint_state, 3 * len(self.joints))
        self._command_template = Template(self._command, 2)
        self.joints_subscribed = self.odometry_subscribed = False
        """Whether joint states and odometry have subscribers, as of the last ``update_subscriptions``."""
        self.reset()

    def close(self) -> None:
        """Close all publishers."""
        self._node.unregister(*(end for each in self._publishers for end in each.ends))

    def reset(self) -> None:
        """Restart from where the body is."""
        self.odometer.reset()
        self.odometry: tuple[bytes, OdometrySample] | None = None
        """The stamp and sample of the last odometry that was due."""

    def update_subscriptions(self) -> None:
        """Update which topics have subscribers."""
        self.joints_subscribed = bool(self.joints) and self.joint_states.has_subscribers
        self.odometry_subscribed = self.odometry_publisher is not None and self.odometry_publisher.has_subscribers

    def frame_id(self, link: str) -> str:
        """Return the frame id of a link, with the robot's frame prefix."""
        return f"{self._frame_prefix}{link}"

    @property
    def joints_as_measured(self) -> bool:
        """Whether the joint states are the plain measurements, published at their own rate."""
        return not (self._motors.commanded or self._actuation.applies_efforts)

    def publish_joint_states(self, snapshot: Snapshot) -> None:
        """Publish the joints if they are due, and feedback at every tick if a controller manager commands them."""
        due, commanded = self._joint_states_due(snapshot), self._motors.commanded
        if not (due or commanded):
            return
        readings = self._motors.readings(self._actuation.with_efforts(snapshot.joints(self.name)))
        payload = self.joint_template.encode(snapshot.stamp, [*readings.position, *readings.velocity, *readings.effort])
        if due:
            self.joint_states.publish_encoded(payload)
        if commanded:
            if self._feedback is None:
                self._feedback = self._publisher(JOINT_FEEDBACK)
            self._feedback.publish_encoded(payload)

    def _joint_states_due(self, snapshot: Snapshot) -> bool:
        return self.joints_subscribed and snapshot.tick % self.joint_state_steps == 0

    @property
    def command_subscribed(self) -> bool:
        """Whether the limited command is published and has subscribers."""
        return self._commanded is not None and self._commanded.has_subscribers

    def publish_command(self, snapshot: Snapshot) -> None:
        """Publish the limited command."""
        assert self._commanded is not None
        velocity = self._actuation.commanded_velocity
        self._commanded.publish_encoded(self._command_template.encode(snapshot.stamp, velocity))

    def sample_odometry(self, snapshot: Snapshot) -> OdometrySample | None:
        """Sample odometry if it is due; return None if it is not, or has no subscribers."""
        if self.odometry_publisher is None or not is_due(snapshot.now, self._actuation.odometry_rate):
            return None
        sample = self.odometer.sample(snapshot)
        self.odometry = snapshot.stamp, sample
        return sample if self.odometry_subscribed else None

    def publish_status(self, status: BaseStatus) -> None:
        """Publish the status of the base."""
        assert self._status is not None
        self._status.publish(status)

    def _publisher(self, topic: Topic[Any]) -> RobotPublisher:
        made = RobotPublisher(self._node, topic, topic_names(topic, self._model, self._namespace))
        self._publishers.append(made)
        return made

    def _joint_state(self, stamp: Time, numbers: Sequence[float]) -> Any:
        count = len(self.joints)
        parts = (tuple(numbers[first : first + count]) for first in (0, count, 2 * count))
        return joint_state(self.joints, JointReadings(*parts), Header(stamp=stamp))

    def _command(self, stamp: Time, numbers: Sequence[float]) -> TwistStamped:
        linear, angular = numbers
        return TwistStamped(header=Header(stamp=stamp, frame_id=self._base_frame), twist=Twist.planar(linear, angular))

    @property
    def odometry_template(self) -> Template[Any]:
        """The template with the current covariances of odometry."""
        pose, twist, of = self.odometer.pose_covariance, self.odometer.twist_covariance, self._odometry_template_of
        if of is None or of[0] is not pose or of[1] is not twist:
            frame, child = self.frame_id(self._model.odom_frame), self.frame_id(self.odometry_child)
            of = self._odometry_template_of = pose, twist, self._odometry_template(frame, child, pose, twist)
        return of[2]

    def _odometry_template(self, frame: str, child: str, pose: Packed36, twist: Packed36) -> Template[Any]:
        return Template(
            lambda stamp, numbers: odometry_message(Header(stamp=stamp, frame_id=frame), child, numbers, pose, twist),
            13,
        )


class _SubscribedTopics(NamedTuple):
    """The same topic of several robots, with subscribers and due at the same times."""

    names: tuple[str, ...]
    topics: RobotTopicGroup


class MotionPublisher:
    """Publishes the motion of all robots; what is due together is computed and encoded together."""

    def __init__(self) -> None:
        self._odometry = GroupEncoder()
        self.update_subscriptions(())

    def update_subscriptions(self, robots: Sequence[RobotPublishers]) -> None:
        """Set the robots, and update which of their topics have subscribers."""
        for each in robots:
            each.update_subscriptions()
        self._robots = robots
        self._commands = [each for each in robots if each.command_subscribed]
        self._placed: dict[float, list[str]] = {}
        """By rate [Hz], the robots whose body states are published."""
        truths: dict[float, list[RobotPublishers]] = {}
        measured: dict[tuple[int, int], list[RobotPublishers]] = {}
        self._single_joints: list[RobotPublishers] = []
        """Robots whose joint states are published one by one: those that differ from the plain measurements, and all
        of a few robots."""
        for each in robots:
            if each.truth.has_subscribers:
                truths.setdefault(each.truth_rate, []).append(each)
            if each.truth.has_subscribers or each.odometer.state is None:
                self._placed.setdefault(each.truth_rate, []).append(each.name)
            if not each.joints_as_measured or len(robots) <= FEW:
                self._single_joints.append(each)
            elif each.joints_subscribed:
                measured.setdefault((each.joint_state_steps, len(each.joints)), []).append(each)
        self._truths = [
            (
                rate,
                _SubscribedTopics(
                    tuple(each.name for each in group),
                    RobotTopicGroup([each.truth for each in group], [each.truth_template for each in group]),
                ),
            )
            for rate, group in truths.items()
        ]
        self._joint_states = [
            (
                steps,
                _SubscribedTopics(
                    tuple(each.name for each in group),
                    RobotTopicGroup([each.joint_states for each in group], [each.joint_template for each in group]),
                ),
            )
            for (steps, _), group in measured.items()
        ]

    def publish_joint_states(self, snapshot: Snapshot) -> None:
        """Publish the joint states that are due."""
        for steps, (names, topics) in self._joint_states:
            if snapshot.tick % steps == 0:
                rows = snapshot.joint_rows(names).reshape(3, len(names), -1)
                topics.publish(snapshot.stamp, rows.swapaxes(0, 1).reshape(len(names), -1))
        for robot in self._single_joints:
            robot.publish_joint_states(snapshot)

    def publish(self, snapshot: Snapshot) -> None:
        """At a control tick, publish the limited commands, ground truth and odometry that are due."""
        snapshot.read_states(
            [name for rate, names in self._placed.items() if is_due(snapshot.now, rate) for name in names]
        )
        for each in self._commands:
            each.publish_command(snapshot)
        for rate, (names, topics) in self._truths:
            if is_due(snapshot.now, rate):
                topics.publish(snapshot.stamp, world_motions(snapshot.states(names)))
        sampled = [(each, sample) for each in self._robots if (sample := each.sample_odometry(snapshot)) is not None]
        if sampled:
            motions = odometry_motions([sample for _, sample in sampled])
            payloads = self._odometry.encode([each.odometry_template for each, _ in sampled], snapshot.stamp, motions)
            now = time_ns()
            for (each, _), payload in zip(sampled, payloads, strict=True):
                assert each.odometry_publisher is not None
                each.odometry_publisher.publish_encoded(payload, now)


class WorldStatesPublisher:
    """Publishes the world's movable and moving bodies, in the order of its file; without any it advertises nothing."""

    def __init__(self, node: Node, world: World) -> None:
        self._world = world
        self._publisher: Publisher[Any] | None = node.advertise(WORLD_STATES) if world.world_bodies else None

    def publish(self, now: int, tick: int) -> None:
        """Publish the states if they are due at ``tick``, whose time is ``now`` [ns]."""
        if self._publisher is None or tick % steps_of(WORLD_STATES.rate) or not self._publisher.has_subscribers:
            return
        names = self._world.world_bodies
        states = [pose_and_twist(self._world.world_body_state(name)) for name in names]
        poses, twists = tuple(pose for pose, _ in states), tuple(twist for _, twist in states)
        header = Header(stamp=Time.of(now), frame_id="world")
        self._publisher.publish(WorldStates(header=header, name=names, pose=poses, twist=twists))


class GazeboStatesPublisher:
    """Publishes the states of all models, in the order of spawning, and of their links, root first, in world axes.

    The world's movable and moving bodies follow as models, as in Gazebo.
    """

    def __init__(self, node: Node, world: World) -> None:
        self._world = world
        self._models: Publisher[Any] = node.advertise(MODEL_STATES)
        self._links: Publisher[Any] = node.advertise(LINK_STATES)
        self._model_encoder, self._link_encoder = _StatesEncoder(ModelStates), _StatesEncoder(LinkStates)
        self._bodies: list[BodyHandle] = []
        self._body_links: tuple[tuple[str, str], ...] = ()
        self._link_names: tuple[str, ...] = ()
        """Scoped names of the links of these bodies."""

    def publish(self, snapshot: Snapshot) -> None:
        """Publish the current states."""
        world = self._world
        if self._models.has_subscribers:
            rows = snapshot.states(world.names)
            if world.world_bodies:
                others = [world.world_body_state(name).numbers for name in world.world_bodies]
                rows = np.concatenate((rows, others))
            payload = self._model_encoder.encode((*world.names, *world.world_bodies), rows)
            self._models.publish_encoded(payload)
        if self._links.has_subscribers:
            self._update_links()
            rows = world.link_states(self._body_links)
            self._links.publish_encoded(self._link_encoder.encode(self._link_names, rows))

    def _update_links(self) -> None:
        """Collect all links again if the bodies of the world have changed."""
        names = self._world.names
        if (bodies := [self._world.body(name) for name in names]) != self._bodies:
            self._bodies = bodies
            self._body_links = tuple(
                (name, link) for name, body in zip(names, bodies, strict=True) for link in body.links
            )
            self._link_names = tuple(map("::".join, self._body_links))


class _StatesEncoder:
    """Encodes poses and velocities of named entities by a template, which is rebuilt when the names change."""

    def __init__(self, record: type[ModelStates] | type[LinkStates]) -> None:
        self._record = record
        self._names: tuple[str, ...] | None = None

    def encode(self, names: tuple[str, ...], states: NDArray[np.float64]) -> bytes:
        """Encode the record for these names and states, shape (n, 13)."""
        if names != self._names:
            self._names = names
            self._template = TemplateGroup([Template(self._message, 13 * len(names), stamped=False)])
        (payload,) = self._template.encode(b"", np.concatenate((states[:, :7].ravel(), states[:, 7:].ravel()))[None])
        return payload

    def _message(self, _: Time, numbers: Sequence[float]) -> ModelStates | LinkStates:
        names = self._names or ()
        poses, twists = iter(numbers[: 7 * len(names)]), iter(numbers[7 * len(names) :])
        states = [
            BodyState(position=(x, y, z), orientation=(i, j, k, w), linear=(u, v, t), angular=(a, b, c))
            for (x, y, z, i, j, k, w), (u, v, t, a, b, c) in zip(
                zip(*[poses] * 7, strict=True), zip(*[twists] * 6, strict=True), strict=True
            )
        ]
        messages = [pose_and_twist(each) for each in states]
        return self._record(
            name=names, pose=tuple(pose for pose, _ in messages), twist=tuple(twist for _, twist in messages)
        )
