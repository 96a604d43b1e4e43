"""The simulation: the world with its robots, and simulation time, stepped and published tick by tick."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from messages.elea import EmergencyStops as EmergencyStopList
from messages.rosgraph import Clock
from messages.se3 import Pose3
from messages.std import Time
from messages.topics import CLOCK, E_STOP, STOPS, TF, TF_STATIC
from models import display_name
from models.model import read_model
from models.robot_facts import read_notes
from services.runtime.errors import unknown_name
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.node import Node
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.publisher import Publisher
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.subscription_tokens import SubscriptionTokens
from services.sim.command_sources import CommandSources
from services.sim.drive.controller import DiffDriveController
from services.sim.drive.odometry import Odometer
from services.sim.emergency_stops import ALL_ROBOTS, EmergencyStopStore
from services.sim.joints.wrenches import LinkWrenches
from services.sim.parameters import RobotEntry
from services.sim.physics.world import Contact, World
from services.sim.publishers import GazeboStatesPublisher, MotionPublisher, WorldStatesPublisher
from services.sim.robot import Robot
from services.sim.robot_loader import on_the_ground
from services.sim.robot_names import check_robot_names
from services.sim.robot_topics import CONTROL_STEPS
from services.sim.sensor_publishers import SensorSchedule
from services.sim.snapshot import Snapshot
from services.sim.tf import MovingTransforms, static_transforms
from services.sim.transit_delay import TransitDelayEstimator

TF_STEPS = 8
"""Physics steps between two messages on ``/tf``, and of Gazebo's states: 25 Hz, the rate of odometry."""
STATUS_STEPS = 40
"""Physics steps between two status messages of a base: 5 Hz."""


