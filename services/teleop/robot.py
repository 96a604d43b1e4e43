"""The robot that teleop drives: found in the graph, commanded, and observed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped, Vector3
from messages.names import BadName, absolute_namespace
from messages.std import Header, Time
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, CMD_VEL_STAMPED, ODOM, TURTLE_POSE
from services.driving.command_repeater import CommandRepeater
from services.runtime.context import Context
from services.runtime.errors import BadInput, did_you_mean
from services.runtime.graph import Entity, snapshot
from services.runtime.heartbeat import State
from services.runtime.subscriber import Latest
from services.runtime.transport.wire import SampleInfo
from services.teleop import TeleopParameters
from services.teleop.keys import ZERO_VELOCITY, Velocity


class CommandPublisher:
    """Publishes the repeater's output as Twist or TwistStamped."""

    def __init__(self, ctx: Context[TeleopParameters]) -> None:
        self._ctx, p = ctx, ctx.params
        self.repeater = CommandRepeater(p.repeat_rate, p.give_way, ZERO_VELOCITY)
        plain = ctx.advertise(CMD_VEL)
        self.topic, self._type_name = plain.name, Twist.ROS_TYPE
        self._send: Callable[[Twist], None] = plain.publish
        if p.stamped:
            # Declared topics are advertised as plain Twist.
            ctx.node.unregister(plain)
            stamped, self._type_name = ctx.advertise(CMD_VEL_STAMPED), TwistStamped.ROS_TYPE

            def send(twist: Twist) -> None:
                header = Header(stamp=Time.of(ctx.now), frame_id=p.frame_id)
                stamped.publish(TwistStamped(header=header, twist=twist))

            self._send = send

    def wait_for_base(self) -> None:
        """Wait for a base that subscribes to the commands; raises BadInput if it expects another type."""
        ctx = self._ctx
        ctx.node.heartbeat.state, ctx.node.heartbeat.detail = "waiting", f"no subscriber to {self.topic}"
        while True:
            found = {each.topic: each for each in find_bases(snapshot(ctx.node.transport)).values()}
            if self.topic in found:
                break
            listed = ", ".join(found) or "none"
            ctx.log.warn(f"no base subscribes to {self.topic}, waiting for one (known: {listed})", every=5.0)
            ctx.idle()
        ctx.node.heartbeat.detail = ""
        expected = found[self.topic].type_name
        if expected != self._type_name:
            stamped = str(not ctx.params.stamped).lower()
            raise BadInput(f"{self.topic} takes {expected}, not {self._type_name}: set stamped={stamped}")

    def update(self, motion: Velocity | None, wall: float, sim: float, key_event: bool, stop: bool) -> None:
        """Publish the command that is due, if any; see ``CommandRepeater.update``."""
        self._publish(self.repeater.update(motion, wall, sim, key_event, stop))

    def close(self) -> None:
        """Publish a final zero, unless others drive the robot by now."""
        if self.repeater.state != "silent":
            self._publish(ZERO_VELOCITY)

    def _publish(self, motion: Velocity | None) -> None:
        if motion is not None:
            linear = Vector3(x=motion.x, y=motion.y, z=motion.z)
            self._send(Twist(linear=linear, angular=Vector3(z=motion.yaw)))


SILENCE_TIMEOUT_S = 1.0
"""Wall time [s] without messages after which a publisher counts as gone; a clock publishes at 50 Hz, a base at 5."""


