"""The simulation's stage in one process: real PyBullet, the network in memory, time that only the test moves."""

from __future__ import annotations

import io
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from messages.base import Message
from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.nav import Odometry
from messages.requests import Request
from messages.topics import BASE_STATUS, CMD_VEL, GROUND_TRUTH, ODOM, Topic
from models.scene import Scene
from services.runtime.calls import call
from services.runtime.identity import Identity
from services.runtime.inputs import Input
from services.runtime.log import Log
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.wire import encoding
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.parameters.record import build
from services.runtime.service import STEP_NS
from services.sim import BaseParameters, RobotEntry
from services.sim.base.base import Base
from services.sim.desk import Desk
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Placement
from services.sim.robot import Robot
from services.sim.stage import CONTROL, Stage
from services.sim.timing import Real

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)
NAME = "p3dx"
CONTROL_S = CONTROL * STEP_NS / 1e9


class Rehearsal:
    """A stage with one robot, commands to it, and what it tells."""

    def __init__(self, stage: Stage, bus: MemoryBus, node: Node, log: io.StringIO) -> None:
        self.stage, self.bus, self.node, self._log = stage, bus, node, log
        self._transport = MemoryTransport(bus)
        self._outputs: dict[tuple[str, str], Output[Any]] = {}
        self._inputs: dict[str, tuple[Input[Any], list[Any]]] = {}
        self.hear(GROUND_TRUTH)
        self.hear(ODOM)
        self.hear(BASE_STATUS)

    @property
    def robot(self) -> Robot:
        return self.stage.find(NAME)

    @property
    def log(self) -> str:
        return self._log.getvalue()

    @property
    def now(self) -> float:
        """Simulation time, s."""
        return self.stage.now / 1e9

    def hear(self, topic: Topic[Any]) -> None:
        """Keep what comes on a topic of the robot from now on."""
        key = f"{NAME}/{topic.name}"
        self._inputs[topic.name] = Input(topic, f"/{key}", key, self._transport), []

    def heard(self, topic: Topic[M]) -> list[M]:
        """What has come on it, oldest first."""
        came, messages = self._inputs[topic.name]
        came.admit()
        messages += [message for message, _ in came.batch]
        return messages

    def last(self, topic: Topic[M]) -> M:
        """The newest of it."""
        return self.heard(topic)[-1]

    def send(self, topic: Topic[Any], message: Message, sender: str = "/controller") -> None:
        """Publish as a node."""
        if (topic.name, sender) not in self._outputs:
            key = f"{NAME}/{topic.name}"
            self._outputs[topic.name, sender] = Output(topic, f"/{key}", key, sender, self._transport)
        self._outputs[topic.name, sender].publish(message)

    def run(self, seconds: float) -> None:
        """Let simulation time go on."""
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.stage.tell()
            if self.stage.tick % CONTROL == 0:
                # Factor 0: how long the test's own process dawdles makes no command older.
                self.stage.listen(None, 0.0)
            self.stage.advance()

    def drive(self, v: float, w: float, seconds: float, period: float = 0.04) -> None:
        """Command at 25 Hz for a time, a whole number of control ticks."""
        ticks = round(seconds / CONTROL_S)
        for tick in range(ticks):
            if tick % round(period / CONTROL_S) == 0:
                self.send(CMD_VEL, Twist.planar(v, w))
            self.run(CONTROL_S)

    def ask(self, request: Request[M, R], message: M) -> R:
        """Ask the simulation as another process would; raises CallFailed."""
        with ThreadPoolExecutor(1) as pool:
            key = request.name.lstrip("/")
            asked = pool.submit(call, MemoryTransport(self.bus), request, key, message, 20.0)
            while not asked.done():
                self.node.turn()
            return asked.result()

    def put(self, topic: Topic[Any], payload: bytes) -> None:
        """Publish as a program that is not ours."""
        key = f"{NAME}/{topic.name}"
        self._transport.publish(key, encoding(topic.record.ROS_TYPE), topic.quality).put(payload, attachment=b"")

    @property
    def base(self) -> Base:
        assert self.robot.base is not None
        return self.robot.base

    def status(self) -> BaseStatus:
        """What the base says of itself."""
        self.robot.report(self.stage.now)
        return self.last(BASE_STATUS)

    def truth(self) -> Odometry:
        """Where the robot is now."""
        self.stage.tell()
        return self.last(GROUND_TRUTH)


@contextmanager
def rehearsal(model: str = "p3dx", at: Placement | None = None, **parameters: object) -> Iterator[Rehearsal]:
    """A robot ``p3dx`` of some model alone in an empty world."""
    bus, log, identity = MemoryBus(), io.StringIO(), Identity.of("sim", "/")
    with (
        BulletWorld(Scene(), STEP_NS) as world,
        Node(MemoryTransport(bus), identity, "sim", Log(identity.node, out=log)) as node,
    ):
        stage = Stage(node, world, 0)
        Desk(stage, Real(stage, node, 1000), node)
        stage.spawn(RobotEntry(name=NAME, model=model, parameters=given(**parameters)), at or Placement())
        yield Rehearsal(stage, bus, node, log)


def given(**parameters: object) -> BaseParameters:
    """Parameters as a fleet file gives them."""
    return build(BaseParameters, parameters)
