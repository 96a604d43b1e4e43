"""The requests that act on joints and links: efforts, positions and wrenches, as Gazebo's services of these names."""

from __future__ import annotations

from collections.abc import Sequence

from messages.gazebo import ApplyEffort, ApplyWrench, JointName, LinkName, SetConfiguration
from messages.geometry import Point, Vector3
from messages.joints import JointEffort, JointProperties
from messages.requests import (
    APPLY_EFFORT,
    APPLY_WRENCH,
    CLEAR_EFFORT,
    CLEAR_WRENCH,
    JOINT_PROPERTIES,
    SET_CONFIGURATION,
    Done,
)
from messages.sensor import JointState
from messages.std import Header, Time
from models.limits import read_limits
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.service import STEP_NS
from services.sim.entities import Part, frame_state, joint_named, link_named
from services.sim.joints.actuators import Actuators
from services.sim.joints.jobs import schedule
from services.sim.joints.terms import positions
from services.sim.joints.wrenches import Push
from services.sim.physics.world import Resistance, Vector
from services.sim.sensors.readings import joint_state
from services.sim.stage import Stage

MOST_FORCE = 1e5
"""N and N m in each axis; more throws a robot out of the numbers that hold it."""


class JointDesk:
    """Answers requests between two steps."""

    def __init__(self, stage: Stage, node: Node) -> None:
        self._stage, self._world = stage, stage.world
        node.serve(APPLY_EFFORT, self._apply_effort)
        node.serve(CLEAR_EFFORT, self._clear_effort)
        node.serve(JOINT_PROPERTIES, self._properties)
        node.serve(SET_CONFIGURATION, self._configure)
        node.serve(APPLY_WRENCH, self._apply_wrench)
        node.serve(CLEAR_WRENCH, self._clear_wrench)

    def _apply_effort(self, asked: ApplyEffort) -> Done:
        job = asked.job
        joint = joint_named(self._world, asked.model, job.joint_name)
        own = JointEffort(joint_name=joint.name, effort=job.effort, start_time=job.start_time, duration=job.duration)
        note = self._actuators(joint).apply(own, self._stage.now)
        return Done(text=f"{job.effort:g} on {joint} {self._when(job.start_time.ns, job.duration, note)}")

    def _clear_effort(self, asked: JointName) -> Done:
        joint = joint_named(self._world, asked.model, asked.joint_name)
        return Done(text=f"{_jobs(self._actuators(joint).clear(joint.name))} of {joint} dropped")

    def _properties(self, asked: JointName) -> JointProperties:
        joint = joint_named(self._world, asked.model, asked.joint_name)
        robot = self._stage.find(joint.body)
        limits = read_limits(robot.entry.model)[joint.name]
        readings, place = self._world.joint_readings(joint.body), self._world.joints(joint.body).index(joint.name)
        applied, jobs = readings.effort[place], 0
        damping, friction = robot.resistance.get(joint.name, Resistance(limits.damping, limits.friction))
        if robot.actuators is not None:
            applied, jobs = robot.actuators.applied[joint.name], len(robot.actuators.jobs(joint.name))
        return JointProperties(
            model=joint.body,
            joint_name=joint.name,
            type=limits.kind,
            damping=damping,
            friction=friction,
            lower=limits.lower,
            upper=limits.upper,
            effort_limit=limits.effort,
            velocity_limit=limits.velocity,
            position=readings.position[place],
            rate=readings.velocity[place],
            applied_effort=applied,
            jobs=jobs,
        )

    def _configure(self, asked: SetConfiguration) -> JointState:
        robot = self._stage.find(asked.model)
        wanted = by_name(asked.joint_names, asked.joint_positions)
        wanted = {joint_named(self._world, robot.name, joint).name: position for joint, position in wanted.items()}
        if robot.base is not None:
            raise BadInput(f"the joints of {robot.name} are its wheels, which odometry counts: use set_state")
        positions(robot.entry.model, wanted)
        self._world.set_joints(robot.name, wanted)
        readings = self._world.joint_readings(robot.name)
        return joint_state(self._world.joints(robot.name), readings, Header(stamp=Time.of(self._stage.now)))

    def _apply_wrench(self, asked: ApplyWrench) -> Done:
        link = link_named(self._world, asked.body_name)
        frame_state(self._world, asked.reference_frame)
        force, torque, point = (
            _numbers(each) for each in (asked.wrench.force, asked.wrench.torque, asked.reference_point)
        )
        if any(abs(each) > MOST_FORCE for each in (*force, *torque)):
            raise BadInput(f"force {force} N, torque {torque} N m: {MOST_FORCE:g} in each axis is the most")
        push = Push(force, torque, point, asked.reference_frame)
        job, note = schedule(push, asked.start_time.ns, asked.duration, self._stage.now, STEP_NS)
        self._stage.wrenches.add(link, job)
        when = self._when(asked.start_time.ns, asked.duration, note)
        held = self._stage.find(link.body).model.fixed_base and link.name == self._world.links(link.body)[0]
        return Done(text=f"wrench on {link} {when}" + ("; it is held in the world and will not move" if held else ""))

    def _clear_wrench(self, asked: LinkName) -> Done:
        link = link_named(self._world, asked.link_name)
        return Done(text=f"{_jobs(self._stage.wrenches.clear(link))} of {link} dropped")

    def _actuators(self, joint: Part) -> Actuators:
        robot = self._stage.find(joint.body)
        if robot.actuators is None:
            raise BadInput(f"{joint} is a wheel, which its base drives: command {robot.namespace}/cmd_vel instead")
        return robot.actuators

    def _when(self, start: int, duration: float, note: str) -> str:
        begins = f"from {start / 1e9:g} s " if start > self._stage.now else "from now "
        return begins + (note or f"for {duration:g} s")


def by_name(names: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """Positions by the names of their joints; raises BadInput when the two do not fit."""
    if len(names) != len(values):
        raise BadInput(f"{len(names)} joint names and {len(values)} positions: each joint has one")
    if len(set(names)) < len(names):
        raise BadInput(f"a joint is named twice in {', '.join(names)}")
    return dict(zip(names, values, strict=True))


def _numbers(vector: Vector3 | Point) -> Vector:
    return vector.x, vector.y, vector.z


def _jobs(count: int) -> str:
    return "1 job" if count == 1 else f"{count} jobs"
