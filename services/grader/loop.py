"""The loop of the grader: reads the messages of all robots, and writes the results at the end of the run."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.names import absolute_namespace, join
from messages.parameters import ParameterValues
from messages.se3 import Pose3
from messages.std import SECOND
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
    UPDATES,
    WORLD_MARKERS,
    WORLD_STATES,
)
from messages.visualization import MarkerArray
from services.driving.world_bodies import World, world_bodies
from services.grader import ArmSpec, BrakingSpec, GraderParameters
from services.grader.measurement import Measurement, MessageKind
from services.grader.records import EndReason
from services.grader.results import prepare_folder, world_arrays, write_results
from services.runtime.context import Context
from services.runtime.errors import BadInput

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
    watched = [
        ArmStreams(ctx, name, space, arms[name]) if name in arms else RobotStreams(ctx, name, space)
        for name, space in namespaces.items()
    ]
    health, lockstep, markers = ctx.stream(HEALTH), ctx.latest(LOCKSTEP), ctx.latest(WORLD_MARKERS)
    states = ctx.stream(WORLD_STATES)
    halting = {each.name.strip("/"): each for each in p.halting}
    sizes = {each.name.strip("/"): each for each in p.sizes}
    world: World = ()
    shown: MarkerArray | None = None
    graded = Measurement(robots, p.reach_tolerance, halting, arms, p.readers, namespaces, sizes)
    ended: EndReason = "stopped"
    try:
        for tick in ctx.ticks():
            if tick.reset:
                graded = Measurement(robots, p.reach_tolerance, halting, arms, p.readers, namespaces, sizes)
            if markers.value is not None and (markers.value is not shown or not graded.clearance.world_known):
                if markers.value is not shown:
                    shown, world = markers.value, read_world(ctx, markers.value)
                graded.clearance.set_world(world)
            for robot in watched:
                robot.forward(graded, tick.time, halting)
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
        self._robot, self._arm = robot, arm
        self._joints = ctx.stream(JOINT_STATES.of(namespace))
        self._control = ctx.stream(CONTROL_STATE.named(arm.state))
        self._parameter_updates = ctx.stream(UPDATES.of(arm.state.rpartition("/")[0]))

    def forward(self, graded: Measurement, now: int, _: dict[str, BrakingSpec]) -> None:
        """Forward the messages received by ``now`` [ns]."""
        for values in self._parameter_updates.drain():
            saturation = {each.name: each.value for each in values.values}.get("saturation")
            if isinstance(saturation, float | int) and not isinstance(saturation, bool):
                self._arm = msgspec.structs.replace(self._arm, saturation=float(saturation))
                graded.set_arm(now, self._robot, self._arm)
        graded.add_messages(MessageKind.JOINTS, self._robot, self._joints.drain())
        graded.add_messages(MessageKind.CONTROL, self._robot, self._control.drain())


def read_world(ctx: Context[GraderParameters], array: MarkerArray) -> World:
    """The bodies among the markers with their footprints; those whose shape cannot be read are warned of."""
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
