"""Measures a run: processes the messages of all robots in stamp order, and counts lost messages."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from messages.base import saturating_add
from messages.control import JointControllerState
from messages.elea import BaseStatus, GoalStatus, Health, LockstepState
from messages.gazebo import WorldStates
from messages.geometry import PoseWithCovariance, TwistWithCovariance
from messages.names import absolute_namespace
from messages.nav import Odometry, Path
from messages.sensor import JointState
from messages.std import SECOND
from messages.topics import HEALTH, TOPICS
from services.grader import ArmSpec, BrakingSpec, SizeSpec
from services.grader.arm import ArmMeter
from services.grader.clearance import ClearanceMeter
from services.grader.records import EndReason, Figures, Measurements
from services.grader.robot import Point, RobotMeter
from services.grader.trajectory import trajectory_hash

_GLOBAL_TOPICS = frozenset(topic.name for topic in TOPICS if topic.name.startswith("/"))

MAX_PROCESSES = 4096
MAX_TOPICS = 1 << 16
"""Maximum number of processes, and of topics per process, that are counted."""
_HEARTBEATS = HEALTH.name.strip("/")


@dataclass
class _Process:
    """Counts from the heartbeats of one process; ``total`` is over all its topics."""

    total: int = 0
    missed: int = 0
    by_topic: dict[str, int] = field(default_factory=dict)


class MessageLosses:
    """Counts of lost messages per process; a restarted process is counted in addition to its predecessor.

    A heartbeat contains the total, and for a node with many topics those with new losses first; each topic keeps its
    last reported count. Losses of the nodes ``readers`` (all nodes if empty) count for the run. Those of other nodes,
    which only observe, are listed separately, since a slow browser says nothing about a run. Missed heartbeats are not
    counted: each contains all that the earlier ones did.
    """

    def __init__(self, readers: Collection[str] = ()) -> None:
        self._readers = frozenset(readers)
        self._processes: dict[tuple[str, int], _Process] = {}

    def add_heartbeat(self, health: Health) -> None:
        """Add one heartbeat."""
        process = health.node, health.pid
        if (known := self._processes.get(process)) is None:
            if len(self._processes) >= MAX_PROCESSES:
                return
            known = self._processes[process] = _Process()
        known.missed = health.missed
        for each in health.inputs:
            if (topic := each.topic.strip("/")) in known.by_topic or (each.lost and len(known.by_topic) < MAX_TOPICS):
                known.by_topic[topic] = each.lost
        known.total = max(health.lost, sum(known.by_topic.values())) - known.by_topic.get(_HEARTBEATS, 0)

    def total_losses(self) -> int:
        """Return the messages lost by readers on all topics."""
        return saturating_add(0, sum(each.total for (node, _), each in self._processes.items() if self._counts(node)))

    def robot_losses(self, namespace: str, apart: Collection[str] = (), controller: str = "") -> int:
        """Return the messages lost by readers on the topics in a namespace, except those in the namespaces ``apart``,
        and on those in the namespace of the robot's ``controller``.

        For the root, these are the topics of a robot there, e.g. ``/odom``.
        """
        own = absolute_namespace(namespace)
        within = f"{absolute_namespace(controller)}/" if controller else None
        counting = (each for (node, _), each in self._processes.items() if self._counts(node))
        return saturating_add(
            0,
            sum(
                lost
                for each in counting
                for at, lost in each.by_topic.items()
                if _lies_in(at, own, apart) or (within is not None and f"/{at}".startswith(within))
            ),
        )

    def topic_losses(self) -> dict[str, dict[str, int]]:
        """Return the messages lost by each reader on each topic, without those that lost none."""
        found: dict[str, dict[str, int]] = {}
        for (node, _), each in sorted(self._processes.items(), key=lambda item: item[0]):
            if not self._counts(node):
                continue
            for topic, lost in sorted(each.by_topic.items()):
                if lost and topic != _HEARTBEATS:
                    topics = found.setdefault(node, {})
                    topics[f"/{topic}"] = saturating_add(topics.get(f"/{topic}", 0), lost)
        return found

    def missed_ticks(self) -> dict[str, int]:
        """Return the ticks that each reader missed because it was late, without readers that missed none."""
        found: dict[str, int] = {}
        for (node, _), each in sorted(self._processes.items()):
            if each.missed and self._counts(node):
                found[node] = saturating_add(found.get(node, 0), each.missed)
        return found

    def observer_losses(self) -> dict[str, int]:
        """Return the messages lost by each node that is not a reader, without nodes that lost none."""
        found: dict[str, int] = {}
        for (node, _), each in sorted(self._processes.items(), key=lambda item: item[0]):
            if each.total and not self._counts(node):
                found[node] = saturating_add(found.get(node, 0), each.total)
        return found

    def _counts(self, node: str) -> bool:
        return not self._readers or node in self._readers


def _lies_in(topic: str, namespace: str, apart: Collection[str]) -> bool:
    """Whether a robot's topic, given without its leading slash, is in a namespace and in none of ``apart``."""
    if namespace != "/":
        return f"/{topic}".startswith(f"{namespace}/")
    return f"/{topic}" not in _GLOBAL_TOPICS and not any(f"/{topic}".startswith(f"{each}/") for each in apart)


