"""The simulation's services that do not move time: models, states and stops; joints and wrenches; properties."""

from __future__ import annotations

from collections.abc import Sequence

from messages.elea import EmergencyStops, ModelState
from messages.gazebo import (
    ApplyEffort,
    ApplyWrench,
    JointName,
    LinkName,
    LinkProperties,
    LinkState,
    ModelProperties,
    SetConfiguration,
    WorldProperties,
)
from messages.geometry import Point, Pose, Twist, Vector3
from messages.joints import JointEffort, JointProperties
from messages.requests import (
    APPLY_EFFORT,
    APPLY_WRENCH,
    CLEAR_EFFORT,
    CLEAR_WRENCH,
    DELETE,
    GET_STATE,
    JOINT_PROPERTIES,
    LINK_PROPERTIES,
    LINK_STATE,
    LIST,
    LIST_STOPS,
    MODEL_PROPERTIES,
    RELEASE_STOP,
    SET_CONFIGURATION,
    SET_DRIVE,
    SET_ODOMETRY,
    SET_STATE,
    SPAWN,
    WORLD_PROPERTIES,
    Done,
    Name,
)
from messages.se3 import Pose3, Vector, rotate
from messages.sensor import JointState
from messages.simulation import GetModelState, ModelList, SetModelState, SetOdometry, SpawnModel
from messages.std import Empty, Header, Time
from models import UnknownModel, display_name
from models.model import read_model
from models.urdf import read_joint_limits
from models.world import WorldDescription
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.validation import build
from services.runtime.requests import DeferredReply
from services.runtime.step import STEP_NS, STEP_S
from services.sim import SimParameters
from services.sim.drive.odometry import body_pose, body_twist
from services.sim.entities import (
    WORLD_STATE,
    ScopedName,
    find_joint,
    find_link,
    frame_state,
    pose_and_twist,
    relative_state,
    to_world_pose,
    world_body,
)
from services.sim.joints.effort_controller import JointEffortController
from services.sim.joints.jobs import schedule_job
from services.sim.joints.wrenches import LinkWrench
from services.sim.parameters import BaseParameters, JointParameters, RobotEntry
from services.sim.physics.world import GRAVITY, SOLVER_ITERATIONS, BodyState, JointFriction, World
from services.sim.robot_loader import RobotLoader, on_the_ground
from services.sim.sensors import joint_state
from services.sim.simulation import Simulation
from services.sim.time_modes import TimeMode

_ROUNDING_M = 1e-6
"""m; a height above 0 by rounding alone is still that of the ground."""


