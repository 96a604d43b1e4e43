"""The stage: the world with its robots, advanced step by step and published tick by tick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from messages.elea import EmergencyStops as EmergencyStopList
from messages.names import BadName, validate
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import CLOCK, E_STOP, STOPS, TF, TF_STATIC
from services.runtime.errors import BadInput, unknown
from services.runtime.inputs import Input
from services.runtime.lockstep.marks import Marks
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.service import STEP_NS
from services.sim import RobotEntry
from services.sim.ages import Ages
from services.sim.commanders import Commanders
from services.sim.everything import Everything
from services.sim.frames import fixed, moving
from services.sim.joints.wrenches import Wrenches
from services.sim.physics.world import Placement, World
from services.sim.robot import Robot
from services.sim.stops import ALL, EmergencyStops

CONTROL = 4
"""Physics steps between two looks at the commands, and two messages of the clock: 50 Hz. Where joints are told faster,
these come as often, for who controls them; in lockstep, members are heard whenever they are due."""
FRAMES = 8
"""Physics steps between two messages of ``/tf``, and of all states: 25 Hz, as odometry comes."""
STATUS = 40
"""Physics steps between two states of the bases: 5 Hz."""


class Stage:
    """Everything that moves, and simulation time: ``tick`` counts physics steps since the last reset.

    ``held`` tells that this tick's wait is over: what is left of it is the step. ``pace`` is CONTROL, or less where
    time follows the wall clock. Emergency stops outlive the process in ``stops_file``, where one is given.
    """

    def __init__(
        self, node: Node, world: World, seed: int, real_time: bool = True, stops_file: Path | None = None
    ) -> None:
        self.world, self.tick, self.epoch, self.paused, self.held = world, 0, 0, False, False
        self.outbox = node.outbox
        self._node, self._seed, self._real_time = node, seed, real_time
        self._robots: dict[str, tuple[Robot, Placement]] = {}
        self.wrenches = Wrenches(world, node.log)
        self._commanders, self._ages = Commanders(node.transport), Ages()
        self._gone: list[bytes] = []
        self._clock: Output[Any] = node.write(CLOCK)
        self._tf: Output[Any] = node.write(TF)
        self._tf_static: Output[Any] = node.write(TF_STATIC)
        self._everything = Everything(node, world)
        self._e_stop: Input[Any] = node.read(E_STOP, f"/{E_STOP.name}")
        self.stops = EmergencyStops(stops_file, self._commanders.name_of, node.log)
        self._stops: Output[Any] = node.write(STOPS)
        self.stops.load()
        self.stops.keep()
        self._tell_stops()
        self._told = -1
        self.pace = CONTROL

    @property
    def now(self) -> int:
        """Simulation time, ns."""
        return self.tick * STEP_NS

    @property
    def robots(self) -> list[Robot]:
        """All robots, in the order of their spawning."""
        return [robot for robot, _ in self._robots.values()]

    def find(self, name: str) -> Robot:
        """The robot of a name; raises BadInput."""
        if name not in self._robots:
            raise unknown("model", name, self._robots)
        return self._robots[name][0]

    def spawn(self, entry: RobotEntry, place: Placement, wait: bool = False) -> Robot:
        """Add a robot; raises BadInput when its name is taken or wrong, or it would overlap with something.

        What is stopped by its name, or while all are, is so from the start. With ``wait`` it starts on the parameters
        that the parameter service has for it, else they come a moment later.
        """
        try:
            validate(entry.name)
            validate(entry.namespace or entry.name)
        except BadName as error:
            raise BadInput(f"a robot cannot have this name: {error}") from None
        if entry.name in self._robots:
            raise BadInput(f"a robot {entry.name!r} is already there")
        robot = Robot(self._node, self.world, entry, place, self._seed, self._commanders, self._ages, wait)
        self._robots[entry.name] = robot, place
        robot.stop(self.stops.holders(entry.name))
        self._set_pace()
        self.tell_frames()
        return robot

    def delete(self, name: str) -> None:
        """Take a robot out; raises BadInput when there is none of this name."""
        self.find(name).close()
        self.wrenches.forget(name)
        del self._robots[name]
        self.stops.forget(name)
        self._keep_stops()
        self._set_pace()
        self.tell_frames()

    def restart(self, time_too: bool) -> None:
        """Put everything where it was spawned; with ``time_too`` time begins anew in a new epoch."""
        self.world.reset()
        self.wrenches.restart()
        if time_too:
            self.held, self._told = False, -1
            self.tick = 0
            self.epoch += 1
        for robot in self.robots:
            robot.restart()
        self.tell_frames()

    def tell(self) -> None:
        """Publish what is due at this tick, unless that is done."""
        now, tick = self.now, self.tick
        if self._told == tick:
            return
        self._told = tick
        if tick % 2 == 0:
            for robot in self.robots:
                robot.telemetry.sensors(now, tick)
        for robot in self.robots:
            robot.telemetry.joint_states(now, tick)
        if tick % CONTROL == 0:
            self._tell_motion(now, tick)
        if tick % self.pace == 0:
            self.tell_time()

    def _tell_motion(self, now: int, tick: int) -> None:
        self._touch()
        for robot in self.robots:
            robot.telemetry.motion(now, tick)
            if tick % STATUS == 0:
                robot.report(now)
        if tick % FRAMES == 0:
            self._everything.tell()
            if self._tf.wanted:
                for message in moving(self.robots, self.world, now):
                    self._tf.publish(message)

    def tell_frames(self) -> None:
        """Publish the fixed transforms."""
        self._tf_static.publish(fixed(self._robots.values(), self.now))

    def tell_time(self) -> None:
        """Publish the clock."""
        self._clock.publish(Clock(clock=Time.of(self.now), tick=self.tick, epoch=self.epoch, paused=self.paused))

    def listen(self, marks: Marks | None, factor: float) -> None:
        """Take the commands and parameters that have come. ``marks`` are lockstep's, ``factor`` is that of real time.

        Who is gone counts last: a command that came just before its sender went must not outlive it.
        """
        self._node.admit(marks)
        self._gone += self._commanders.gone()
        self._obey_stops()
        governed = marks.members if marks is not None else set()
        gone, self._gone = self._gone, []
        if marks is not None and marks.died:
            # Lockstep goes on without them from this tick; the tokens of their publications may go a moment later.
            gone += self._commanders.of(marks.died)
            marks.died = set()
        for robot in self.robots:
            robot.follow(self.now)
            robot.obey(self.now, governed, factor)
        for source in gone:
            for robot in self.robots:
                robot.lost(source, self.now)

    def listen_for_stops(self, marks: Marks | None) -> None:
        """Take the emergency stops that have come, and nothing else: while time is paused they count, too."""
        for each in dict.fromkeys((self._e_stop, *(robot.e_stop for robot in self.robots))):  # robots may share one
            each.admit(marks)
        self._gone += self._commanders.gone()  # for their names; that they are gone counts with their last commands
        self._obey_stops()

    def release(self, robot: str, holder: str) -> str:
        """Release emergency stops that others hold, as ``EmergencyStops.release`` does; raises BadInput."""
        done = self.stops.release(robot, holder)
        self._keep_stops()
        return done

    def advance(self) -> None:
        """One physics step."""
        now = self.now
        for robot, _ in self._robots.values():
            robot.drive(now)
        self.wrenches.step(now)
        self.world.step()
        self.tick += 1
        self.held = False

    def _obey_stops(self) -> None:
        """Stop first, then write, then tell: nothing moves meanwhile, and what is told outlives this process."""
        all_asked = self.stops.hear(ALL, self._e_stop.name, self._e_stop.batch)
        for robot in self.robots:
            asked = self.stops.hear(robot.name, robot.e_stop.name, robot.e_stop.batch)
            if asked or all_asked:
                robot.stop(self.stops.holders(robot.name), asked=True)
        self._keep_stops()

    def _keep_stops(self) -> None:
        if not self.stops.keep():
            return
        for robot in self.robots:
            robot.stop(self.stops.holders(robot.name))
        self._tell_stops()

    def _tell_stops(self) -> None:
        self._stops.publish(EmergencyStopList(stops=self.stops.all))

    def _set_pace(self) -> None:
        rates = [robot.telemetry.joint_steps for robot in self.robots if robot.actuators is not None]
        self.pace = min([CONTROL, *rates]) if self._real_time else CONTROL

    def _touch(self) -> None:
        contacts = self.world.contacts()
        for robot in self.robots:
            robot.touch(frozenset(_partners(robot.name, contacts)))


def _partners(name: str, contacts: tuple[Any, ...]) -> list[str]:
    """What a body touches."""
    return [c.other if c.body == name else c.body for c in contacts if name in (c.body, c.other)]
