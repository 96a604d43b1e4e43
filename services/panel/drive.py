"""Driving robots from the page: velocity commands with a dead-man's switch, and goals.

A page repeats its command while the joystick is held. If it falls silent, is hidden, loses its connection or hangs, the
joystick counts as released after ``silence`` of wall time. Zero is then published for ``give_way`` of simulation time,
so that the robot stops, and after that other nodes may drive again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from messages.geometry import PoseStamped, Twist, TwistStamped, Vector3
from messages.se2 import Pose2
from messages.std import Header, Time
from messages.topics import CMD_VEL, CMD_VEL_STAMPED, GOAL_POSE, Topic
from services.driving.command_repeater import CommandRepeater
from services.panel import PanelParameters
from services.panel.pages import Page
from services.panel.protocol import Drive, Goal
from services.panel.robots import RobotState, RobotTracker
from services.runtime.errors import BadInput, unknown_name
from services.runtime.node import Node
from services.runtime.publisher import Publisher

COMMAND_RATE = 20.0
"""Command rate [Hz of wall time] while the joystick is held."""


class DriveCommand(NamedTuple):
    """Forward speed [m/s] and turn rate [rad/s, positive to the left]."""

    v: float = 0.0
    w: float = 0.0


ZERO_COMMAND = DriveCommand()


@dataclass
class _DriveSession:
    """The page that drives a robot, and its last command, received at ``last_message`` [s of wall time]."""

    page: Page | None
    output: Publisher[Any]
    type_name: str
    repeater: CommandRepeater[DriveCommand]
    command: DriveCommand = ZERO_COMMAND
    last_message: float = 0.0


class DriveController:
    """Publishes the commands of pages: one session, and one page, for each driven robot."""

    def __init__(self, node: Node, robots: RobotTracker, params: PanelParameters) -> None:
        self.params = params
        self._node, self._robots = node, robots
        self._sessions: dict[str, _DriveSession] = {}
        self._epoch = self._sim_ns = 0

    @property
    def busy(self) -> bool:
        """Whether any robot is driven, or still receives zero commands."""
        return bool(self._sessions)

    def drive(self, page: Page, message: Drive, now: float) -> None:
        """Set a page's command at wall time ``now`` [s]; raises BadInput if it may not drive the robot so."""
        p = self.params
        robot = self._robots.by_namespace.get(message.robot)
        if robot is None:
            raise unknown_name("robot", message.robot, self._robots.by_namespace)
        if not robot.cmd_vel_type:
            raise BadInput(f"{message.robot} takes no commands on {CMD_VEL.name}")
        if abs(message.v) > p.max_linear or abs(message.w) > p.max_angular:
            raise BadInput(
                f"{message.v:g} m/s and {message.w:g} rad/s: no page drives faster than {p.max_linear:g} m/s and "
                f"{p.max_angular:g} rad/s (parameters max_linear, max_angular of the panel)"
            )
        session = self._sessions.get(message.robot)
        if session is None:
            session = self._sessions[message.robot] = self._open_session(robot)
        if session.page is not None and session.page is not page:
            raise BadInput(f"another page is driving {message.robot}: it must release it first")
        session.page, session.command, session.last_message = page, DriveCommand(message.v, message.w), now

    def release(self, page: Page) -> None:
        """Release the robots that a page drives."""
        for session in self._sessions.values():
            if session.page is page:
                session.page = None

    def update(self, now: float, sim_ns: int, epoch: int) -> None:
        """Publish the commands that are due at wall time ``now`` [s] and simulation time ``sim_ns`` [ns]."""
        self._sim_ns = sim_ns
        if epoch != self._epoch:
            self._epoch = epoch
            for session in self._sessions.values():
                session.repeater.reset()
        for name, session in list(self._sessions.items()):
            if name not in self._robots.by_namespace:
                self._close_session(name)
                continue
            if session.page is not None and now - session.last_message > self.params.silence:
                session.page = None
            motion = session.command if session.page is not None else None
            command = session.repeater.update(motion, now, sim_ns / 1e9)
            if command is not None:
                self._publish(session, command, sim_ns)
            if session.repeater.state == "silent":
                self._close_session(name)

    def close(self) -> None:
        """Publish zero to the driven robots when the panel ends."""
        for session in self._sessions.values():
            self._publish(session, ZERO_COMMAND, self._sim_ns)

    def _open_session(self, robot: RobotState) -> _DriveSession:
        name, record = robot.topic_name(CMD_VEL), robot.cmd_vel_type
        topic: Topic[Any] = CMD_VEL_STAMPED if record == TwistStamped.ROS_TYPE else CMD_VEL
        repeater = CommandRepeater(COMMAND_RATE, self.params.give_way, ZERO_COMMAND)
        return _DriveSession(None, self._node.advertise(topic, name), record, repeater)

    def _close_session(self, name: str) -> None:
        self._node.unregister(self._sessions.pop(name).output)

    def _publish(self, session: _DriveSession, motion: DriveCommand, sim_ns: int) -> None:
        twist = Twist(linear=Vector3(x=motion.v), angular=Vector3(z=motion.w))
        if session.type_name == TwistStamped.ROS_TYPE:
            session.output.publish(TwistStamped(header=Header(stamp=Time.of(sim_ns)), twist=twist))
        else:
            session.output.publish(twist)


class GoalPublisher:
    """Publishes goals, each on its robot's topic."""

    def __init__(self, node: Node, robots: RobotTracker) -> None:
        self._node, self._robots = node, robots
        self._publishers: dict[str, Publisher[PoseStamped]] = {}

    def send(self, goal: Goal, sim_ns: int) -> str:
        """Send a goal in the world frame; raises BadInput when no node would accept it."""
        robot = self._robots.by_namespace.get(goal.robot)
        if robot is None:
            raise unknown_name("robot", goal.robot, self._robots.by_namespace)
        if not robot.accepts_goals:
            raise BadInput(
                f"no subscriber to {robot.topic_name(GOAL_POSE)}: is a waypoint service running for this robot?"
            )
        if robot.estimate is None:
            raise BadInput(f"no odometry from {goal.robot} yet, so its frame is not known: is the simulation running?")
        output = self._publishers.get(goal.robot)
        if output is None:
            output = self._publishers[goal.robot] = self._node.advertise(GOAL_POSE, robot.topic_name(GOAL_POSE))
        at = robot.origin.between(Pose2(goal.x, goal.y, goal.yaw)).wrapped
        header = Header(stamp=Time.of(sim_ns), frame_id=robot.frame)
        output.publish(PoseStamped(header=header, pose=at.to_msg()))
        return f"{goal.robot} is sent to ({goal.x:.2f} m, {goal.y:.2f} m)"

    def close_unused(self) -> None:
        """Close the publishers of robots that no longer exist."""
        for robot in [each for each in self._publishers if each not in self._robots.by_namespace]:
            self._node.unregister(self._publishers.pop(robot))
