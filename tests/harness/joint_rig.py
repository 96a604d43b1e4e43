"""An arm of two links in PyBullet, its motors, and the topic that commands them, in one process on simulated time."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.joints import JointCommand, JointInterface, JointTarget
from messages.std import Header, Time
from messages.topics import JOINT_COMMAND
from models.urdf import parse_urdf
from models.world import WorldDescription
from services.runtime.log import Log
from services.runtime.publisher import Publisher
from services.runtime.step import STEP_NS
from services.runtime.subscriber import Subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.sim.engines import default_engine, open_world
from services.sim.joints.motors import JointMotors
from services.sim.physics.world import Body, Motor, World
from services.sim.transit_delay import TransitDelayEstimator

URDF = Path(__file__).with_name("two_links.urdf")
JOINTS = parse_urdf(URDF.read_text()).joints


class JointRig:
    """The arm ``arm`` with its base held; ``now`` is simulation time in ns."""

    def __init__(self, world: World, motors: tuple[Motor, ...] = ()) -> None:
        self.world, self.now = world, 0
        self.body = world.spawn(Body("arm", URDF, motors=motors, fixed=True))
        self.log = io.StringIO()
        self.motors = JointMotors(self.body, "arm", JOINTS, TransitDelayEstimator(), Log("/sim", out=self.log))
        transport = MemoryTransport(MemoryBus())
        self.topic = Subscriber(JOINT_COMMAND, "/arm/joint_command", "arm/joint_command", transport)
        self.publisher = Publisher(JOINT_COMMAND, "/arm/joint_command", "arm/joint_command", "/manager", transport)

    def command(self, interface: JointInterface, duration: float = 0.1, rate: float = 0.0, **values: float) -> None:
        """Send one command for joints, and let the simulation take it."""
        targets = tuple(
            JointTarget(joint_name=joint, interface=interface, value=value, rate=rate)
            for joint, value in values.items()
        )
        self.send(JointCommand(header=Header(stamp=Time.of(self.now)), duration=duration, targets=targets))

    def send(self, command: JointCommand) -> None:
        """Publish a command and apply it at once."""
        self.publisher.publish(command)
        self.topic.update()
        self.motors.apply_commands(self.topic, self.now, set(), 0.0)

    def step(self, seconds: float = 0.0) -> None:
        """Let time go on, by one physics step at least."""
        for _ in range(max(1, round(seconds * 1e9 / STEP_NS))):
            self.motors.step(self.now)
            self.world.step()
            self.now += STEP_NS

    def position(self, joint: str) -> float:
        """Where a joint is, rad or m."""
        return dict(zip(self.body.joints, self.body.joint_readings().position, strict=True))[joint]

    def velocity(self, joint: str) -> float:
        """How fast a joint moves, rad/s or m/s."""
        return dict(zip(self.body.joints, self.body.joint_readings().velocity, strict=True))[joint]


@contextmanager
def joint_rig(*motors: Motor) -> Iterator[JointRig]:
    """The arm in a world of its own; ``motors`` are those of a base."""
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        yield JointRig(world, motors)
