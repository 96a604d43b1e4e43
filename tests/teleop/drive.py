"""A robot to teleoperate, in real processes: a router, a simulation in real time, and what is seen of the robot."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.elea import BaseStatus
from tests.faults.track import STANDING, WHEELS, Order, Sight, Track
from tests.processes import Network, Process
from tests.teleop.seat import Seat, Strokes
from tests.waiting import until

ROBOT = "rover"
"""A burger: at 0.22 m/s it stops within 0.22 s."""
FULL = WHEELS.max_linear
WITHIN_S = 20.0


class Drive:
    """The robot and its network."""

    def __init__(self, network: Network, sim: Process, track: Track) -> None:
        self.network, self.sim, self.track = network, sim, track
        until(lambda: self.look() or self.track.sights, WITHIN_S, "ground truth")

    def look(self) -> None:
        """Take what has come."""
        assert self.sim.status is None, self.sim.text
        self.track.look()

    def wait(self, seconds: float) -> None:
        """Look until so much simulation time has passed."""
        self.look()
        end = self.track.sights[-1].time + seconds * 1e9
        until(lambda: self.look() or self.track.sights[-1].time >= end, WITHIN_S, f"{seconds} s of simulation")

    def wait_standing(self) -> None:
        """Until the robot stands."""
        until(lambda: self.look() or abs(self.track.speed) < STANDING, WITHIN_S, "a robot that stands")

    def status(self) -> BaseStatus:
        """The state of the base, told after this call."""
        self.look()
        known = len(self.track.statuses)
        until(lambda: self.look() or len(self.track.statuses) > known, WITHIN_S, "the state of the base")
        return self.track.base

    def orders(self, since: float, to: float) -> list[Order]:
        """The commands sent between two instants, s of ``time.monotonic``."""
        self.look()
        return [each for each in self.track.orders if wall(since) <= each.sent <= wall(to)]

    def sights(self, since: float, to: float) -> list[Sight]:
        """The robot between two instants, s of ``time.monotonic``."""
        self.look()
        return [each for each in self.track.sights if wall(since) <= each.sent <= wall(to)]

    def stop_after(self, instant: float) -> Order:
        """The first zero that was sent after an instant."""

        def found() -> list[Order]:
            self.look()
            return [each for each in self.track.orders if each.sent > wall(instant) and not each.moves]

        return until(found, WITHIN_S, "a zero")[0]


def wall(instant: float) -> int:
    """An instant of ``time.monotonic`` [s] on the machine's clock, ns."""
    return round((instant + time.time() - time.monotonic()) * 1e9)


@contextmanager
def driving(logs: Path) -> Iterator[Drive]:
    """A robot that stands, in real time."""
    with Network(logs) as network:
        sim = network.start("sim", "--param", f'robots=[{{"name": "{ROBOT}", "model": "burger"}}]')
        with network.node() as node:
            yield Drive(network, sim, Track(node, ROBOT))


@contextmanager
def seated(drive: Drive, *options: str) -> Iterator[Seat]:
    """``elea teleop`` in a terminal of its own, ready for keys; the robot stands, and no command is on its way."""
    arguments = ["-m", "deploy", "teleop", f"/{ROBOT}", "--connect", drive.network.endpoint, *options]
    with Seat(arguments) as seat:
        seat.ready()
        until(lambda: "driving" in seat.text, WITHIN_S, "the display")
        drive.wait_standing()
        yield seat


def smooth(drive: Drive, strokes: Strokes) -> bool:
    """Whether the robot, once at speed, kept it until the last event, and no zero was sent between."""
    first, last = strokes.times[0], strokes.times[-1]
    speeds = [each.speed for each in drive.sights(first, last)]
    at_speed = next(index for index, speed in enumerate(speeds) if speed > 0.95 * FULL)
    return min(speeds[at_speed:]) > 0.95 * FULL and all(each.moves for each in drive.orders(first, last))
