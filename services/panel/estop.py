"""Emergency stops of one robot or all, kept until they are reset, and the other nodes that hold stops."""

from __future__ import annotations

from messages.elea import EmergencyStops
from messages.std import Bool
from messages.topics import E_STOP, STOPS
from services.panel.robots import RobotTracker
from services.runtime.errors import BadInput, unknown_name
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.wire import MEMBER_BYTES, SampleInfo, node_id

ALL_ROBOTS = ""
"""Stands for all robots: ``/e_stop``, which every base obeys, including those spawned later. It is also the only stop
of a robot in the root namespace."""

_ROOT = "/"


class EmergencyStopClient:
    """Publishes this panel's stops, and reads the holders of all stops from ``/sim/stops``.

    The simulation keeps stops through a crash of either side. A restarted panel is the same holder: it adopts the stops
    listed under its name. It drops a stop only if the simulation that listed it no longer does: the robot was deleted,
    or the stop was released by request. A robot or simulation that is not visible ends no stop.
    """

    def __init__(self, node: Node, robots: RobotTracker) -> None:
        self.version = 0
        self._node, self._robots = node, robots
        self._outputs: dict[str, Publisher[Bool]] = {}
        self._requested: set[str] = set()
        self._reset: set[str] = set()
        """The stops that this panel has reset; the simulation's list may be older than the reset."""
        self._status = node.subscribe(STOPS)
        self._own_id = node_id(node.identity.node)
        self._simulation_id = b""
        self._confirmed: set[str] = set()
        """The stops of this panel that the current simulation has listed."""
        self._holders: dict[str, dict[str, str]] | None = None
        """By robot, each holder's id and name; None until the simulation has published the list."""

    def is_requested(self, robot: str) -> bool:
        """Return whether this panel has stopped the robot, or all of them, and not reset it."""
        return robot in self._requested or ALL_ROBOTS in self._requested

    def is_stopped(self, robot: str) -> bool | None:
        """Return whether any node's stop holds the robot; None until the simulation has published the list."""
        return None if self._holders is None else bool({**self._holders_of(robot), **self._holders_of(ALL_ROBOTS)})

    def other_holders(self, robot: str) -> list[str]:
        """Return the names of the other nodes whose stops hold the robot."""
        held = {**self._holders_of(robot), **self._holders_of(ALL_ROBOTS)}
        return sorted(name for holder, name in held.items() if holder != self._own_id)

    def set_stop(self, robot: str, on: bool) -> str:
        """Stop or reset a robot or ALL_ROBOTS; returns what was done. Raises BadInput for an unknown robot, and if
        ALL_ROBOTS stays stopped."""
        robot = ALL_ROBOTS if robot == _ROOT else robot
        if robot != ALL_ROBOTS and robot not in self._robots.by_namespace and robot not in self._requested:
            raise unknown_name("robot", robot, self._robots.by_namespace)
        self.version += 1
        self._publish(robot, on)
        if robot != ALL_ROBOTS:
            if on:
                return f"{robot} is stopped until it is reset"
            if ALL_ROBOTS in self._requested:
                raise BadInput(f"all robots are stopped: {robot} can move once that stop is reset")
            others = self.other_holders(robot)
        else:
            if on:
                return "all robots are stopped until they are reset"
            for each in sorted({*self._robots.by_namespace, *self._requested} - {_ROOT}):
                self._publish(each, False)
            others = sorted({name for each in self._holders or () for name in self.other_holders(each)})
        if others:
            return (
                f"this panel's stop is reset; {robot or 'robots'} may move when {', '.join(others)} "
                "reset theirs (./elea sim stops)"
            )
        return f"{robot or 'all robots'} may move again"

    def update(self) -> None:
        """Read the simulation's list of stops."""
        for message, origin in self._status.messages:
            self._on_status(message, origin)

    def _holders_of(self, robot: str) -> dict[str, str]:
        return (self._holders or {}).get(robot, {})

    def _on_status(self, status: EmergencyStops, origin: SampleInfo | None) -> None:
        self.version += 1
        self._holders = {}
        for stop in status.stops:
            robot = stop.topic.removesuffix(f"/{E_STOP.name}")
            self._holders.setdefault(robot, {})[stop.id] = stop.holder
        mine = {robot for robot, holders in self._holders.items() if self._own_id in holders}
        simulation_id = origin.publisher[:MEMBER_BYTES] if origin is not None else b""
        if simulation_id == self._simulation_id:
            for robot in self._confirmed - mine:
                self._drop(robot)
        self._simulation_id, self._confirmed = simulation_id, mine - self._reset
        for robot in self._confirmed - self._requested:
            self._publish(robot, True)

    def _drop(self, robot: str) -> None:
        """Drop a stop that the simulation no longer lists although it was not reset here.

        False is not published: it would end a stop that was just set and is still on its way.
        """
        self._requested.discard(robot)
        if robot in self._outputs:
            self._node.unregister(self._outputs.pop(robot))

    def _publish(self, robot: str, on: bool) -> None:
        if on:
            self._requested.add(robot)
            self._reset.discard(robot)
        else:
            self._requested.discard(robot)
            self._confirmed.discard(robot)
            self._reset.add(robot)
        if robot not in self._outputs:
            self._outputs[robot] = self._node.advertise(E_STOP, f"{robot}/{E_STOP.name}")
        self._outputs[robot].publish(Bool(data=on))
