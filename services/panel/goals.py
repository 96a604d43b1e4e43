"""Goals that are clicked on the map, sent to a robot's controller in the frame that it drives by."""

from __future__ import annotations

from messages.geometry import Pose, PoseStamped
from messages.std import Header, Time
from messages.topics import GOAL_POSE
from services.panel.robots import Robots, Spot
from services.panel.words import Goal
from services.runtime.errors import BadInput, unknown
from services.runtime.node import Node
from services.runtime.outputs import Output


class Goals:
    """Publishes goals, each on its robot's topic."""

    def __init__(self, node: Node, robots: Robots) -> None:
        self._node, self._robots = node, robots
        self._outputs: dict[str, Output[PoseStamped]] = {}

    def send(self, said: Goal, sim_ns: int) -> str:
        """Send a goal of the world; raises BadInput when nobody would take it."""
        robot = self._robots.found.get(said.robot)
        if robot is None:
            raise unknown("robot", said.robot, self._robots.found)
        if not robot.takes_goals:
            raise BadInput(
                f"nobody takes goals on {said.robot}/{GOAL_POSE.name}: does a waypoint service run for this robot?"
            )
        if robot.estimate is None:
            raise BadInput(f"no odometry from {said.robot} yet, so its frame is not known: is the simulation running?")
        output = self._outputs.get(said.robot)
        if output is None:
            output = self._outputs[said.robot] = self._node.write(GOAL_POSE, f"{said.robot}/{GOAL_POSE.name}")
        at = robot.origin.inside(Spot(said.x, said.y, said.yaw))
        header = Header(stamp=Time.of(sim_ns), frame_id=robot.frame)
        output.publish(PoseStamped(header=header, pose=Pose.planar(at.x, at.y, at.yaw)))
        return f"{said.robot} is sent to ({said.x:.2f} m, {said.y:.2f} m)"

    def forget_gone(self) -> None:
        """Robots that have left take no goals."""
        for robot in [each for each in self._outputs if each not in self._robots.found]:
            self._node.forget(self._outputs.pop(robot))
