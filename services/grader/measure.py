"""The measuring of a run: messages of all robots go in as they come and are judged in the order of their stamps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from enum import IntEnum

from messages.elea import BaseStatus, GoalStatus, Health
from messages.nav import Odometry, Path
from messages.std import SECOND
from services.grader import Halting
from services.grader.losses import Losses
from services.grader.records import Ended, Measurements
from services.grader.reference import Point
from services.grader.robot import RobotMeter
from services.grader.trajectory import trajectory_hash

Stamped = Odometry | Path | GoalStatus | BaseStatus
Judged = Stamped | Halting


class Kind(IntEnum):
    """The order in which messages of one stamp are judged."""

    PLAN = 0
    STATUS = 1
    ODOMETRY = 2
    TRUTH = 3
    BASE = 4
    HALTING = 5


class Run:
    """Everything measured since the start or the last reset of the simulation.

    Nothing depends on the order of arrival: messages wait until ``advance`` passes their stamps.
    """

    def __init__(
        self, robots: Iterable[str], reach_tolerance: float, halting: Mapping[str, Halting] | None = None
    ) -> None:
        bases = halting or {}
        self.robots = {name: RobotMeter(reach_tolerance, bases.get(name)) for name in sorted(robots)}
        self.losses = Losses()
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

    def health(self, beats: Iterable[Health]) -> None:
        """Take heartbeats of any nodes."""
        for beat in beats:
            self.losses.take(beat)

    def advance(self, end: int) -> None:
        """Judge everything stamped up to ``end`` [ns]."""
        self._end = max(self._end, end)
        ready = [each for each in self._waiting if each[0] <= end]
        self._waiting = [each for each in self._waiting if each[0] > end]
        ready.sort(key=lambda each: each[:3])
        for each in ready:
            self._judge(*each)

    @property
    def finished(self) -> bool:
        """Whether every robot has finished its plan."""
        return bool(self.robots) and all(meter.progress.finished_at is not None for meter in self.robots.values())

    def measurements(self, ended: Ended) -> Measurements:
        """All figures up to the last ``advance``."""
        return Measurements(
            ended=ended,
            sim_seconds=self._end / SECOND,
            trajectory_hash=trajectory_hash({name: meter.fingerprint for name, meter in self.robots.items()}),
            messages_lost=self.losses.total(),
            robots={name: meter.figures(self.losses.of(name)) for name, meter in self.robots.items()},
        )

    def _judge(self, stamp: int, kind: Kind, name: str, message: Judged) -> None:
        meter = self.robots[name]
        match kind, message:
            case Kind.TRUTH, Odometry():
                self._space(stamp, name, meter.truth(message))
            case Kind.ODOMETRY, Odometry():
                meter.drift.take(message)
            case Kind.PLAN, Path():
                meter.tell(message)
            case Kind.STATUS, GoalStatus():
                meter.tell(message)
            case Kind.BASE, BaseStatus():
                meter.base(message)
            case Kind.HALTING, Halting():
                meter.stops.halting = message

    def _space(self, stamp: int, name: str, here: Point) -> None:
        """Distances between the robots that have a sample of one and the same instant."""
        if stamp != self._instant:
            self._instant, self._places = stamp, {}
        for other, there in self._places.items():
            distance = math.hypot(here[0] - there[0], here[1] - there[1])
            for each in (self.robots[name], self.robots[other]):
                each.nearest = min(each.nearest, distance)
        self._places[name] = here
