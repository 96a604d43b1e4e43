"""The simulation with arms in one process: real physics, the in-memory transport, and time advanced by the test."""

from __future__ import annotations

import io
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from messages.base import Message
from messages.gazebo import ApplyEffort, JointName
from messages.joints import JointEffort, JointProperties
from messages.names import Identity
from messages.requests import JOINT_PROPERTIES, Request
from messages.se3 import Pose3
from messages.std import Time
from messages.topics import JOINT_EFFORT, Topic
from models.world import Box, WorldDescription
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.validation import build
from services.runtime.publisher import Publisher
from services.runtime.requests import call
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.sim import SimParameters
from services.sim.engines import default_engine, open_world
from services.sim.gazebo import GazeboServices
from services.sim.loop import SimulationLoop
from services.sim.robot_loader import RobotLoader, with_own_files
from services.sim.services import JointServices, PropertyServices, SimulationServices
from services.sim.simulation import Simulation
from services.sim.time_modes import RealTime

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)
SCENE = WorldDescription(boxes=(Box(name="crate", size=(0.4, 0.4, 0.4), position=(9.0, 0.0, 0.2)),))


class JointSimulation:
    """A simulation, with commands to it and requests of it."""

    def __init__(self, loop: SimulationLoop, bus: MemoryBus, node: Node, log: io.StringIO) -> None:
        self.simulation, self.bus, self.node, self._loop, self._log = loop.simulation, bus, node, loop, log
        self._published = -1, -1
        self._transport = MemoryTransport(bus)
        self._outputs: dict[tuple[str, str], Publisher[Any]] = {}

    @property
    def log(self) -> str:
        return self._log.getvalue()

    def publish(
        self, topic: Topic[Any], message: Message, robot: str = "arm", sender: str = "/controller"
    ) -> Publisher[Any]:
        """Publish as the node ``sender``, in a robot's namespace or, if empty, in the root namespace."""
        key = f"{robot}/{topic.name}".strip("/")
        if (key, sender) not in self._outputs:
            self._outputs[key, sender] = Publisher(topic, f"/{key}", key, sender, self._transport)
        self._outputs[key, sender].publish(message)
        return self._outputs[key, sender]

    def publish_effort(self, effort: float, duration: float = 0.1, joint: str = "bear_link", **more: Any) -> None:
        """Publish an effort job on the arm's topic."""
        self.publish(JOINT_EFFORT, JointEffort(joint_name=joint, effort=effort, duration=duration), **more)

    def run(self, seconds: float, factor: float = 0.0) -> None:
        """Advance by ``seconds``. With factor 0, the test's own run time makes no command older."""
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.publish_state()
            if self.simulation.tick % self.simulation.input_steps == 0:
                self.simulation.read_inputs(None, factor)
            self.simulation.step()

    def publish_state(self) -> None:
        """Publish the messages due at this tick, once."""
        at = self.simulation.epoch, self.simulation.tick
        if self._published != at:
            self._published = at
            self.simulation.publish()

    def call(self, request: Request[Any, R], message: Message) -> R:
        """Call the simulation as another process does; raises CallFailed."""
        with ThreadPoolExecutor(1) as pool:
            asked = pool.submit(call, MemoryTransport(self.bus), request, request.name.lstrip("/"), message, 60.0)
            while not asked.done():
                self.node.spin_once()
                self._loop.apply_requests()
            return asked.result()

    def joint_properties(self, model: str = "arm") -> JointProperties:
        """Return the properties of an arm's joint."""
        return self.call(JOINT_PROPERTIES, JointName(model=model, joint_name="bear_link"))

    def subscribe(self, topic: Topic[M], name: str) -> Subscriber[M]:
        """Return a new subscriber of the test."""
        return Subscriber(topic, name, name.lstrip("/"), self._transport)

    def commands(self, robot: str = "arm") -> Subscriber[Any]:
        """Return the simulation's own subscriber to a robot's efforts."""
        return next(each for each in self.node.subscribers if each.name == f"/{robot}/joint_effort")


@contextmanager
def run_joint_simulation(
    *robots: dict[str, Any], scene: WorldDescription = SCENE, folders: tuple[str, ...] = ()
) -> Iterator[JointSimulation]:
    """Run a simulation with these robots, by default one named ``arm``; requests may spawn others from ``folders``."""
    bus, log, identity = MemoryBus(), io.StringIO(), Identity.of("sim", "/")
    params = build(SimParameters, {"robots": [*robots] or [{"name": "arm", "model": "arm"}]})
    with (
        open_world(default_engine(), scene, STEP_NS) as world,
        Node(MemoryTransport(bus), identity, "sim", Log(identity.node, out=log)) as node,
    ):
        simulation = Simulation(node, world, 0)
        timing = RealTime(simulation, node, 1000)
        loop = SimulationLoop(simulation, timing, node)
        models = SimulationServices(simulation, node, RobotLoader(folders, loop.answer_between_ticks, node.log.info))
        joints = JointServices(simulation, node)
        properties = PropertyServices(simulation, timing, node, params, scene)
        GazeboServices(simulation, node, models, joints, properties, loop)
        for entry in params.robots:
            simulation.spawn(with_own_files(entry), Pose3((entry.x, entry.y, 0.0)))
        yield JointSimulation(loop, bus, node, log)


def robot_entry(name: str, model: str = "arm", **more: Any) -> dict[str, Any]:
    """Return a robot's entry in the simulation's parameters."""
    return {"name": name, "model": model, **more}


def effort_request(
    value: float, duration: float = 0.1, joint: str = "bear_link", model: str = "", start: int = 0
) -> ApplyEffort:
    """Return the request for an effort job."""
    job = JointEffort(joint_name=joint, effort=value, duration=duration, start_time=Time.of(start))
    return ApplyEffort(model=model, job=job)
