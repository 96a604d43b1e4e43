"""The measuring of a run: messages of all robots go in as they come and are judged in the order of their stamps."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from enum import IntEnum

from messages.control import JointControllerState
from messages.elea import BaseStatus, GoalStatus, Health, LockstepState
from messages.nav import Odometry, Path
from messages.sensor import JointState
from messages.std import SECOND
from services.grader import Arm, Halting
from services.grader.arm import ArmMeter
from services.grader.losses import Losses
from services.grader.records import Ended, Measurements
from services.grader.reference import Point
from services.grader.robot import RobotMeter
from services.grader.trajectory import trajectory_hash

Stamped = Odometry | Path | GoalStatus | BaseStatus | JointState | JointControllerState
Judged = Stamped | Halting | Arm


MOST_WAITING = 20_000
"""Messages stamped ahead of the time that are kept; of more, those furthest ahead are dropped: they are no run's."""


class Kind(IntEnum):
    """The order in which messages of one stamp are judged."""

    PLAN = 0
    STATUS = 1
    ODOMETRY = 2
    TRUTH = 3
    BASE = 4
    HALTING = 5
    JOINTS = 6
    CONTROL = 7
    ARM = 8


class Run:
    """Everything measured since the start or the last reset of the simulation.

    Nothing depends on the order of arrival: messages wait until ``advance`` passes their stamps.
    """

    def __init__(
        self,
        robots: Iterable[str],
        reach_tolerance: float,
        halting: Mapping[str, Halting] | None = None,
        arms: Mapping[str, Arm] | None = None,
        readers: Collection[str] = (),
    ) -> None:
        bases, jointed = halting or {}, arms or {}
        self.robots: dict[str, RobotMeter | ArmMeter] = {
            name: ArmMeter(jointed[name]) if name in jointed else RobotMeter(reach_tolerance, bases.get(name))
            for name in sorted(robots)
        }
        self.losses = Losses(readers)
        self._waiting: list[tuple[int, Kind, str, Judged]] = []
        self._end = 0
        self._instant = -1
        self._places: dict[str, Point] = {}

    def take(self, kind: Kind, robot: str, messages: Iterable[Stamped]) -> None:
        """Take messages of one robot, to be judged when ``advance`` passes their stamps."""
        self._waiting += [(message.header.stamp.ns, kind, robot, message) for message in messages]

    def halting(self, stamp: int, robot: str, halting: Halting) -> None:
        """The base of a robot stops like this from ``stamp`` [ns] on."""
        self._waiting.append((stamp, Kind.HALTING, robot, halting))

    def arm(self, stamp: int, robot: str, arm: Arm) -> None:
        """What is known of an arm from ``stamp`` [ns] on."""
        self._waiting.append((stamp, Kind.ARM, robot, arm))

    def health(self, beats: Iterable[Health]) -> None:
        """Take heartbeats of any nodes."""
        for beat in beats:
            self.losses.take(beat)

    def advance(self, end: int) -> None:
        """Judge everything stamped up to ``end`` [ns]."""
        self._end = max(self._end, end)
        ready = [each for each in self._waiting if each[0] <= end]
        self._waiting = [each for each in self._waiting if each[0] > end]
        if len(self._waiting) > MOST_WAITING:
            self._waiting = sorted(self._waiting, key=lambda each: each[:3])[:MOST_WAITING]
        ready.sort(key=lambda each: each[:3])
        for each in ready:
            self._judge(*each)

    @property
    def finished(self) -> bool:
        """Whether every robot has finished its plan, and every arm rests where it should."""
        return bool(self.robots) and all(meter.finished_at is not None for meter in self.robots.values())

    def measurements(self, ended: Ended, lockstep: LockstepState | None = None) -> Measurements:
        """All figures up to the last ``advance``; ``lockstep`` is what the simulation told last of its members."""
        return Measurements(
            ended=ended,
            sim_seconds=self._end / SECOND,
            trajectory_hash=trajectory_hash({name: meter.fingerprint for name, meter in self.robots.items()}),
            messages_lost=self.losses.total(),
            onlookers_lost=self.losses.onlookers(),
            members_lost=lockstep.lost if lockstep is not None else None,
            members_left=lockstep.left if lockstep is not None else (),
            ticks_missed=self.losses.missed(),
            robots={name: meter.figures(self._lost(name)) for name, meter in self.robots.items()},
        )

    def _lost(self, name: str) -> int:
        jointed = isinstance(self.robots[name], ArmMeter)
        return self.losses.of(name) + (self.losses.of("robot_control") if jointed else 0)

    def _judge(self, stamp: int, kind: Kind, name: str, message: Judged) -> None:
        match self.robots[name], kind, message:
            case RobotMeter() as meter, Kind.TRUTH, Odometry():
                self._space(stamp, name, meter.truth(message))
            case RobotMeter() as meter, Kind.ODOMETRY, Odometry():
                meter.drift.take(message)
            case RobotMeter() as meter, Kind.PLAN, Path():
                meter.tell(message)
            case RobotMeter() as meter, Kind.STATUS, GoalStatus():
                meter.tell(message)
            case RobotMeter() as meter, Kind.BASE, BaseStatus():
                meter.base(message)
            case RobotMeter() as meter, Kind.HALTING, Halting():
                meter.stops.halting = message
            case ArmMeter() as arm, Kind.JOINTS, JointState():
                arm.joints(message)
            case ArmMeter() as arm, Kind.CONTROL, JointControllerState():
                arm.control(message)
            case ArmMeter() as arm, Kind.ARM, Arm():
                arm.arm = message

    def _space(self, stamp: int, name: str, here: Point) -> None:
        """Distances between the robots that have a sample of one and the same instant."""
        if stamp != self._instant:
            self._instant, self._places = stamp, {}
        for other, there in self._places.items():
            distance = math.hypot(here[0] - there[0], here[1] - there[1])
            for each in (self.robots[name], self.robots[other]):
                assert isinstance(each, RobotMeter)
                each.nearest = min(each.nearest, distance)
        self._places[name] = here
