"""The loop of the grader: reads the messages of all robots, and writes the results at the end of the run."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import msgspec

from messages.control import JointControllerState
from messages.names import absolute_namespace, join
from messages.parameters import ParameterValues
from messages.se3 import Pose3
from messages.sensor import JointState
from messages.std import SECOND, Float32, Float64
from messages.topics import (
    BASE_STATUS,
    CONTROL_STATE,
    GROUND_TRUTH,
    HEALTH,
    JOINT_STATES,
    LOCKSTEP,
    ODOM,
    PLAN,
    STATUS,
    TURTLE_STATES,
    UPDATES,
    WORLD_MARKERS,
    WORLD_STATES,
    Quality,
    Topic,
)
from messages.visualization import MarkerArray
from services.grader import ArmSpec, BrakingSpec, GraderParameters
from services.grader.measurement import Measurement, MessageKind
from services.grader.records import EndReason
from services.grader.results import prepare_folder, world_arrays, write_results
from services.markers.world_bodies import World, world_bodies
from services.runtime.context import Context
from services.runtime.errors import BadInput

REFERENCE_RATE = 100.0
"""Rate [Hz] at which set-points without stamps are sampled and measured."""
GRADING_DELAY_NS = SECOND // 5
"""Delay [ns] with which messages are processed, so that all with earlier stamps have arrived."""


def run(ctx: Context[GraderParameters]) -> None:
    """Measure until the run ends or the process is stopped, then write the results."""
    p = ctx.params
    folder = prepare_folder(Path(p.output))
    robots = [name.strip("/") for name in p.robots]
    arms = {each.name.strip("/"): each for each in p.arms}
    if len(p.namespaces) not in (0, len(robots)):
        raise BadInput(f"grader: {len(p.namespaces)} namespaces for {len(robots)} robots: give one for each, or none")
    namespaces = dict(zip(robots, map(absolute_namespace, p.namespaces or robots), strict=True))
    watched = [_streams(ctx, name, space, arms.get(name)) for name, space in namespaces.items()]
    rate = REFERENCE_RATE if any(each.reference for each in arms.values()) else None
    health, lockstep, markers = ctx.stream(HEALTH), ctx.latest(LOCKSTEP), ctx.latest(WORLD_MARKERS)
    states = ctx.stream(WORLD_STATES)
    turtles = [ctx.stream(TURTLE_STATES.of(each)) for each in p.turtlesims]
    halting = {each.name.strip("/"): each for each in p.halting}
    sizes = {each.name.strip("/"): each for each in p.sizes}
    world: World = ()
    shown: MarkerArray | None = None
    graded = Measurement(robots, p.reach_tolerance, halting, arms, p.readers, namespaces, sizes)
    ended: EndReason = "stopped"
    try:
        for tick in ctx.ticks(rate):
            if tick.reset:
                arms |= {each.robot: each.arm for each in watched if isinstance(each, ArmStreams)}
                graded = Measurement(robots, p.reach_tolerance, halting, arms, p.readers, namespaces, sizes)
            if markers.value is not None and (markers.value is not shown or not graded.clearance.world_known):
                if markers.value is not shown:
                    shown, world = markers.value, read_world(ctx, markers.value)
                graded.clearance.set_world(world)
            for robot in watched:
                robot.forward(graded, tick.time, halting)
            for each in turtles:
                graded.add_turtles(each.drain())
            for state in states.drain():
                poses = dict(zip(state.name, map(Pose3.from_msg, state.pose), strict=False))
                graded.clearance.add_states(state.header.stamp.ns, poses)
            graded.add_heartbeats(health.drain())
            p = ctx.params
            last = round(p.duration * SECOND)
            end = min(tick.time - GRADING_DELAY_NS, last) if last else tick.time - GRADING_DELAY_NS
            graded.advance(end)
            if p.ends == "goals" and graded.finished and end >= p.not_before * SECOND:
                ended = "goals"
                break
            if p.ends != "never" and last and end >= last:
                ended = "duration"
                break
    finally:
        measured = graded.measurements(ended, lockstep.value)
        write_results(folder, measured, graded.robots, world_arrays(world, graded.clearance.paths))
        ctx.log.info(f"run ended ({ended}), figures in {folder}")


def _streams(ctx: Context[GraderParameters], name: str, namespace: str, arm: ArmSpec | None) -> Streams:
    if arm is None:
        return RobotStreams(ctx, name, namespace)
    return (ReferredArmStreams if arm.reference else ArmStreams)(ctx, name, namespace, arm)


class Streams(Protocol):
    """The subscriptions of one robot or arm."""

    def forward(self, graded: Measurement, now: int, halting: dict[str, BrakingSpec]) -> None:
        """Forward the messages received by ``now`` [ns]; ``halting`` is kept up to date with the base's parameters."""
        ...


