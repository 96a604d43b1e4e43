"""The panel's hub on an in-memory network, with a robot played by the test and pages read by it."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from messages.elea import BaseStatus
from messages.geometry import Pose, PoseWithCovariance, Quaternion, Transform, TransformStamped, Vector3
from messages.names import Identity, join
from messages.nav import Odometry
from messages.rosgraph import Clock
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, E_STOP, GOAL_POSE, GROUND_TRUTH, ODOM, TF_STATIC
from services.panel import PanelParameters
from services.panel.hub import Hub
from services.panel.pages import Page, PageRegistry
from services.panel.protocol import ClientMessage
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.memory import MemoryBus, MemoryTransport

PERIOD_S = 0.02


def memory_node(bus: MemoryBus, name: str) -> Node:
    identity = Identity.of(name)
    return Node(MemoryTransport(bus), identity, name, Log(identity.node, out=io.StringIO()))


class FakeRobot:
    """A burger in a namespace, whose odometry started at (1, 2) [m], a quarter turn to the left."""

    def __init__(self, at: Node, namespace: str = "/a", frame: str = "a/odom") -> None:
        self.node, self.frame = at, frame
        self.commands, self.stops, self.all_stops = (
            at.subscribe(CMD_VEL, join(namespace, "cmd_vel")),
            at.subscribe(E_STOP, join(namespace, "e_stop")),
            at.subscribe(E_STOP, "/e_stop"),
        )
        self.goals = at.subscribe(GOAL_POSE, join(namespace, "goal_pose"))
        self.truth, self.odom = (
            at.advertise(GROUND_TRUTH, join(namespace, "ground_truth")),
            at.advertise(ODOM, join(namespace, "odom")),
        )
        self.status, self.clock = at.advertise(BASE_STATUS, join(namespace, "base_status")), at.advertise(CLOCK)
        origin = Transform(translation=Vector3(x=1, y=2), rotation=Quaternion.from_yaw(1.5707963267948966))
        header = Header(frame_id="world")
        frame = TransformStamped(header=header, child_frame_id=frame, transform=origin)
        at.advertise(TF_STATIC).publish(TFMessage(transforms=(frame,)))

    def publish(self, ns: int, x: float = 0.0, epoch: int = 0) -> None:
        """Publish the time and a pose ``x`` [m] ahead in the odometry frame."""
        self.clock.publish(Clock(clock=Time.of(ns), epoch=epoch))
        header = Header(stamp=Time.of(ns), frame_id=self.frame)
        pose = PoseWithCovariance(pose=Pose.planar(x, 0))
        self.odom.publish(Odometry(header=header, pose=pose))
        self.truth.publish(Odometry(header=Header(stamp=Time.of(ns), frame_id="world"), pose=pose))
        self.status.publish(BaseStatus(model="burger"))

    def received(self, name: str) -> list[Any]:
        """Return the new messages of one of its subscribers."""
        each = getattr(self, name)
        each.update()
        return [message for message, _ in each.messages]


class HubHarness:
    """The hub on a fake wall clock; each turn takes PERIOD_S."""

    def __init__(self, bus: MemoryBus, panel: Node, robot: FakeRobot) -> None:
        self.bus, self.robot = bus, robot
        self.params = PanelParameters(deadline=30.0)  # of wall time, which a busy machine lets pass
        self.registry = PageRegistry(lambda: None, 4)
        self.hub = Hub(panel, self.registry, self.params)
        self.wall = 0.0

    def page(self) -> Page:
        page = self.registry.open_page(lambda: None)
        assert page is not None
        return page

    def send(self, page: Page, said: ClientMessage) -> None:
        assert self.registry.submit(page, said)

    def spin(self, seconds: float = PERIOD_S, tell: bool = False) -> None:
        """Run turns for ``seconds``; with ``tell``, publish simulation time as well."""
        for _ in range(max(1, round(seconds / PERIOD_S))):
            self.wall += PERIOD_S
            if tell:
                self.robot.publish(round(self.wall * 1e9))
            self.hub.update(self.wall)

    def messages_to(self, page: Page, kind: str) -> list[dict[str, Any]]:
        """Return the messages of one kind sent to a page since the last call."""
        texts = [json.loads(each) for each in page.drain() if isinstance(each, str)]
        return [each for each in texts if each["k"] == kind]


@contextmanager
def hub_harness() -> Iterator[HubHarness]:
    """Yield the hub and a robot on one network."""
    bus = MemoryBus()
    with memory_node(bus, "panel") as panel, memory_node(bus, "sim") as sim:
        yield HubHarness(bus, panel, FakeRobot(sim))
