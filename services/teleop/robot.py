"""The robot that teleop drives: the commands sent to it, and its state and clock as received."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from messages.elea import BaseStatus
from messages.geometry import Twist, TwistStamped, Vector3
from messages.std import Header, Time
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, ODOM, Quality, Topic
from services.driving.command_repeater import CommandRepeater
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.graph import snapshot
from services.runtime.heartbeat import State
from services.runtime.subscriber import Latest
from services.runtime.transport.wire import SampleInfo
from services.teleop import TeleopParameters
from services.teleop.bases import find_bases
from services.teleop.keys import ZERO_VELOCITY, Velocity

STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, Quality.COMMAND, CMD_VEL.about)
"""``cmd_vel`` as newer ROS 2 bases take it."""


class CommandPublisher:
    """Sends what its voice says, as the record that the parameters ask for."""

    def __init__(self, ctx: Context[TeleopParameters]) -> None:
        self._ctx, p = ctx, ctx.params
        self.repeater = CommandRepeater(p.repeat_rate, p.give_way, ZERO_VELOCITY)
        plain = ctx.advertise(CMD_VEL)
        self.topic, self._type_name = plain.name, Twist.ROS_TYPE
        self._send: Callable[[Twist], None] = plain.publish
        if p.stamped:
            # The declaration has announced the plain one.
            ctx.node.unregister(plain)
            stamped, self._type_name = ctx.advertise(STAMPED), TwistStamped.ROS_TYPE

            def send(twist: Twist) -> None:
                header = Header(stamp=Time.of(ctx.now), frame_id=p.frame_id)
                stamped.publish(TwistStamped(header=header, twist=twist))

            self._send = send

    def wait_for_base(self) -> None:
        """Wait for a base that takes the commands; raises BadInput when it takes another type."""
        ctx = self._ctx
        ctx.node.heartbeat.state, ctx.node.heartbeat.detail = "waiting", f"no subscriber to {self.topic}"
        while True:
            found = {each.topic: each for each in find_bases(snapshot(ctx.node.transport)).values()}
            if self.topic in found:
                break
            listed = ", ".join(found) or "none"
            ctx.log.warn(f"no base takes {self.topic}, waiting for one (known: {listed})", every=5.0)
            ctx.idle()
        ctx.node.heartbeat.detail = ""
        taken = found[self.topic].type_name
        if taken != self._type_name:
            wanted = str(not ctx.params.stamped).lower()
            raise BadInput(f"{self.topic} takes {taken}, not {self._type_name}: set stamped={wanted}")

    def update(self, motion: Velocity | None, wall: float, sim: float, struck: bool, stop: bool) -> None:
        """Send what is due; see ``CommandRepeater.say``."""
        self._publish(self.repeater.update(motion, wall, sim, struck, stop))

    def close(self) -> None:
        """The last word is zero; a robot that others drive by now is left to them."""
        if self.repeater.state != "silent":
            self._publish(ZERO_VELOCITY)

    def _publish(self, motion: Velocity | None) -> None:
        if motion is not None:
            linear = Vector3(x=motion.x, y=motion.y, z=motion.z)
            self._send(Twist(linear=linear, angular=Vector3(z=motion.yaw)))


SILENCE_TIMEOUT_S = 1.0
"""Wall time after which what tells nothing is taken to be gone; a clock tells 50 times a second, a base 5 times."""


class RobotMonitor:
    """The clock, the odometry and the base of one robot, as the last look saw them. Wall times are s."""

    def __init__(self, ctx: Context[Any], wall: float) -> None:
        self._ctx = ctx
        self._clock, self._status, self._odom = ctx.latest(CLOCK), ctx.latest(BASE_STATUS), ctx.latest(ODOM)
        self._origins: list[SampleInfo | None] = [None, None, None]
        self._last_received = [wall, wall, wall]
        self._wall = wall
        self._epoch = -1

    def update(self, wall: float) -> bool:
        """Take what has come; True when simulation time has begun anew. The context's time follows."""
        self._wall = wall
        self._ctx.node.update_subscribers()
        views: tuple[Latest[Any], ...] = self._clock, self._status, self._odom
        for index, view in enumerate(views):
            view.refresh()
            if view.info != self._origins[index]:
                self._origins[index], self._last_received[index] = view.info, wall
        clock = self._clock.value
        if clock is None:
            return False
        anew = clock.epoch != self._epoch or clock.clock.ns < self._ctx.now
        self._epoch, self._ctx.now = clock.epoch, clock.clock.ns
        return anew

    @property
    def sim_seconds(self) -> float:
        """Simulation time, s."""
        return self._ctx.now / 1e9

    @property
    def state(self) -> State:
        """What the heartbeat says of time."""
        if self._is_silent(0):
            return "waiting"
        return "paused" if self._clock.value is not None and self._clock.value.paused else "running"

    @property
    def error(self) -> str:
        """What is wrong with time, in a few words; empty when nothing is."""
        if self._is_silent(0):
            return f"no clock for {self._wall - self._last_received[0]:.0f} s: is the simulation running?"
        if self._clock.value is None:
            return "waiting for the clock"
        return "the simulation is paused" if self._clock.value.paused else ""

    @property
    def base_status(self) -> BaseStatus | None:
        """What the base tells, None when it tells nothing although time goes on."""
        return None if self._is_silent(1) and self.state == "running" else self._status.value

    @property
    def odometry_twist(self) -> Twist | None:
        """The motion by odometry, None when there is none although time goes on."""
        if self._odom.value is None or (self._is_silent(2) and self.state == "running"):
            return None
        return self._odom.value.twist.twist

    def _is_silent(self, index: int) -> bool:
        return self._wall - self._last_received[index] > SILENCE_TIMEOUT_S
