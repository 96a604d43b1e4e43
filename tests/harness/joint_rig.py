"""A two-link arm in the physics engine, its motors and their command topic, in one process on simulated time."""

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
    """The robot ``arm`` with a fixed base; ``now`` is simulation time [ns]."""

    def __init__(self, world: World, motors: tuple[Motor, ...] = ()) -> None:
        self.world, self.now = world, 0
        self.body = world.spawn(Body("arm", URDF, motors=motors, fixed=True))
        self.log = io.StringIO()
        self.motors = JointMotors(self.body, "arm", JOINTS, TransitDelayEstimator(), Log("/sim", out=self.log))
        transport = MemoryTransport(MemoryBus())
        self.topic = Subscriber(JOINT_COMMAND, "/arm/joint_command", "arm/joint_command", transport)
        self.publisher = Publisher(JOINT_COMMAND, "/arm/joint_command", "arm/joint_command", "/manager", transport)

    def command(self, interface: JointInterface, duration: float = 0.1, rate: float = 0.0, **values: float) -> None:
        """Publish one command for joints and apply it at once."""
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
        """Advance the simulation by ``seconds``, at least one physics step."""
        for _ in range(max(1, round(seconds * 1e9 / STEP_NS))):
            self.motors.step(self.now)
            self.world.step()
            self.now += STEP_NS

    def position(self, joint: str) -> float:
        """Return a joint's position [rad or m]."""
        return dict(zip(self.body.joints, self.body.joint_readings().position, strict=True))[joint]

    def velocity(self, joint: str) -> float:
        """Return a joint's velocity [rad/s or m/s]."""
        return dict(zip(self.body.joints, self.body.joint_readings().velocity, strict=True))[joint]


@contextmanager
def joint_rig(*motors: Motor) -> Iterator[JointRig]:
    """Yield the arm in a world of its own; ``motors`` are those of a mobile base."""
    with open_world(default_engine(), WorldDescription(), STEP_NS) as world:
        yield JointRig(world, motors)
