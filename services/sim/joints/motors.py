"""Motors of joints commanded by a controller manager: they keep positions or velocities, or apply efforts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from messages.joints import JointCommand, JointTarget
from models.urdf import Joint, JointLimits
from services.runtime.errors import BadInput, unknown_name
from services.runtime.log import Log
from services.runtime.step import STEP_S
from services.runtime.subscriber import Subscriber
from services.runtime.transport.wire import MEMBER_BYTES
from services.sim.joints.effort_controller import EffortRule, net_effort
from services.sim.physics.world import BodyHandle, JointReadings, MotorTarget
from services.sim.transit_delay import TransitDelayEstimator

POSITION_GAIN = 0.2
"""Share of a position error that a motor corrects in one physics step; 0.1 in gz_ros2_control."""
BRAKING_SHARE = 0.5
"""Share of the effort limit that a motor assumes for braking in time; gravity and other joints need the rest."""
UNLIMITED_EFFORT = 1e6
"""N m or N, for a joint whose URDF states no limit."""
MAX_LEAD_NS = 50_000_000
"""Time after its stamp for which a position target keeps moving at its rate without a new command."""
LOG_PERIOD_S = 5.0


@dataclass(frozen=True)
class _Driven:
    """A target received at ``stamp``, valid until ``until`` [ns]; a position that is merely held has no end."""

    target: JointTarget
    stamp: int
    until: float
    source: bytes = b""


class JointMotors:
    """Drives joints by ``JointCommand``, within the URDF's limits of position, velocity and effort.

    When its command is over, a joint is held where it is, or released if it was commanded by effort. Joints that mimic
    a commanded one follow it, as in the URDF, unless they are commanded themselves. While the robot is stopped, all
    joints that were commanded are held as by a brake, including those commanded by effort.
    """

    def __init__(
        self,
        body: BodyHandle,
        name: str,
        joints: Sequence[Joint],
        delays: TransitDelayEstimator,
        log: Log,
    ) -> None:
        self._body, self._name, self._delays, self._log = body, name, delays, log
        self._limits = {each.name: each.limits for each in joints}
        self._wheels = frozenset(body.motor_joints)
        movable = [each for each in joints if each.single_dof and each.name not in self._wheels]
        self._mimics = {each.name: each.mimic for each in movable if each.mimic is not None}
        self.joints = tuple(each.name for each in movable)
        """The joints that can be commanded."""
        self.commanded = False
        """Whether a controller manager has ever sent a command."""
        self._stopped = False
        self._driven: dict[str, _Driven] = {}
        self._efforts: dict[str, float] = {}
        self._known: dict[str, None] = {}
        """The joints commanded since the last reset without an emergency stop."""

    def reset(self) -> None:
        """Discard all targets after a reset of the world; an emergency stop holds its joints where they are now."""
        self._driven, self._efforts = {}, {}
        if self._stopped:
            self._hold(tuple(self._known))
        else:
            self._known = {}

    def apply_commands(
        self, topic: Subscriber[JointCommand], now: int, lockstep_members: set[bytes], factor: float
    ) -> None:
        """Apply the commands admitted at ``now`` [ns]; refused ones are counted in the topic's health.

        As with efforts, commands of publishers outside lockstep end earlier by their transit time. A command without
        targets only ends those of its publisher, whatever its age.
        """
        for command, origin in topic.messages:
            self.commanded = True
            if self._stopped:
                continue
            age, source = 0.0, b""
            if origin is not None:
                source = origin.publisher
                if source[:MEMBER_BYTES] not in lockstep_members:
                    age = self._delays.estimate(origin)
                    age = age * factor if age < inf else inf
            if command.targets and age > command.duration:
                topic.reject(f"a command of {command.duration:g} s that is {age:.3f} s old has expired")
                continue
            self._replace(command, now, now + (command.duration - age) * 1e9, source, topic)

    def stop(self, on: bool) -> None:
        """Hold all joints that were commanded, and ignore commands; or, with ``on`` false, accept them again."""
        if on and not self._stopped:
            self._hold(tuple(self._known))
        self._stopped = on

    def hold_again(self, joints: Iterable[str]) -> None:
        """Hold joints whose commands are over where they are now, after their positions were set."""
        self._hold([each for each in joints if each in self._driven and self._driven[each].until == inf])

    def publisher_lost(self, source: bytes) -> None:
        """After the loss of a publisher, hold or release its joints at once."""
        self._end([joint for joint, each in self._driven.items() if each.source == source and each.until < inf])

    def readings(self, measured: JointReadings) -> JointReadings:
        """Return the measured readings, with the efforts of the joints commanded here."""
        if not self._driven:
            return measured
        motors = dict(zip(self._body.joints, self._body.joint_readings().effort, strict=True))
        efforts = [
            self._efforts.get(joint, motors[joint]) if joint in self._driven else effort
            for joint, effort in zip(self._body.joints, measured.effort, strict=True)
        ]
        return measured._replace(effort=tuple(efforts))

    def step(self, now: int) -> None:
        """Set the motors for the physics step that begins at ``now`` [ns]."""
        if not self._driven:
            return
        self._end([joint for joint, each in self._driven.items() if now > each.until])
        if not self._driven:
            return
        position, velocity, _ = self._body.joint_readings()
        inertias = self._body.joint_inertias()
        indices = {joint: index for index, joint in enumerate(self._body.joints)}
        motors: dict[str, MotorTarget] = {}
        self._efforts = {}
        for joint, each in self._driven.items():
            limits, index = self._limits[joint], indices[joint]
            if each.target.interface == "effort":
                rate = velocity[index]
                self._efforts[joint] = net_effort(_TOTAL, limits, rate, (each.target.value,))
            else:
                motors[joint] = self._motor_target(joint, each, position[index], inertias[index], now)
        for joint, mimic in self._mimics.items():
            if mimic.joint in self._driven and joint not in self._driven:
                leader, index = indices[mimic.joint], indices[joint]
                goal = self._limits[joint].clamp(mimic.factor * position[leader] + mimic.offset)
                speed = mimic.factor * velocity[leader] + POSITION_GAIN * (goal - position[index]) / STEP_S
                motors[joint] = MotorTarget(speed, _strength(self._limits[joint]))
        if motors:
            self._body.drive_joints(motors)
        if self._efforts:
            self._body.set_efforts(self._efforts)

    def _motor_target(self, joint: str, driven: _Driven, position: float, inertia: float, now: int) -> MotorTarget:
        limits, target = self._limits[joint], driven.target
        fastest = limits.velocity or inf
        if target.interface == "velocity":
            velocity = target.value
            lower, upper = limits.lower, limits.upper
            if (upper is not None and position >= upper and velocity > 0) or (
                lower is not None and position <= lower and velocity < 0
            ):
                velocity = 0.0
        else:
            lead = max(0, min(now - driven.stamp, MAX_LEAD_NS)) / 1e9
            goal = limits.clamp(target.value + target.rate * lead)
            error = goal - position
            velocity = POSITION_GAIN * error / STEP_S
            if limits.effort is not None and inertia > 0:
                # At a higher speed, the limited effort could not stop it at the goal.
                most = sqrt(2 * BRAKING_SHARE * limits.effort / inertia * abs(error))
                velocity = max(-most, min(most, velocity))
            velocity += target.rate
        return MotorTarget(max(-fastest, min(fastest, velocity)), _strength(limits))

    def _replace(
        self, command: JointCommand, now: int, until: float, source: bytes, topic: Subscriber[JointCommand]
    ) -> None:
        """Set the targets of a command; other targets of the same publisher end."""
        stamp, named = command.header.stamp.ns, set()
        for target in command.targets:
            try:
                self._check(target)
            except BadInput as error:
                topic.reject(str(error))
                self._log.warn(f"{topic.name}: {error}", every=LOG_PERIOD_S)
                continue
            named.add(target.joint_name)
            before = self._driven.get(target.joint_name)
            if target.interface == "effort" and before is not None and before.target.interface != "effort":
                self._body.release_joints((target.joint_name,))
            self._known[target.joint_name] = None
            self._driven[target.joint_name] = _Driven(target, min(stamp, now), until, source)
        self._end(
            [j for j, each in self._driven.items() if each.source == source and each.until < inf and j not in named]
        )

    def _check(self, target: JointTarget) -> None:
        joint = target.joint_name
        if joint in self._wheels:
            raise BadInput(f"{self._name}::{joint} is driven by the robot's base: command cmd_vel instead")
        if joint not in self.joints:
            raise unknown_name("joint", joint, self.joints, self._name)

    def _end(self, joints: list[str]) -> None:
        """End the commands of these joints."""
        free = [joint for joint in joints if self._driven[joint].target.interface == "effort"]
        for joint in free:
            del self._driven[joint]
            self._efforts.pop(joint, None)
            followers = [each for each, mimic in self._mimics.items() if mimic.joint == joint]
            self._body.release_joints([each for each in followers if each not in self._driven])
        self._hold([joint for joint in joints if joint not in free])

    def _hold(self, joints: list[str] | tuple[str, ...]) -> None:
        if not joints:
            return
        positions = dict(zip(self._body.joints, self._body.joint_readings().position, strict=True))
        for joint in joints:
            self._efforts.pop(joint, None)
            self._driven[joint] = _Driven(JointTarget(joint_name=joint, value=positions[joint]), 0, inf)


_TOTAL = EffortRule()


def _strength(limits: JointLimits) -> float:
    """Return the maximum effort of a joint's motor, N m or N."""
    return UNLIMITED_EFFORT if limits.effort is None else limits.effort
