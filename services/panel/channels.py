"""The channels of the fleet, the log, parameters and robots."""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import Any

import msgspec
import psutil

from messages.elea import FleetState
from messages.parameters import ParameterSchema, ParameterValues
from messages.rosgraph import Log
from messages.se2 import Pose2
from messages.topics import DESCRIPTIONS, FLEET_STATE, ROSOUT, UPDATES
from models import MODELS
from models.model import read_model
from services.panel.estop import EmergencyStopClient
from services.panel.graph import NodeGraph
from services.panel.protocol import as_json
from services.panel.robots import RobotState, RobotTracker
from services.panel.subscriptions import SharedSubscriptions, SubscriptionGroup

USAGE_PERIOD_S = 1.0
"""Wall time [s] between two measurements of the processes' usage."""


class FleetChannel:
    """Sends the newest state of the fleet, null without a supervisor, and the usage of its processes."""

    period, streams = 0.1, False

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph) -> None:
        self.version = 0
        self._topic = (FLEET_STATE.name, FleetState.ROS_TYPE)
        self._subscriptions, self._graph = SubscriptionGroup(subscriptions), graph
        self._state: FleetState | None = None
        self._supervised = False
        self._usage = ProcessUsage()
        self._due = 0.0

    def set_enabled(self, enabled: bool) -> None:
        self._subscriptions.set_topics({self._topic: FLEET_STATE.quality.name} if enabled else {})
        if not enabled:
            self._state = None

    def update(self, now: float) -> None:
        batch = self._subscriptions.messages(*self._topic)
        there = self._graph.publication(FLEET_STATE.name) is not None
        if batch:
            self._state = batch[-1][0]
        if batch or there != self._supervised:
            self._supervised = there
            self.version += 1
        if self._state is not None and there and now >= self._due:
            self._due = now + USAGE_PERIOD_S
            if self._usage.measure({each.name: each.pid for each in self._state.processes if each.pid}):
                self.version += 1

    def delta(self, since: int) -> str | None:
        state = msgspec.to_builtins(self._state) if self._state is not None and self._supervised else None
        return as_json("fleet", state=state, usage=self._usage.by_name)


class ProcessUsage:
    """Processor [% of one core, since the previous measurement] and resident memory [MiB] of processes, by name."""

    def __init__(self) -> None:
        self.by_name: dict[str, tuple[float, int]] = {}
        self._processes: dict[str, psutil.Process] = {}

    def measure(self, pids: dict[str, int]) -> bool:
        """Measure the processes with these ids on this machine; returns whether a displayed value has changed."""
        self._processes = {name: process for name, process in self._processes.items() if pids.get(name) == process.pid}
        found = {}
        for name, pid in pids.items():
            try:
                process = self._processes.get(name)
                if process is None:  # its first processor usage is 0, since it spans no time
                    process = self._processes[name] = psutil.Process(pid)
                with process.oneshot():
                    found[name] = round(process.cpu_percent(), 1), round(process.memory_info().rss / 2**20)
            except psutil.Error:
                self._processes.pop(name, None)
        changed, self.by_name = found != self.by_name, found
        return changed


FREE_COLOURS = 8
"""Number of colours that no robot has, for plotted lines that belong to no robot."""
MAX_LINES = 2000
"""Maximum lines kept."""
MAX_LINE_LENGTH = 4000
"""Maximum displayed characters of a line."""


class LogChannel:
    """Sends log lines. It is always subscribed: traffic is low, and users look for lines from before a page opened."""

    period, streams = 0.2, True

    def __init__(self, subscriptions: SharedSubscriptions) -> None:
        self.version = 0
        self._topic = (ROSOUT.name, Log.ROS_TYPE)
        self._subscriptions = SubscriptionGroup(subscriptions)
        self._subscriptions.set_topics({self._topic: ROSOUT.quality.name})
        self._lines: deque[tuple[int, float, int, str, str, str]] = deque(maxlen=MAX_LINES)

    def set_enabled(self, enabled: bool) -> None:
        """Do nothing: the log is always subscribed to."""

    def update(self, now: float) -> None:
        for line, _ in self._subscriptions.messages(*self._topic):
            self.version += 1
            place = f"{line.file.rpartition('/')[2]}:{line.line} {line.function}" if line.file else ""
            self._lines.append(
                (self.version, line.header.stamp.ns / 1e9, line.level, line.name, line.msg[:MAX_LINE_LENGTH], place)
            )

    def delta(self, since: int) -> str | None:
        return as_json("log", lines=[line for line in self._lines if line[0] > since], first=since < 0)


_DESCRIBED, _UPDATED = (each.name.removeprefix("~") for each in (DESCRIPTIONS, UPDATES))