class RobotStreams:
    """The subscriptions of one robot."""

    def __init__(self, ctx: Context[GraderParameters], robot: str, namespace: str) -> None:
        self._robot = robot
        self._plan = ctx.stream(PLAN.of(namespace))
        self._status = ctx.stream(STATUS.of(namespace))
        self._odometry = ctx.stream(ODOM.of(namespace))
        self._truth = ctx.stream(GROUND_TRUTH.of(namespace))
        self._base = ctx.stream(BASE_STATUS.of(namespace))
        self._parameter_updates = ctx.stream(UPDATES.of(join(namespace, "base")))

    def forward(self, graded: Measurement, now: int, halting: dict[str, BrakingSpec]) -> None:
        """Forward the messages received by ``now`` [ns]; ``halting`` is kept up to date with the base's parameters."""
        for values in self._parameter_updates.drain():
            if (known := braking_from_parameters(self._robot, values)) is not None:
                halting[self._robot] = known
                graded.set_braking(now, self._robot, known)
        graded.add_messages(MessageKind.PLAN, self._robot, self._plan.drain())
        graded.add_messages(MessageKind.STATUS, self._robot, self._status.drain())
        graded.add_messages(MessageKind.ODOMETRY, self._robot, self._odometry.drain())
        graded.add_messages(MessageKind.TRUTH, self._robot, self._truth.drain())
        graded.add_messages(MessageKind.BASE, self._robot, self._base.drain())


class ArmStreams:
    """The subscriptions of one arm, with its controller's largest effort from the parameter set next to its state."""

    def __init__(self, ctx: Context[GraderParameters], robot: str, namespace: str, arm: ArmSpec) -> None:
        self.robot, self.arm = robot, arm
        self._joints = ctx.stream(JOINT_STATES.of(namespace))
        self._control = ctx.stream(CONTROL_STATE.named(arm.state))
        self._parameter_updates = ctx.stream(UPDATES.of(arm.state.rpartition("/")[0]))

    def forward(self, graded: Measurement, now: int, _: dict[str, BrakingSpec]) -> None:
        """Forward the messages received by ``now`` [ns]."""
        for values in self._parameter_updates.drain():
            saturation = {each.name: each.value for each in values.values}.get("saturation")
            if isinstance(saturation, float | int) and not isinstance(saturation, bool):
                self.arm = msgspec.structs.replace(self.arm, saturation=float(saturation))
                graded.set_arm(now, self.robot, self.arm)
        graded.add_messages(MessageKind.JOINTS, self.robot, self._joints.drain())
        graded.add_messages(MessageKind.CONTROL, self.robot, self._control.drain())


class ReferredArmStreams:
    """The subscriptions of an arm that a program controls: its set-point has no stamp, so each joint state is paired
    with the last set-point received."""

    def __init__(self, ctx: Context[GraderParameters], robot: str, namespace: str, arm: ArmSpec) -> None:
        self._robot, self._joint = robot, arm.joint
        self._joints = ctx.stream(JOINT_STATES.of(namespace))
        record = Float32 if arm.reference_type == Float32.ROS_TYPE else Float64
        topic: Topic[Any] = Topic(arm.reference, record, 0, Quality.EVENT, "set-point of an arm")
        self._reference = ctx.stream(topic)
        self._to_degrees: Callable[[float], float] = math.degrees if arm.reference_unit == "rad" else float
        self._set_point: float | None = None

    def forward(self, graded: Measurement, now: int, _: dict[str, BrakingSpec]) -> None:
        """Forward the messages received by ``now`` [ns]."""
        for each in self._reference.drain():
            self._set_point = self._to_degrees(each.data)
        joints = self._joints.drain()
        graded.add_messages(MessageKind.JOINTS, self._robot, joints)
        if self._set_point is not None:
            states = [self._control_state(each, self._set_point) for each in joints if self._joint in each.name]
            graded.add_messages(MessageKind.CONTROL, self._robot, states)

    def _control_state(self, joints: JointState, set_point: float) -> JointControllerState:
        index = joints.name.index(self._joint)
        effort = joints.effort[index] if index < len(joints.effort) else 0.0
        return JointControllerState(header=joints.header, set_point=set_point, command=effort)


def read_world(ctx: Context[GraderParameters], array: MarkerArray) -> World:
    """Return the bodies among the markers with their footprints; bodies with unreadable shapes are logged."""
    found = []
    for body in world_bodies(array):
        try:
            found.append((body, body.footprints()))
        except BadInput as error:
            ctx.log.warn(f"the clearance from {body.name} is not measured: {error}")
    return tuple(found)


def braking_from_parameters(robot: str, values: ParameterValues) -> BrakingSpec | None:
    """Return how a base with these parameters brakes; None if unknown."""
    by_name = {each.name: each.value for each in values.values}
    try:
        stated = {"name": robot, "timeout": by_name.get("cmd_vel_timeout"), "brake": by_name.get("brake")}
        return msgspec.convert(stated, BrakingSpec)
    except msgspec.ValidationError:
        return None
