"""The emergency stop: latched, for one robot or for all, until it is reset."""

from __future__ import annotations

from messages.std import Bool
from messages.topics import E_STOP
from services.panel.robots import Robots
from services.runtime.errors import BadInput, unknown
from services.runtime.node import Node
from services.runtime.outputs import Output

ALL = ""
"""Stands for all robots: ``/e_stop``, which every base follows, those too that are spawned later."""


class Stops:
    """Publishes stops; what the robots make of them is told by their bases."""

    def __init__(self, node: Node, robots: Robots) -> None:
        self.version = 0
        self._node, self._robots = node, robots
        self._outputs: dict[str, Output[Bool]] = {}
        self._on: set[str] = set()

    def asked(self, robot: str) -> bool:
        """Whether this panel has stopped the robot, or all of them, and not reset it."""
        return robot in self._on or ALL in self._on

    def order(self, robot: str, on: bool) -> str:
        """Stop, or reset, a robot or ALL; what was done. Raises BadInput for a robot that is not there."""
        if robot != ALL and robot not in self._robots.found:
            raise unknown("robot", robot, self._robots.found)
        self.version += 1
        (self._on.add if on else self._on.discard)(robot)
        self._say(robot, on)
        if robot != ALL:
            if not on and ALL in self._on:
                raise BadInput(f"all robots are stopped: {robot} moves again when that is reset")
            return f"{robot} {'is stopped until it is reset' if on else 'may move again'}"
        if not on:
            for each in self._robots.found:
                self._on.discard(each)
                self._say(each, False)
        return "all robots are stopped until they are reset" if on else "all robots may move again"

    def forget_gone(self) -> None:
        """Robots that have left take their stops with them."""
        for robot in [each for each in self._outputs if each != ALL and each not in self._robots.found]:
            self._node.forget(self._outputs.pop(robot))
            self._on.discard(robot)

    def _say(self, robot: str, on: bool) -> None:
        if robot not in self._outputs:
            self._outputs[robot] = self._node.write(E_STOP, f"{robot}/{E_STOP.name}")
        self._outputs[robot].publish(Bool(data=on))