class SimulationServices:
    """Requests about models: spawning, states and emergency stops."""

    def __init__(self, simulation: Simulation, node: Node, loader: RobotLoader | None = None) -> None:
        self._simulation, self._loader = simulation, loader or RobotLoader()
        node.serve(SPAWN, self.spawn)
        node.serve(DELETE, self.delete)
        node.serve(LIST, self._list)
        node.serve(GET_STATE, self.get_state)
        node.serve(SET_STATE, self.set_state)
        node.serve(SET_ODOMETRY, self._set_odometry)
        node.serve(
            SET_DRIVE, lambda request: simulation.find(request.name).actuation.set_drive(request, simulation.now)
        )
        node.serve(LIST_STOPS, lambda _: EmergencyStops(stops=simulation.stops.all))
        node.serve(RELEASE_STOP, lambda request: Done(text=simulation.release_stop(request.name, request.holder)))

    def spawn(self, request: SpawnModel) -> ModelState | DeferredReply[ModelState]:
        """Spawn a model, at once or after its files are read."""
        return self._loader.spawn(request, lambda model: self._spawn(request, model))

    def _spawn(self, request: SpawnModel, model: str) -> ModelState:
        joints = positions_by_joint(request.joint_names, request.joint_positions)
        values = {each.name: each.value for each in request.parameters}
        place = to_world_pose(frame_state(self._simulation.world, request.reference_frame), pose_from_msg(request.pose))
        try:
            wheeled = read_model(model).has_base
            entry = RobotEntry(
                name=request.name,
                model=model,
                namespace=request.namespace,
                frame_prefix=request.frame_prefix,
                parameters=build(BaseParameters, values if wheeled else {}, request.name),
                joint_parameters=build(JointParameters, {} if wheeled else values, request.name),
                joints=joints,
            )
            return self._simulation.spawn(entry, place).state()
        except UnknownModel as error:
            raise BadInput(str(error)) from None

    def delete(self, request: Name) -> Done:
        """Delete a model."""
        self._simulation.delete(request.name)
        return Done(text=f"deleted {request.name}")

    def _list(self, _: Empty) -> ModelList:
        return ModelList(models=tuple(robot.state() for robot in self._simulation.robots))

    def get_state(self, request: GetModelState) -> ModelState:
        """Return the pose and twist of a model."""
        world = self._simulation.world
        if request.name in world.world_bodies:
            return world_body_model_state(world, request.name, request.relative_entity)
        robot = self._simulation.find(request.name)
        if not request.relative_entity:
            return robot.state()
        pose, twist = pose_and_twist(
            relative_state(frame_state(world, request.relative_entity), world.body(robot.name).state())
        )
        return ModelState(name=robot.name, model=display_name(robot.entry.model), pose=pose, twist=twist)

    def set_state(self, request: SetModelState) -> ModelState:
        """Set the pose and twist of a model; an imported robot is raised onto the ground, as when it is spawned."""
        world = self._simulation.world
        robot = None if request.name in world.world_bodies else self._simulation.find(request.name)
        if robot is not None and robot.model.fixed_base and request.twist != Twist():
            raise BadInput(f"{request.name} has a fixed base: its pose can be set, but not its twist")
        frame = frame_state(world, request.reference_frame)
        place = to_world_pose(frame, pose_from_msg(request.pose))
        if robot is not None and place.position[2] > -_ROUNDING_M:
            place = on_the_ground(robot.entry.model, place)
        axes = frame.orientation if request.reference_frame else place.orientation
        v, w = request.twist.linear, request.twist.angular
        linear, angular = rotate(axes, (v.x, v.y, v.z)), rotate(axes, (w.x, w.y, w.z))
        world.set_state(request.name, BodyState(place.position, place.orientation, linear, angular))
        if robot is None:
            return world_body_model_state(world, request.name)
        if robot.model.fixed_base:
            self._simulation.publish_static_tf()
        return robot.state()

    def _set_odometry(self, request: SetOdometry) -> Done:
        self._simulation.find(request.name).publishers.odometer.set_pose(request.x, request.y, request.yaw)
        self._simulation.publish_static_tf()
        return Done(
            text=f"odometry of {request.name} is now at ({request.x:g} m, {request.y:g} m, {request.yaw:g} rad)"
        )


def world_body_model_state(world: World, name: str, relative_entity: str = "") -> ModelState:
    """Return the state of a movable or moving body of the world, in the form of a robot's.

    Its twist is in its own axes, or in those of ``relative_entity``, if given.
    """
    state = world.world_body_state(name)
    if not relative_entity:
        return ModelState(name=name, pose=body_pose(state), twist=body_twist(state))
    pose, twist = pose_and_twist(relative_state(frame_state(world, relative_entity), state))
    return ModelState(name=name, pose=pose, twist=twist)


def pose_from_msg(pose: Pose) -> Pose3:
    """Convert a pose, normalising its quaternion; raises BadInput if that has no direction."""
    p, q = pose.position, pose.orientation
    norm = (q.x**2 + q.y**2 + q.z**2 + q.w**2) ** 0.5
    if norm < 1e-6:
        raise BadInput("the orientation (0, 0, 0, 0) is not a rotation; (0, 0, 0, 1) is the identity")
    return Pose3((p.x, p.y, p.z), (q.x / norm, q.y / norm, q.z / norm, q.w / norm))


MAX_FORCE = 1e5
"""N and N m in each axis; a larger one throws a robot out of numerical range."""


