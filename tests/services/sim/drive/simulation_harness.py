"""The simulation in one process: a real physics engine, the in-memory transport, and time advanced by the test."""

from __future__ import annotations

import io
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from messages.base import Message
from messages.elea import BaseStatus
from messages.geometry import Twist
from messages.names import Identity
from messages.nav import Odometry
from messages.requests import Request
from messages.se3 import Pose3
from messages.topics import BASE_STATUS, CMD_VEL, GROUND_TRUTH, ODOM, Topic
from models.world import WorldDescription
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.validation import build
from services.runtime.publisher import Publisher
from services.runtime.requests import call
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding
from services.sim.actuation import BaseActuation
from services.sim.drive.controller import DiffDriveController
from services.sim.engines import Engine, default_engine, open_world
from services.sim.loop import SimulationLoop
from services.sim.parameters import BaseParameters, RobotEntry
from services.sim.robot import Robot
from services.sim.robot_topics import CONTROL_STEPS
from services.sim.services import SimulationServices
from services.sim.simulation import Simulation
from services.sim.time_modes import RealTime

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)
NAME = "p3dx"
CONTROL_S = CONTROL_STEPS * STEP_NS / 1e9


class SimulationHarness:
    """A simulation with one robot, commands to it, and what it publishes."""

    def __init__(self, loop: SimulationLoop, bus: MemoryBus, node: Node, log: io.StringIO) -> None:
        self.simulation, self.bus, self.node, self._loop, self._log = loop.simulation, bus, node, loop, log
        self._published = -1, -1
        self._transport = MemoryTransport(bus)
        self._outputs: dict[tuple[str, str], Publisher[Any]] = {}
        self._inputs: dict[str, tuple[Subscriber[Any], list[Any]]] = {}
        self.subscribe(GROUND_TRUTH)
        self.subscribe(ODOM)
        self.subscribe(BASE_STATUS)

    @property
    def robot(self) -> Robot:
        return self.simulation.find(NAME)

    @property
    def log(self) -> str:
        return self._log.getvalue()

    @property
    def now(self) -> float:
        """Simulation time [s]."""
        return self.simulation.now / 1e9

    def subscribe(self, topic: Topic[Any]) -> None:
        """Subscribe to a topic of the robot and keep its messages."""
        key = f"{NAME}/{topic.name}"
        self._inputs[topic.name] = Subscriber(topic, f"/{key}", key, self._transport), []

    def received(self, topic: Topic[M]) -> list[M]:
        """Return all messages of a subscribed topic, oldest first."""
        came, messages = self._inputs[topic.name]
        came.update()
        messages += [message for message, _ in came.messages]
        return messages

    def latest(self, topic: Topic[M]) -> M:
        """Return the latest message of a topic."""
        return self.received(topic)[-1]

    def publish(self, topic: Topic[Any], message: Message, sender: str = "/controller") -> None:
        """Publish on a topic of the robot as the node ``sender``."""
        if (topic.name, sender) not in self._outputs:
            key = f"{NAME}/{topic.name}"
            self._outputs[topic.name, sender] = Publisher(topic, f"/{key}", key, sender, self._transport)
        self._outputs[topic.name, sender].publish(message)

    def run(self, seconds: float) -> None:
        """Advance simulation time by ``seconds``."""
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.publish_state()
            if self.simulation.tick % CONTROL_STEPS == 0:
                # Factor 0: delays of the test process make no command older.
                self.simulation.read_inputs(None, 0.0)
            self.simulation.step()

    def publish_state(self) -> None:
        """Publish the messages due at this tick, once."""
        at = self.simulation.epoch, self.simulation.tick
        if self._published != at:
            self._published = at
            self.simulation.publish()

    def drive(self, v: float, w: float, seconds: float, period: float = 0.04) -> None:
        """Publish a command at 25 Hz for ``seconds``, a whole number of control ticks."""
        ticks = round(seconds / CONTROL_S)
        for tick in range(ticks):
            if tick % round(period / CONTROL_S) == 0:
                self.publish(CMD_VEL, Twist.planar(v, w))
            self.run(CONTROL_S)

    def call(self, request: Request[M, R], message: M) -> R:
        """Call the simulation as another process does; raises CallFailed."""
        with ThreadPoolExecutor(1) as pool:
            key = request.name.lstrip("/")
            asked = pool.submit(call, MemoryTransport(self.bus), request, key, message, 60.0)
            while not asked.done():
                self.node.spin_once()
                self._loop.apply_requests()
            return asked.result()

    def publish_raw(self, topic: Topic[Any], payload: bytes) -> None:
        """Publish a payload as a foreign program does."""
        key = f"{NAME}/{topic.name}"
        self._transport.advertise(key, encoding(topic.record.ROS_TYPE), topic.quality).put(payload, attachment=b"")

    @property
    def base(self) -> DiffDriveController:
        assert isinstance(self.robot.actuation, BaseActuation)
        return self.robot.actuation.controller

    def status(self) -> BaseStatus:
        """The base's current status."""
        self.robot.publish_status(self.simulation.now)
        return self.latest(BASE_STATUS)

    def truth(self) -> Odometry:
        """The robot's current ground truth."""
        self.publish_state()
        return self.latest(GROUND_TRUTH)


@contextmanager
def run_simulation(
    model: str = "p3dx",
    at: Pose3 | None = None,
    seed: int = 0,
    engine: Engine | None = None,
    **parameters: object,
) -> Iterator[SimulationHarness]:
    """Run a simulation with one robot, named ``p3dx`` whatever its model, in an empty world."""
    bus, log, identity = MemoryBus(), io.StringIO(), Identity.of("sim", "/")
    with (
        open_world(engine or default_engine(), WorldDescription(), STEP_NS) as world,
        Node(MemoryTransport(bus), identity, "sim", Log(identity.node, out=log)) as node,
    ):
        simulation = Simulation(node, world, seed)
        SimulationServices(simulation, node)
        simulation.spawn(RobotEntry(name=NAME, model=model, parameters=base_parameters(**parameters)), at or Pose3())
        yield SimulationHarness(SimulationLoop(simulation, RealTime(simulation, node, 1000), node), bus, node, log)


def base_parameters(**parameters: object) -> BaseParameters:
    """Build base parameters as from a fleet file."""
    return build(BaseParameters, parameters)
