"""One robot in the world: its body, actuation, subscribers and publishers."""

from __future__ import annotations

from typing import Any

from messages.elea import ModelState
from messages.names import join
from messages.se3 import Pose3
from messages.topics import E_STOP, JOINT_COMMAND
from models import display_name
from models.model import read_model
from models.urdf import read_joints
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.sim.actuation import spawn_actuation
from services.sim.command_sources import CommandSources
from services.sim.drive.controller import DiffDriveController
from services.sim.drive.odometry import body_pose, body_twist
from services.sim.joints.motors import JointMotors
from services.sim.parameters import RobotEntry
from services.sim.physics.world import World
from services.sim.publishers import RobotPublishers
from services.sim.robot_names import ROOT_NAMESPACE, named_model, robot_frame_prefix, robot_namespace
from services.sim.robot_topics import topic_names
from services.sim.transit_delay import TransitDelayEstimator


class Robot:
    """A model in the world under the name ``entry.name``, with its topics in its namespace and a prefix on its frames.

    In the root namespace it has no ``e_stop`` of its own, since ``/e_stop`` is the stop of all robots.
    """

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
        self.entry, self.name = entry, entry.name
        self.namespace, self.frame_prefix = robot_namespace(entry), robot_frame_prefix(entry)
        self.model = named_model(read_model(entry.model), entry.parameters, self.frame_prefix)
        self.actuation = spawn_actuation(
            node, world, entry, self.model, self.namespace, pose, seed, command_sources, delays, wait
        )
        self._node, self._world, self._body = node, world, world.body(entry.name)
        subscribers, publishers = len(node.subscribers), len(node.publishers)
        try:
            self._open(seed, delays)
        except BaseException:
            node.unregister(*node.subscribers[subscribers:], *node.publishers[publishers:])
            self.actuation.close()
            world.delete(entry.name)
            raise

    def _open(self, seed: int, delays: TransitDelayEstimator) -> None:
        """Open the subscribers and publishers."""
        node, entry = self._node, self.entry
        commands = self.actuation.command_topic
        self._command_subscribers: tuple[Subscriber[Any], ...] = tuple(
            node.subscribe(commands, name) for name in topic_names(commands, self.model, self.namespace)
        )
        self.motors = JointMotors(self._body, entry.name, read_joints(entry.model), delays, node.log)
        self._motor_subscriber: Subscriber[Any] | None = None
        if self.motors.joints:
            self._motor_subscriber = node.subscribe(JOINT_COMMAND, join(self.namespace, JOINT_COMMAND.name))
        self.e_stop_subscriber: Subscriber[Any] | None = (
            None
            if self.namespace == ROOT_NAMESPACE
            else node.subscribe(E_STOP, join(self.namespace, E_STOP.name), rare=True)
        )
        self._stopped_by: tuple[str, ...] = ()
        self._contacts: frozenset[str] = frozenset()
        self._collisions = self._refused_before = 0
        self.publishers = RobotPublishers(
            node, self._world, entry, self.model, self.namespace, seed, self.actuation, self.motors
        )

    def close(self) -> None:
        """Delete the body from the world, and close all publishers and subscribers."""
        self.actuation.close()
        for each in (*self._command_subscribers, self._motor_subscriber, self.e_stop_subscriber):
            if each is not None:
                self._node.unregister(each)
        self.publishers.close()
        self._world.delete(self.name)

    def reset(self, time_too: bool) -> None:
        """Restart from where the world has put the body; with ``time_too``, its counts restart at 0."""
        self._contacts = frozenset()
        if time_too:
            self._collisions, self._refused_before = 0, self._refused
        self.actuation.reset(time_too)
        self.motors.reset()
        self.publishers.reset()

    def apply_commands(self, now: int, lockstep_members: set[bytes], factor: float) -> None:
        """Apply the commands admitted at this tick."""
        for each in self._command_subscribers:
            if each.messages:
                self.actuation.apply_commands(each, now, lockstep_members, factor)
        if self._motor_subscriber is not None and self._motor_subscriber.messages:
            self.motors.apply_commands(self._motor_subscriber, now, lockstep_members, factor)

    def publisher_lost(self, source: bytes, now: int) -> None:
        """Handle the loss of the publisher ``source``."""
        self.actuation.publisher_lost(source, now)
        self.motors.publisher_lost(source)

    @property
    def step_controller(self) -> DiffDriveController | None:
        """The controller, if steps before its ``idle_until`` change nothing; None if every step has to be taken."""
        return None if self.motors.joints else self.actuation.step_controller

    def step(self, now: int) -> None:
        """Set the motors for the physics step that begins at ``now`` [ns]."""
        self.actuation.step(now)
        if self.motors.joints:
            self.motors.step(now)

    def stop(self, holders: tuple[str, ...], new_stop: bool = False) -> None:
        """Stand still while ``holders`` hold an emergency stop.

        ``new_stop``: a stop has arrived since the last call, even if it is reset already; commands from before it are
        discarded.
        """
        self._stopped_by = holders
        if new_stop:
            self.actuation.stop(True)
            self.motors.stop(True)
        self.actuation.stop(bool(holders))
        self.motors.stop(bool(holders))

    def update_contacts(self, others: frozenset[str]) -> None:
        """Set the names of the bodies it touches; each new contact counts as one collision."""
        self._collisions += len(others - self._contacts)
        self._contacts = others

    @property
    def _refused(self) -> int:
        """The number of messages that the subscribers of commands have refused."""
        return sum(each.refused for each in self._command_subscribers)

    def publish_status(self, now: int) -> None:
        """Publish the status of the base, if there is one."""
        refused, touching = self._refused - self._refused_before, bool(self._contacts)
        status = self.actuation.status(now, refused, touching, self._collisions, self._stopped_by)
        if status is not None:
            self.publishers.publish_status(status)

    def state(self) -> ModelState:
        """Return the pose and twist, as requests report them."""
        body = self._body.state()
        return ModelState(
            name=self.name, model=display_name(self.entry.model), pose=body_pose(body), twist=body_twist(body)
        )

    @property
    def pose(self) -> Pose3:
        """The current pose of the root in the world."""
        state = self._body.state()
        return Pose3(state.position, state.orientation)