StampedMessage = Odometry | Path | GoalStatus | BaseStatus | JointState | JointControllerState
GradedMessage = StampedMessage | BrakingSpec | ArmSpec


MAX_ROBOTS = 1000
"""Maximum number of measured robots and turtles."""
MAX_PENDING = 20_000
"""Maximum number of messages kept with stamps in the future; beyond it, those furthest ahead are dropped as invalid."""


class MessageKind(IntEnum):
    """Order in which messages with the same stamp are processed."""

    PLAN = 0
    STATUS = 1
    ODOMETRY = 2
    TRUTH = 3
    BASE = 4
    BRAKING = 5
    JOINTS = 6
    CONTROL = 7
    ARM = 8


class Measurement:
    """All measurements since the start or the last reset of the simulation.

    Results do not depend on the order of arrival: messages wait until ``advance`` passes their stamps. ``namespaces``
    are the robots' namespaces by name, where the two differ.
    """

    def __init__(
        self,
        robots: Iterable[str],
        reach_tolerance: float,
        halting: Mapping[str, BrakingSpec] | None = None,
        arms: Mapping[str, ArmSpec] | None = None,
        readers: Collection[str] = (),
        namespaces: Mapping[str, str] | None = None,
        sizes: Mapping[str, SizeSpec] | None = None,
    ) -> None:
        bases, arm_specs = halting or {}, arms or {}
        self.robots: dict[str, RobotMeter | ArmMeter] = {
            name: ArmMeter(arm_specs[name]) if name in arm_specs else RobotMeter(reach_tolerance, bases.get(name))
            for name in sorted(robots)
        }
        self._finishing = frozenset(self.robots)
        self._reach_tolerance = reach_tolerance
        self.losses, self._namespaces = MessageLosses(readers), dict(namespaces or {})
        self.clearance = ClearanceMeter(sizes or {})
        self._pending: list[tuple[int, MessageKind, str, GradedMessage]] = []
        self._end = 0
        self._distance_stamp = -1
        self._positions: dict[str, Point] = {}

    def add_messages(self, kind: MessageKind, robot: str, messages: Iterable[StampedMessage]) -> None:
        """Add messages of one robot, to be processed when ``advance`` passes their stamps."""
        self._pending += [(message.header.stamp.ns, kind, robot, message) for message in messages]

    def add_turtles(self, states: Iterable[WorldStates]) -> None:
        """Add poses of turtles, which are measured as robots from their first pose on."""
        for each in states:
            for name, pose, twist in zip(each.name, each.pose, each.twist, strict=False):
                if name not in self.robots:
                    if len(self.robots) >= MAX_ROBOTS:
                        continue
                    self.robots[name] = RobotMeter(self._reach_tolerance)
                truth = Odometry(
                    header=each.header, pose=PoseWithCovariance(pose=pose), twist=TwistWithCovariance(twist=twist)
                )
                self.add_messages(MessageKind.TRUTH, name, [truth])

    def set_braking(self, stamp: int, robot: str, braking: BrakingSpec) -> None:
        """Set how the base of a robot brakes from ``stamp`` [ns] on."""
        self._pending.append((stamp, MessageKind.BRAKING, robot, braking))

    def set_arm(self, stamp: int, robot: str, arm: ArmSpec) -> None:
        """Set the specification of an arm from ``stamp`` [ns] on."""
        self._pending.append((stamp, MessageKind.ARM, robot, arm))

    def add_heartbeats(self, beats: Iterable[Health]) -> None:
        """Add heartbeats of any nodes."""
        for beat in beats:
            self.losses.add_heartbeat(beat)

    def advance(self, end: int) -> None:
        """Process all messages with stamps up to ``end`` [ns]."""
        self._end = max(self._end, end)
        ready = [each for each in self._pending if each[0] <= end]
        self._pending = [each for each in self._pending if each[0] > end]
        if len(self._pending) > MAX_PENDING:
            self._pending = sorted(self._pending, key=lambda each: each[:3])[:MAX_PENDING]
        ready.sort(key=lambda each: each[:3])
        for each in ready:
            self._process(*each)
        self.clearance.update()

    @property
    def finished(self) -> bool:
        """Whether all robots have finished their plans, and all arms rest at their set-points; turtles have none."""
        return bool(self._finishing) and all(self.robots[name].finished_at is not None for name in self._finishing)

    def measurements(self, ended: EndReason, lockstep: LockstepState | None = None) -> Measurements:
        """Return all figures up to the last ``advance``; ``lockstep`` is the last state of the members."""
        self._measure_distances()
        self.clearance.update(final=True)
        return Measurements(
            ended=ended,
            sim_seconds=self._end / SECOND,
            trajectory_hash=trajectory_hash({name: meter.fingerprint for name, meter in self.robots.items()}),
            messages_lost=self.losses.total_losses(),
            onlookers_lost=self.losses.observer_losses(),
            members_lost=lockstep.lost if lockstep is not None else None,
            members_left=lockstep.left if lockstep is not None else (),
            ticks_missed=self.losses.missed_ticks(),
            losses=self.losses.topic_losses(),
            robots={name: self._result(name, meter) for name, meter in self.robots.items()},
        )

    def _result(self, name: str, meter: RobotMeter | ArmMeter) -> Figures:
        lost = self._messages_lost(name)
        if isinstance(meter, ArmMeter):
            return meter.result(lost)
        return meter.result(lost, self.clearance.least.get(name))

    def _messages_lost(self, name: str) -> int:
        meter = self.robots[name]
        spaces = {each: self._namespaces.get(each, f"/{each}") for each in self.robots}
        controller = meter.arm.state.rpartition("/")[0] if isinstance(meter, ArmMeter) else ""
        return self.losses.robot_losses(spaces.pop(name), spaces.values(), controller)

    def _process(self, stamp: int, kind: MessageKind, name: str, message: GradedMessage) -> None:
        match self.robots[name], kind, message:
            case RobotMeter() as meter, MessageKind.TRUTH, Odometry():
                self._update_distances(stamp, name, meter.add_truth(message))
                place = message.pose.pose.position
                self.clearance.add_position(stamp, name, (place.x, place.y, place.z))
            case RobotMeter() as meter, MessageKind.ODOMETRY, Odometry():
                meter.odometry_error.add_odometry(message)
            case RobotMeter() as meter, MessageKind.PLAN, Path():
                meter.add_message(message)
            case RobotMeter() as meter, MessageKind.STATUS, GoalStatus():
                meter.add_message(message)
            case RobotMeter() as meter, MessageKind.BASE, BaseStatus():
                meter.add_base_status(message)
            case RobotMeter() as meter, MessageKind.BRAKING, BrakingSpec():
                meter.stops.braking = message
            case ArmMeter() as arm, MessageKind.JOINTS, JointState():
                arm.add_joint_state(message)
            case ArmMeter() as arm, MessageKind.CONTROL, JointControllerState():
                arm.add_control_state(message)
            case ArmMeter() as arm, MessageKind.ARM, ArmSpec():
                arm.arm = message

    def _update_distances(self, stamp: int, name: str, here: Point) -> None:
        """Collect samples with the same stamp, between which distances are measured."""
        if stamp != self._distance_stamp:
            self._measure_distances()
            self._distance_stamp = stamp
        self._positions[name] = here

    def _measure_distances(self) -> None:
        """Update each robot's smallest distance to another one from the collected samples."""
        collected, self._positions = self._positions, {}
        if len(collected) < 2:
            return
        places = list(collected.values())
        x, y = np.array(places).T
        squares = np.square(x[:, None] - x) + np.square(y[:, None] - y)
        np.fill_diagonal(squares, np.inf)
        for name, here, nearest in zip(collected, places, squares.argmin(1).tolist(), strict=True):
            meter = self.robots[name]
            assert isinstance(meter, RobotMeter)
            meter.min_distance = min(meter.min_distance, math.dist(here, places[nearest]))