class JointServices:
    """Requests about joints, and about wrenches on links."""

    def __init__(self, simulation: Simulation, node: Node) -> None:
        self._simulation, self._world = simulation, simulation.world
        node.serve(APPLY_EFFORT, self.apply_effort)
        node.serve(CLEAR_EFFORT, self.clear_effort)
        node.serve(JOINT_PROPERTIES, self.properties)
        node.serve(SET_CONFIGURATION, self.set_configuration)
        node.serve(APPLY_WRENCH, self.apply_wrench)
        node.serve(CLEAR_WRENCH, self.clear_wrench)

    def apply_effort(self, request: ApplyEffort) -> Done:
        """Apply an effort to a joint."""
        job = request.job
        joint = find_joint(self._world, request.model, job.joint_name)
        own = JointEffort(joint_name=joint.name, effort=job.effort, start_time=job.start_time, duration=job.duration)
        note = self._controller(joint).add_job(own, self._simulation.now)
        return Done(text=f"{job.effort:g} on {joint} {self._describe_time(job.start_time.ns, job.duration, note)}")

    def clear_effort(self, request: JointName) -> Done:
        """Clear the efforts on a joint."""
        joint = find_joint(self._world, request.model, request.joint_name)
        return Done(text=f"{_count_jobs(self._controller(joint).clear_jobs(joint.name))} of {joint} cleared")

    def properties(self, request: JointName) -> JointProperties:
        """Return the properties and the state of a joint."""
        joint = find_joint(self._world, request.model, request.joint_name)
        robot = self._simulation.find(joint.body)
        limits = read_joint_limits(robot.entry.model)[joint.name]
        actuation, body = robot.actuation, self._world.body(joint.body)
        index, of_urdf = body.joints.index(joint.name), JointFriction(limits.damping, limits.friction)
        readings = actuation.with_efforts(body.joint_readings())
        damping, friction = actuation.joint_friction.get(joint.name, of_urdf)
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
            position=readings.position[index],
            rate=readings.velocity[index],
            applied_effort=readings.effort[index],
            jobs=actuation.job_count(joint.name),
        )

    def set_configuration(self, request: SetConfiguration) -> JointState:
        """Set joint positions."""
        robot = self._simulation.find(request.model)
        positions = positions_by_joint(request.joint_names, request.joint_positions)
        positions = {find_joint(self._world, robot.name, joint).name: each for joint, each in positions.items()}
        robot.actuation.set_joints(positions)
        robot.motors.hold_again(positions)
        body = self._world.body(robot.name)
        return joint_state(body.joints, body.joint_readings(), Header(stamp=Time.of(self._simulation.now)))

    def apply_wrench(self, request: ApplyWrench) -> Done:
        """Apply a wrench to a link."""
        link = find_link(self._world, request.body_name)
        frame_state(self._world, request.reference_frame)
        force, torque, point = (
            _tuple(each) for each in (request.wrench.force, request.wrench.torque, request.reference_point)
        )
        if any(abs(each) > MAX_FORCE for each in (*force, *torque)):
            raise BadInput(f"force {force} N, torque {torque} N m: the limit is {MAX_FORCE:g} in each axis")
        wrench = LinkWrench(force, torque, point, request.reference_frame)
        job, note = schedule_job(wrench, request.start_time.ns, request.duration, self._simulation.now, STEP_NS)
        self._simulation.wrenches.add(link, job)
        when = self._describe_time(request.start_time.ns, request.duration, note)
        held = self._simulation.find(link.body).model.fixed_base and link.name == self._world.body(link.body).links[0]
        return Done(text=f"wrench on {link} {when}" + ("; its base is fixed, so it will not move" if held else ""))

    def clear_wrench(self, request: LinkName) -> Done:
        """Clear the wrenches on a link."""
        link = find_link(self._world, request.link_name)
        return Done(text=f"{_count_jobs(self._simulation.wrenches.clear(link))} of {link} cleared")

    def _controller(self, joint: ScopedName) -> JointEffortController:
        return self._simulation.find(joint.body).actuation.effort_controller(joint.name)

    def _describe_time(self, start: int, duration: float, note: str) -> str:
        begins = f"from {start / 1e9:g} s " if start > self._simulation.now else "from now "
        return begins + (note or f"for {duration:g} s")


