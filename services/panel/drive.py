"""Driving from a page, with a dead-man's switch on this side: what the page does not say again stops the robot.

A page says what it wants for as long as a hand is on the stick. When it falls silent, hides, loses its connection or
hangs, the hand counts as gone after ``silence`` of wall time, whatever the page believes. Zero is then held for
``give_way`` of simulation time, so that the robot stands, and after that others may drive again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from messages.geometry import Twist, TwistStamped, Vector3
from messages.std import Header, Time
from messages.topics import CMD_VEL, Quality, Topic
from services.motion.voice import Voice
from services.panel import PanelParameters
from services.panel.page import Page
from services.panel.robots import Robot, Robots
from services.panel.words import Drive
from services.runtime.errors import BadInput, unknown
from services.runtime.node import Node
from services.runtime.outputs import Output

RATE = 20.0
"""Commands per second of wall time while a hand is on the stick."""

STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, Quality.COMMAND, CMD_VEL.about)
"""``cmd_vel`` of bases that take it with its time."""


class Motion(NamedTuple):
    """Speed ahead [m/s] and turn rate to the left [rad/s]."""

    v: float = 0.0
    w: float = 0.0


STILL = Motion()


@dataclass
class _Seat:
    """Who drives a robot, and what was last wanted, at ``heard`` [s of wall time]."""

    page: Page | None
    output: Output[Any]
    record: str
    voice: Voice[Motion]
    wanted: Motion = STILL
    heard: float = 0.0


class Driver:
    """One seat for each robot that is driven from a page."""

    def __init__(self, node: Node, robots: Robots, params: PanelParameters) -> None:
        self.params = params
        self._node, self._robots = node, robots
        self._seats: dict[str, _Seat] = {}
        self._era = self._sim_ns = 0

    @property
    def busy(self) -> bool:
        """Whether any robot is driven, or still told to stand."""
        return bool(self._seats)

    def drive(self, page: Page, said: Drive, now: float) -> None:
        """A hand is on the stick; raises BadInput when it may not be."""
        p = self.params
        robot = self._robots.found.get(said.robot)
        if robot is None:
            raise unknown("robot", said.robot, self._robots.found)
        if not robot.drives:
            raise BadInput(f"{said.robot} takes no commands on {CMD_VEL.name}")
        if abs(said.v) > p.max_linear or abs(said.w) > p.max_angular:
            raise BadInput(
                f"{said.v:g} m/s and {said.w:g} rad/s: no page drives faster than {p.max_linear:g} m/s and "
                f"{p.max_angular:g} rad/s (parameters max_linear, max_angular of the panel)"
            )
        seat = self._seats.get(said.robot)
        if seat is None:
            seat = self._seats[said.robot] = self._sit(robot)
        if seat.page is not None and seat.page is not page:
            raise BadInput(f"another page drives {said.robot}: it has to let go first")
        seat.page, seat.wanted, seat.heard = page, Motion(said.v, said.w), now

    def release(self, page: Page) -> None:
        """The hand is off the stick, or the page is gone."""
        for seat in self._seats.values():
            if seat.page is page:
                seat.page = None

    def turn(self, now: float, sim_ns: int, era: int) -> None:
        """Send what is due; ``now`` is wall time [s]."""
        self._sim_ns = sim_ns
        if era != self._era:
            self._era = era
            for seat in self._seats.values():
                seat.voice.restart()
        for name, seat in list(self._seats.items()):
            if name not in self._robots.found:
                self._leave(name)
                continue
            if seat.page is not None and now - seat.heard > self.params.silence:
                seat.page = None
            motion = seat.wanted if seat.page is not None else None
            said = seat.voice.say(motion, now, sim_ns / 1e9)
            if said is not None:
                self._send(seat, said, sim_ns)
            if seat.voice.state == "silent":
                self._leave(name)

    def close(self) -> None:
        """The panel ends: robots that it drives are told to stand."""
        for seat in self._seats.values():
            self._send(seat, STILL, self._sim_ns)

    def _sit(self, robot: Robot) -> _Seat:
        name, record = f"{robot.namespace}/{CMD_VEL.name}", robot.drives
        topic: Topic[Any] = STAMPED if record == TwistStamped.ROS_TYPE else CMD_VEL
        voice = Voice(RATE, self.params.give_way, STILL)
        return _Seat(None, self._node.write(topic, name), record, voice)

    def _leave(self, name: str) -> None:
        self._node.forget(self._seats.pop(name).output)

    def _send(self, seat: _Seat, motion: Motion, sim_ns: int) -> None:
        twist = Twist(linear=Vector3(x=motion.v), angular=Vector3(z=motion.w))
        if seat.record == TwistStamped.ROS_TYPE:
            seat.output.publish(TwistStamped(header=Header(stamp=Time.of(sim_ns)), twist=twist))
        else:
            seat.output.publish(twist)
