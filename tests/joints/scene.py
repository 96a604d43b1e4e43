"""The simulation's stage with arms in one process: real PyBullet, the network in memory, time that the test moves."""

from __future__ import annotations

import io
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from messages.base import Message
from messages.gazebo import JointName
from messages.joints import JointEffort, JointProperties
from messages.requests import JOINT_PROPERTIES, Request
from messages.topics import JOINT_EFFORT, Topic
from models.scene import Box, Scene
from services.runtime.calls import call
from services.runtime.identity import Identity
from services.runtime.inputs import Input
from services.runtime.log import Log
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.node import Node
from services.runtime.outputs import Output
from services.runtime.parameters.record import build
from services.runtime.service import STEP_NS
from services.sim import SimParameters
from services.sim.desk import Desk
from services.sim.joints.desk import JointDesk
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Placement
from services.sim.properties import Properties
from services.sim.stage import Stage
from services.sim.timing import Real

M = TypeVar("M", bound=Message)
R = TypeVar("R", bound=Message)
SCENE = Scene(boxes=(Box(name="crate", size=(0.4, 0.4, 0.4), position=(9.0, 0.0, 0.2)),))


class Scenery:
    """A stage, what is sent to it and asked of it."""

    def __init__(self, stage: Stage, bus: MemoryBus, node: Node, log: io.StringIO) -> None:
        self.stage, self.bus, self.node, self._log = stage, bus, node, log
        self._transport = MemoryTransport(bus)
        self._outputs: dict[tuple[str, str], Output[Any]] = {}

    @property
    def log(self) -> str:
        return self._log.getvalue()

    def send(self, topic: Topic[Any], message: Message, robot: str = "arm", sender: str = "/controller") -> Output[Any]:
        """Publish as a node; in the namespace of a robot, or, without one, of nobody."""
        key = f"{robot}/{topic.name}".strip("/")
        if (key, sender) not in self._outputs:
            self._outputs[key, sender] = Output(topic, f"/{key}", key, sender, self._transport)
        self._outputs[key, sender].publish(message)
        return self._outputs[key, sender]

    def push(self, effort: float, duration: float = 0.1, joint: str = "bear_link", **more: Any) -> None:
        """A job on the topic of the arm."""
        self.send(JOINT_EFFORT, JointEffort(joint_name=joint, effort=effort, duration=duration), **more)

    def run(self, seconds: float, factor: float = 0.0) -> None:
        """Let time go on. With the factor 0, the time that the test takes makes no command older."""
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.stage.tell()
            if self.stage.tick % self.stage.pace == 0:
                self.stage.listen(None, factor)
            self.stage.advance()

    def ask(self, request: Request[Any, R], message: Message) -> R:
        """Ask the simulation as another process would; raises CallFailed."""
        with ThreadPoolExecutor(1) as pool:
            asked = pool.submit(call, MemoryTransport(self.bus), request, request.name.lstrip("/"), message, 20.0)
            while not asked.done():
                self.node.turn()
            return asked.result()

    def joint(self, model: str = "arm") -> JointProperties:
        """What the joint of an arm is and does."""
        return self.ask(JOINT_PROPERTIES, JointName(model=model, joint_name="bear_link"))

    def hear(self, topic: Topic[M], name: str) -> Input[M]:
        """An input of the test's own."""
        return Input(topic, name, name.lstrip("/"), self._transport)

    def commands(self, robot: str = "arm") -> Input[Any]:
        """What the simulation reads of a robot's efforts."""
        return next(each for each in self.node.inputs if each.name == f"/{robot}/joint_effort")


@contextmanager
def scene(*robots: dict[str, Any]) -> Iterator[Scenery]:
    """A stage with these robots, an arm of the name ``arm`` when none is stated."""
    bus, log, identity = MemoryBus(), io.StringIO(), Identity.of("sim", "/")
    params = build(SimParameters, {"robots": [*robots] or [{"name": "arm", "model": "arm"}]})
    with (
        BulletWorld(SCENE, STEP_NS) as world,
        Node(MemoryTransport(bus), identity, "sim", Log(identity.node, out=log)) as node,
    ):
        stage = Stage(node, world, 0)
        timing = Real(stage, node, 1000)
        Desk(stage, timing, node)
        JointDesk(stage, node)
        Properties(stage, timing, node, params, SCENE)
        for entry in params.robots:
            stage.spawn(entry, Placement((entry.x, entry.y, 0.0)))
        yield Scenery(stage, bus, node, log)


def entry(name: str, model: str = "arm", **more: Any) -> dict[str, Any]:
    """A robot as parameters state it."""
    return {"name": name, "model": model, **more}