class RobotMonitor:
    """Clock, odometry and base status of one robot as of the last update. Wall times are in s."""

    def __init__(self, ctx: Context[Any], wall: float) -> None:
        self._ctx = ctx
        own = {each.name: each.record for each in snapshot(ctx.node.transport) if each.kind == "pub"}
        pose = ctx.node.identity.resolve(TURTLE_POSE.name)
        self._pose = ctx.latest(TURTLE_POSE) if own.get(pose) == TURTLE_POSE.record.ROS_TYPE else None
        self._clock, self._status, self._odom = ctx.latest(CLOCK), ctx.latest(BASE_STATUS), ctx.latest(ODOM)
        self._origins: list[SampleInfo | None] = [None, None, None]
        self._last_received = [wall, wall, wall]
        self._wall = wall
        self._epoch = -1

    def update(self, wall: float) -> bool:
        """Read the newest messages and set the context's time; return whether simulation time was reset."""
        self._wall = wall
        self._ctx.node.update_subscribers()
        views: tuple[Latest[Any], ...] = self._clock, self._status, self._odom
        if self._pose is not None:
            self._pose.refresh()
        for index, view in enumerate(views):
            view.refresh()
            if view.info != self._origins[index]:
                self._origins[index], self._last_received[index] = view.info, wall
        clock = self._clock.value
        if clock is None:
            return False
        restarted = clock.epoch != self._epoch or clock.clock.ns < self._ctx.now
        self._epoch, self._ctx.now = clock.epoch, clock.clock.ns
        return restarted

    @property
    def sim_seconds(self) -> float:
        """Simulation time [s]."""
        return self._ctx.now / 1e9

    @property
    def state(self) -> State:
        """State for the heartbeat."""
        if self._is_silent(0):
            return "waiting"
        return "paused" if self._clock.value is not None and self._clock.value.paused else "running"

    @property
    def error(self) -> str:
        """Short description of a problem with the clock; empty if there is none."""
        if self._is_silent(0):
            return f"no clock for {self._wall - self._last_received[0]:.0f} s: is the simulation running?"
        if self._clock.value is None:
            return "waiting for the clock"
        return "the simulation is paused" if self._clock.value.paused else ""

    @property
    def base_status(self) -> BaseStatus | None:
        """Status of the base; None if it has stopped publishing while time continues."""
        return None if self._is_silent(1) and self.state == "running" else self._status.value

    @property
    def turtle(self) -> bool:
        """Whether this is a turtle of turtlesim, which has only a pose."""
        return self._pose is not None

    @property
    def odometry_twist(self) -> Twist | None:
        """Velocity by odometry, or of a turtle; None if there is none while time continues."""
        if self._pose is not None and self._pose.value is not None:
            return Twist.planar(self._pose.value.linear_velocity, self._pose.value.angular_velocity)
        if self._odom.value is None or (self._is_silent(2) and self.state == "running"):
            return None
        return self._odom.value.twist.twist

    def _is_silent(self, index: int) -> bool:
        return self._wall - self._last_received[index] > SILENCE_TIMEOUT_S


_SUFFIX, _STATUS_SUFFIX = f"/{CMD_VEL.name}", f"/{BASE_STATUS.name}"


class BaseInfo(NamedTuple):
    """Namespace of a base, and topic and ROS type of its commands."""

    namespace: str
    topic: str
    type_name: str


def find_bases(entities: Iterable[Entity]) -> dict[str, BaseInfo]:
    """Return the bases by namespace: nodes that subscribe to ``cmd_vel`` and publish there, unlike observers.

    A controller's name is a second namespace of its base, below the one in which the base publishes its status.
    """
    known = tuple(entities)
    status_publishers = {
        (each.node, each.name.removesuffix(_STATUS_SUFFIX))
        for each in known
        if each.kind == "pub" and each.name.endswith(_STATUS_SUFFIX)
    }
    found = {}
    for each in known:
        if each.kind != "sub" or not each.name.endswith(_SUFFIX):
            continue
        above = each.name.removesuffix(_SUFFIX)
        if any(e.kind == "pub" and e.node == each.node and e.name.rpartition("/")[0] == above for e in known):
            around = [
                name for node, name in status_publishers if node == each.node and f"{above}/".startswith(f"{name}/")
            ]
            base = max(around, key=len, default=above)
            found[above or "/"] = BaseInfo(base or "/", f"{base}{_SUFFIX}", each.record)
    return dict(sorted(found.items()))


def choose_base(asked: str, found: Mapping[str, BaseInfo], where: str) -> BaseInfo:
    """Return the base to drive; raises BadInput if there is none or the choice is ambiguous.

    Args:
        asked: Namespace of the base; the only base if empty.
        found: The bases by namespace.
        where: Name of the network, for errors.
    """
    if not found:
        raise BadInput(f"no robot takes commands at {where}: is a fleet with a robot running? (./elea ps lists fleets)")
    bases = dict.fromkeys(each.namespace for each in found.values())
    listed = ", ".join(bases)
    if not asked:
        if len(bases) > 1:
            raise BadInput(f"there are several robots: choose one of {listed}")
        return next(iter(found.values()))
    try:
        namespace = absolute_namespace(asked.rstrip("/"))
    except BadName as error:
        raise BadInput(str(error)) from None
    if namespace not in found:
        hint = did_you_mean(namespace, found)
        raise BadInput(f"no robot takes commands on {namespace.rstrip('/')}{_SUFFIX}{hint} (known: {listed})")
    return found[namespace]