class ParameterSetsChannel:
    """Sends all descriptions when any of them changes. A set is removed when no node publishes it any longer."""

    period, streams = 0.1, False
    topic, record = _DESCRIBED, ParameterSchema.ROS_TYPE

    def __init__(self, subscriptions: SharedSubscriptions, graph: NodeGraph) -> None:
        self.version = 0
        self._subscriptions, self._graph = SubscriptionGroup(subscriptions), graph
        self._known: dict[str, tuple[int, Any]] = {}
        self._reconciled = -1

    def set_enabled(self, enabled: bool) -> None:
        self._reconciled = -1
        if not enabled:
            self._subscriptions.set_topics({})
            self._known = {}

    def update(self, now: float) -> None:
        if self._reconciled != self._graph.version:
            self._reconciled = self._graph.version
            there = [each.name for each in self._graph.find_topics("pub", self.topic) if each.record == self.record]
            self._subscriptions.set_topics({(name, self.record): DESCRIPTIONS.quality.name for name in there})
            for name in [each for each in self._known if each not in there]:
                del self._known[name]
                self.version += 1
        for name, record in self._subscriptions.topics():
            for message, _ in self._subscriptions.messages(name, record)[-1:]:
                self.version += 1
                self._known[name] = self.version, message

    def delta(self, since: int) -> str | None:
        sets = [msgspec.to_builtins(message) for _, message in self._known.values()]
        return as_json("sets", sets=sorted(sets, key=lambda each: str(each["set"])))


class ParameterValuesChannel(ParameterSetsChannel):
    """Sends the values of the sets that have changed."""

    streams = True
    topic, record = _UPDATED, ParameterValues.ROS_TYPE

    def delta(self, since: int) -> str | None:
        delta = [msgspec.to_builtins(message) for at, message in self._known.values() if at > since]
        return as_json("values", sets=delta) if delta else None


TURTLE_RADIUS = 0.35
"""Drawn radius of a turtle's shell [m]; with head and tail, a turtle in turtlesim's window is 1 m long."""
MAX_GOALS = 200
"""Maximum displayed goals of a plan."""


class PosesChannel:
    """Sends the poses whenever a new one has arrived: ``[x, y, yaw, x, y, yaw, v, w]``, true pose, then estimate.

    Units are m, rad, m/s and rad/s, in the world frame.
    """

    period, streams = 0.04, False

    def __init__(self, robots: RobotTracker) -> None:
        self._robots = robots

    @property
    def version(self) -> int:
        """The number of new poses of the robots."""
        return self._robots.pose_version

    def set_enabled(self, enabled: bool) -> None:
        """Do nothing: the hub enables the robots' topics."""

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the robots."""

    def delta(self, since: int) -> str | None:
        poses = {}
        for robot in self._robots.by_namespace.values():
            if robot.truth is not None:
                estimate = robot.estimate or robot.truth
                poses[robot.namespace] = [round(each, 4) for each in (*robot.truth, *estimate, *robot.speed)]
        return as_json("poses", at=poses)


class RobotsChannel:
    """Sends the summary of each robot (model, command source, stops, goals) when any of it changes."""

    period, streams = 0.1, False

    def __init__(self, robots: RobotTracker, stops: EmergencyStopClient) -> None:
        self._robots, self._stops = robots, stops

    @property
    def version(self) -> int:
        """The sum of the versions of the robots and the stops."""
        return self._robots.version + self._stops.version

    def set_enabled(self, enabled: bool) -> None:
        """Do nothing: the hub enables the robots' topics."""

    def update(self, now: float) -> None:
        """Do nothing: the hub updates the robots."""

    def delta(self, since: int) -> str | None:
        robots = self._robots
        listed = [
            {**robot_summary(each, self._stops), "colour": robots.colour(each)} for each in robots.by_namespace.values()
        ]
        free = robots.free_colours(FREE_COLOURS)
        return as_json("robots", robots=listed, free=free, all_stopped=self._stops.is_requested(""))


@lru_cache(64)
def _radius(model: str) -> float:
    """Return the radius [m] of a model; 0 if it does not come with this project."""
    return round(read_model(model).radius, 3) if model in MODELS else 0.0


def robot_summary(robot: RobotState, stops: EmergencyStopClient) -> dict[str, Any]:
    """Return a robot's summary for pages; its goals are in the world frame."""
    base, goal, plan = robot.base, robot.goal, robot.plan
    goals = plan.poses[:MAX_GOALS] if plan is not None else ()
    stopped = stops.is_stopped(robot.namespace)
    return {
        "ns": robot.namespace,
        "model": "turtle" if robot.turtle else base.model if base else "",
        "radius": TURTLE_RADIUS if robot.turtle else _radius(base.model) if base else 0.0,
        "drives": bool(robot.cmd_vel_type),
        "stops": robot.has_e_stop,
        "goals": robot.accepts_goals,
        "source": base.source if base else "",
        "timed_out": base.timed_out if base else False,
        "stopped": (base is not None and base.e_stopped) if stopped is None else stopped,
        "stopped_by": stops.other_holders(robot.namespace),
        "asked": stops.is_requested(robot.namespace),
        "colliding": base.colliding if base else False,
        "collisions": base.collisions if base else 0,
        "state": goal.state if goal else "",
        "index": goal.index if goal else 0,
        "plan": [list(robot.origin @ Pose2.from_msg(each.pose))[:2] for each in goals],
    }
