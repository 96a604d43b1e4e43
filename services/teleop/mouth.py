"""The publication of commands, and who takes them."""

from __future__ import annotations

from collections.abc import Callable

from messages.geometry import Twist, TwistStamped, Vector3
from messages.std import Header, Time
from messages.topics import CMD_VEL, Quality, Topic
from services.motion.voice import Voice
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.graph import snapshot
from services.teleop import TeleopParameters
from services.teleop.bases import bases
from services.teleop.hand import STILL, Motion

STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, Quality.COMMAND, CMD_VEL.about)
"""``cmd_vel`` as newer ROS 2 bases take it."""


class Mouth:
    """Sends what its voice says, as the record that the parameters ask for."""

    def __init__(self, ctx: Context[TeleopParameters]) -> None:
        self._ctx, p = ctx, ctx.params
        self.voice = Voice(p.repeat_rate, p.give_way, STILL)
        plain = ctx.writer(CMD_VEL)
        self.topic, self._record = plain.name, Twist.ROS_TYPE
        self._send: Callable[[Twist], None] = plain.publish
        if p.stamped:
            # The declaration has announced the plain one.
            ctx.kernel.forget(plain)
            stamped, self._record = ctx.writer(STAMPED), TwistStamped.ROS_TYPE

            def send(twist: Twist) -> None:
                header = Header(stamp=Time.of(ctx.now), frame_id=p.frame_id)
                stamped.publish(TwistStamped(header=header, twist=twist))

            self._send = send

    def await_base(self) -> None:
        """Wait for a base that takes the commands; raises BadInput when it takes another type."""
        ctx = self._ctx
        ctx.kernel.heart.state, ctx.kernel.heart.note = "waiting", f"nobody takes {self.topic}"
        while True:
            found = {each.topic: each for each in bases(snapshot(ctx.kernel.transport)).values()}
            if self.topic in found:
                break
            listed = ", ".join(found) or "none"
            ctx.log.warn(f"no base takes {self.topic}, waiting for one (known: {listed})", every=5.0)
            ctx.idle()
        ctx.kernel.heart.note = ""
        taken = found[self.topic].record
        if taken != self._record:
            wanted = str(not ctx.params.stamped).lower()
            raise BadInput(f"{self.topic} takes {taken}, not {self._record}: set stamped={wanted}")

    def say(self, motion: Motion | None, wall: float, sim: float, struck: bool, stop: bool) -> None:
        """Send what is due; see ``Voice.say``."""
        self._publish(self.voice.say(motion, wall, sim, struck, stop))

    def close(self) -> None:
        """The last word is zero; a robot that others drive by now is left to them."""
        if self.voice.state != "silent":
            self._publish(STILL)

    def _publish(self, motion: Motion | None) -> None:
        if motion is not None:
            linear = Vector3(x=motion.x, y=motion.y, z=motion.z)
            self._send(Twist(linear=linear, angular=Vector3(z=motion.yaw)))