class Simulation:
    """All bodies, and simulation time: ``tick`` counts physics steps since the last reset of time.

    ``input_steps`` is CONTROL_STEPS; in real time it is less where the joints of a robot without a base are published
    faster, and 1 where joints are commanded. Emergency stops survive the process in ``stops_file``, if one is given.
    """

    def __init__(
        self, node: Node, world: World, seed: int, real_time: bool = True, stops_file: Path | None = None
    ) -> None:
        self.world, self.tick, self.epoch, self.paused = world, 0, 0, False
        self._node, self._seed, self._real_time = node, seed, real_time
        self._robots: dict[str, tuple[Robot, Pose3]] = {}
        self.robots: list[Robot] = []
        """All robots, in the order of their spawning; replaced by a new list when one is added or deleted."""
        self._contacts: tuple[Contact, ...] | None = None
        """The contacts that the robots were last updated with; None forces an update."""
        self.wrenches = LinkWrenches(world, node.log)
        self._command_sources, self._delays = CommandSources(node.transport), TransitDelayEstimator()
        self._lost_publishers: list[bytes] = []
        self.subscriptions = SubscriptionTokens(node.transport)
        self._readers_version: tuple[int, ...] | None = None
        """Version of the subscriptions at the last update; None forces an update."""
        self._clock_publisher: Publisher[Any] = node.advertise(CLOCK)
        self._tf_publisher: Publisher[Any] = node.advertise(TF)
        self._tf_static_publisher: Publisher[Any] = node.advertise(TF_STATIC)
        self._gazebo_states = GazeboStatesPublisher(node, world)
        self._world_states = WorldStatesPublisher(node, world)
        self._e_stop_subscriber: Subscriber[Any] = node.subscribe(E_STOP, f"/{E_STOP.name}", rare=True)
        self.stops = EmergencyStopStore(stops_file, self._command_sources.node_name, node.log)
        self._stops_publisher: Publisher[Any] = node.advertise(STOPS)
        self.stops.load()
        self.stops.save()
        self._publish_stops()
        self.commands: list[Callable[[], None]] = []
        """Callbacks that process received messages at each read of the inputs, before the robots' own commands."""
        self.after_step: list[Callable[[], None]] = []
        """Callbacks after each physics step, and when time is paused."""
        self.input_steps = CONTROL_STEPS
        self._commanded_robots = 0
        self._sensors = SensorSchedule(world)
        self._counting: dict[str, Odometer] = {}
        """The odometers that follow wheel encoders, by robot."""
        self._parameters: list[tuple[ParameterSubscription[Any], Robot]] = []
        self._transforms = MovingTransforms()
        self._motion = MotionPublisher()
        self._controllers: list[tuple[DiffDriveController, Robot]] = []
        """Robots that need no step until their controller's ``idle_until``."""
        self._stepping: list[Robot] = []
        """All other robots."""

    @property
    def now(self) -> int:
        """Simulation time, ns."""
        return self.tick * STEP_NS

    @property
    def runs_by_wall_clock(self) -> bool:
        """Whether time advances on its own: in real time, once it has started and is not paused."""
        return self._real_time and self.tick > 0 and not self.paused

    def find(self, name: str) -> Robot:
        """Return the robot with this name; raises BadInput if there is none."""
        if name not in self._robots:
            raise unknown_name("model", name, self._robots)
        return self._robots[name][0]

    def spawn(self, entry: RobotEntry, pose: Pose3, wait: bool = False) -> Robot:
        """Add a robot.

        A robot from outside is raised so that it stands on the ground, wherever its root is. Emergency stops of its
        name, or of all robots, hold it from the start. With ``wait`` it starts with the values that the parameter
        service has for it; otherwise these arrive a moment later.

        Raises:
            BadInput: Its name, namespace or frames are taken or illegal, or it would overlap with something.
        """
        check_robot_names(entry, [robot.entry for robot in self.robots])
        x, y, _ = pose.position
        ground = self.world.ground_height(x, y, read_model(entry.model).radius)
        pose, notes = on_the_ground(entry.model, pose, ground), read_notes(entry.model)
        robot = Robot(self._node, self.world, entry, pose, self._seed, self._command_sources, self._delays, wait)
        self._robots[entry.name] = robot, pose
        self.robots = [*self.robots, robot]
        self._transforms.add(robot, self.world.body(entry.name).joints)
        robot.stop(self.stops.holders(entry.name))
        limited = ", ".join(
            f"{joint} {most:.3g}" for joint, most in self.world.body(entry.name).limited_damping.items()
        )
        if limited:
            notes = (
                *notes,
                f"joint damping reduced to the largest stable value at this step (N m s/rad or N s/m): {limited}",
            )
        if notes:
            self._node.log.info(f"{entry.name}: assumptions about {display_name(entry.model)}: {'; '.join(notes)}")
        self._regroup()
        self.publish_static_tf()
        return robot

    def delete(self, name: str) -> None:
        """Delete a robot; raises BadInput if no robot has this name."""
        self.find(name).close()
        self.wrenches.remove_body(name)
        del self._robots[name]
        self.robots = [each for each in self.robots if each.name != name]
        self._transforms.remove(name)
        self.stops.remove_robot(name)
        self._save_stops()
        self._regroup()
        self.publish_static_tf()

    def reset(self, time_too: bool) -> None:
        """Return everything to its spawn pose; with ``time_too``, time restarts at 0 in a new epoch."""
        self.world.reset()
        self.wrenches.reset()
        if time_too:
            self.tick = 0
            self.epoch += 1
        for robot in self.robots:
            robot.reset(time_too)
        self._contacts = None
        self._sensors.reset()
        self.publish_static_tf()

    def publish(self) -> None:
        """Publish what is due at this tick."""
        self._update_subscriptions()
        snapshot = Snapshot(self.world, self.now, self.tick)
        self._sensors.publish(snapshot)
        self._motion.publish_joint_states(snapshot)
        if snapshot.tick % CONTROL_STEPS == 0:
            self._publish_motion(snapshot)
        if snapshot.tick % self.input_steps == 0:
            self.publish_clock()

    def _update_subscriptions(self) -> None:
        """Update which topics have subscribers, if that may have changed."""
        self.subscriptions.update()
        version = self.subscriptions.changes, self._node.version, self._node.transport.readers_version
        if version == self._readers_version:
            return
        self._readers_version = version
        self.subscriptions.mark(self._node.publishers)
        self._sensors.update_subscriptions()
        self._motion.update_subscriptions([robot.publishers for robot in self.robots])

    def _publish_motion(self, snapshot: Snapshot) -> None:
        robots, tick = self.robots, snapshot.tick
        self._update_contacts()
        angles = snapshot.joint_rows(tuple(self._counting))[0].tolist()
        end = 0
        for odometer in self._counting.values():
            start, end = end, end + odometer.joint_count
            odometer.update_from_encoders(snapshot.now, angles[start:end])
        self._motion.publish(snapshot)
        if tick % STATUS_STEPS == 0:
            for robot in robots:
                robot.publish_status(snapshot.now)
        self._world_states.publish(snapshot.now, tick)
        if tick % TF_STEPS == 0:
            self._gazebo_states.publish(snapshot)
            if self._tf_publisher.has_subscribers:
                for payload in self._transforms.encode(snapshot):
                    self._tf_publisher.publish_encoded(payload)

    def publish_static_tf(self) -> None:
        """Publish the fixed transforms."""
        self._tf_static_publisher.publish(static_transforms(self._robots.values(), self.now))

    def publish_clock(self) -> None:
        """Publish the clock."""
        self._clock_publisher.publish(
            Clock(clock=Time.of(self.now), tick=self.tick, epoch=self.epoch, paused=self.paused)
        )

    def read_inputs(self, watermarks: Watermarks | None, factor: float) -> None:
        """Apply the commands and parameters received for this tick.

        Lost publishers are processed last: a command that arrived just before its publisher left must not outlive it.

        Args:
            watermarks: How far samples of lockstep members are admitted; None in real time.
            factor: Simulated seconds per second of wall time.
        """
        self._node.update_subscribers(watermarks)
        self._lost_publishers += self._command_sources.lost_publishers()
        self._apply_stops()
        for apply in self.commands:
            apply()
        lockstep_members = watermarks.members if watermarks is not None else set()
        lost, self._lost_publishers = self._lost_publishers, []
        if watermarks is not None and watermarks.lost_members:
            # Lockstep continues without them from this tick; the tokens of their publishers may vanish a moment later.
            lost += self._command_sources.publishers_of(watermarks.lost_members)
            watermarks.lost_members = set()
        for parameters, robot in self._parameters:
            if parameters.pending:
                robot.actuation.reconfigure(self.now)
        for robot in self.robots:
            robot.apply_commands(self.now, lockstep_members, factor)
        if (commanded := sum(robot.motors.commanded for robot in self.robots)) != self._commanded_robots:
            self._commanded_robots = commanded
            self._regroup()
        for source in lost:
            for robot in self.robots:
                robot.publisher_lost(source, self.now)

    def read_stops(self, watermarks: Watermarks | None) -> None:
        """Apply the emergency stops received, and nothing else: they take effect even while time is paused."""
        for each in (self._e_stop_subscriber, *(robot.e_stop_subscriber for robot in self.robots)):
            if each is not None:
                each.update(watermarks)
        # Updates the names of holders; the losses themselves are processed after the last commands.
        self._lost_publishers += self._command_sources.lost_publishers()
        self._apply_stops()

    def release_stop(self, robot: str, holder: str) -> str:
        """Release other holders' emergency stops, see ``EmergencyStopStore.release``; raises BadInput."""
        done = self.stops.release(robot, holder)
        self._save_stops()
        return done

    def step(self) -> None:
        """Take one physics step."""
        now = self.now
        for controller, robot in self._controllers:
            if controller.idle_until < now:
                robot.step(now)
        for robot in self._stepping:
            robot.step(now)
        self.wrenches.step(now)
        self.world.step()
        self.tick += 1
        for act in self.after_step:
            act()

    def _apply_stops(self) -> None:
        """Stop first, then save, then publish: nothing moves in between, and what is published is saved."""
        stop_for_all = self.stops.process(ALL_ROBOTS, self._e_stop_subscriber.name, self._e_stop_subscriber.messages)
        for robot in self.robots:
            own = robot.e_stop_subscriber
            new_stop = own is not None and own.messages and self.stops.process(robot.name, own.name, own.messages)
            if new_stop or stop_for_all:
                robot.stop(self.stops.holders(robot.name), new_stop=True)
        self._save_stops()

    def _save_stops(self) -> None:
        if not self.stops.save():
            return
        for robot in self.robots:
            robot.stop(self.stops.holders(robot.name))
        self._publish_stops()

    def _publish_stops(self) -> None:
        self._stops_publisher.publish(EmergencyStopList(stops=self.stops.all))

    def _regroup(self) -> None:
        """Rebuild the lists of what is due, after a robot was added, deleted or commanded in another way."""
        self._contacts = None
        self._sensors.replace(each for robot in self.robots for each in robot.publishers.sensors)
        self._readers_version = None
        odometers = [(robot.name, robot.publishers.odometer) for robot in self.robots]
        self._counting = {name: odometer for name, odometer in odometers if odometer.follows_encoders}
        self._parameters = [(robot.actuation.parameters, robot) for robot in self.robots]
        controllers = [(robot.step_controller, robot) for robot in self.robots]
        self._controllers = [(controller, robot) for controller, robot in controllers if controller is not None]
        self._stepping = [robot for controller, robot in controllers if controller is None]
        rates = [robot.publishers.joint_state_steps for robot in self.robots if not robot.model.has_base]
        rates += [1 for robot in self.robots if robot.motors.commanded]
        self.input_steps = min([CONTROL_STEPS, *rates]) if self._real_time else CONTROL_STEPS

    def _update_contacts(self) -> None:
        contacts = self.world.contacts()
        if contacts == self._contacts:
            return
        self._contacts = contacts
        partners: dict[str, set[str]] = {}
        for body, other in contacts:
            partners.setdefault(body, set()).add(other)
            partners.setdefault(other, set()).add(body)
        for robot in self.robots:
            robot.update_contacts(frozenset(partners.get(robot.name, ())))