def positions_by_joint(names: Sequence[str], values: Sequence[float]) -> dict[str, float]:
    """Return positions by joint name; raises BadInput for lists of different lengths or repeated names."""
    if len(names) != len(values):
        raise BadInput(f"{len(names)} joint names and {len(values)} positions: each joint has one")
    if len(set(names)) < len(names):
        raise BadInput(f"a joint is named twice in {', '.join(names)}")
    return dict(zip(names, values, strict=True))


def _tuple(vector: Vector3 | Point) -> Vector:
    return vector.x, vector.y, vector.z


def _count_jobs(count: int) -> str:
    return "1 job" if count == 1 else f"{count} jobs"


class PropertyServices:
    """Requests for the properties of links, models and the world."""

    def __init__(
        self,
        simulation: Simulation,
        time_mode: TimeMode,
        node: Node,
        params: SimParameters,
        world_description: WorldDescription,
    ) -> None:
        self._simulation, self._time_mode, self._world, self._params, self._world_description = (
            simulation,
            time_mode,
            simulation.world,
            params,
            world_description,
        )
        node.serve(LINK_STATE, self.link_state)
        node.serve(LINK_PROPERTIES, self.link_properties)
        node.serve(MODEL_PROPERTIES, self.model_properties)
        node.serve(WORLD_PROPERTIES, self.world_properties)

    def link_state(self, request: LinkName) -> LinkState:
        """Return the pose and twist of a link, or of a body of the world."""
        link = world_body(self._world, request.link_name) or str(find_link(self._world, request.link_name))
        seen = relative_state(frame_state(self._world, request.reference_frame), frame_state(self._world, link))
        pose, twist = pose_and_twist(seen)
        return LinkState(link_name=link, pose=pose, twist=twist, reference_frame=request.reference_frame or "world")

    def link_properties(self, request: LinkName) -> LinkProperties:
        """Return the mass and inertia of a link."""
        link = find_link(self._world, request.link_name)
        found = self._world.body(link.body).inertia(link.name)
        x, y, z = found.moments
        centre = BodyState(found.centre.position, found.centre.orientation, WORLD_STATE.linear, WORLD_STATE.angular)
        return LinkProperties(
            link_name=str(link),
            com=pose_and_twist(centre)[0],
            mass=found.mass,
            inertia=Vector3(x=x, y=y, z=z),
            friction=found.friction,
            wrenches=self._simulation.wrenches.count(link),
        )

    def model_properties(self, request: Name) -> ModelProperties:
        """Return the links, joints and figures of a model."""
        robot = self._simulation.find(request.name)
        body = self._world.body(robot.name)
        return ModelProperties(
            name=robot.name,
            model=display_name(robot.entry.model),
            about=robot.model.about,
            namespace=robot.namespace,
            base_frame=robot.publishers.frame_id(robot.model.base_frame),
            links=body.links,
            joints=body.joints,
            mass=sum(body.inertia(link).mass for link in body.links),
            radius=robot.model.radius,
            is_static=robot.model.fixed_base,
            driven=robot.model.has_base,
        )

    def world_properties(self, _: Empty) -> WorldProperties:
        """Return the properties of the world, its physics and its time."""
        simulation, params = self._simulation, self._params
        return WorldProperties(
            world=params.world,
            sim_time=Time.of(simulation.now),
            tick=simulation.tick,
            epoch=simulation.epoch,
            mode=params.mode,
            factor=self._time_mode.factor,
            pause=simulation.paused,
            time_step=STEP_S,
            gravity=Vector3(z=-GRAVITY),
            iterations=SOLVER_ITERATIONS,
            ground_friction=self._world_description.friction,
            obstacles=tuple(body.name for body in self._world_description.all_bodies),
            model_names=self._world.names,
        )
