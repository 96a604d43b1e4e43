"""Gazebo's services and command topics under their own names, on top of the simulation's.

They respond as Gazebo does: a refused request has a response with ``success`` false and the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import msgspec

from messages import gazebo_msgs as gz
from messages.base import Message
from messages.gazebo import ApplyEffort, ApplyWrench, JointName, LinkName, SetConfiguration
from messages.gazebo_services import (
    APPLY_BODY_WRENCH,
    APPLY_JOINT_EFFORT,
    CLEAR_BODY_WRENCHES,
    CLEAR_JOINT_FORCES,
    DELETE_MODEL,
    GET_JOINT_PROPERTIES,
    GET_LINK_PROPERTIES,
    GET_LINK_STATE,
    GET_MODEL_PROPERTIES,
    GET_MODEL_STATE,
    GET_PHYSICS_PROPERTIES,
    GET_WORLD_PROPERTIES,
    PAUSE_PHYSICS,
    RESET_SIMULATION,
    RESET_WORLD,
    SET_LINK_STATE,
    SET_MODEL_CONFIGURATION,
    SET_MODEL_STATE,
    SET_PHYSICS_PROPERTIES,
    SPAWN_SDF_MODEL,
    SPAWN_URDF_MODEL,
    UNPAUSE_PHYSICS,
)
from messages.geometry import Point, Pose, Quaternion, Twist, Vector3
from messages.joints import JointEffort
from messages.parameters import Assignment
from messages.request import Request
from messages.requests import Name
from messages.se3 import Pose3, rotate, rotate_inverse
from messages.simulation import GetModelState, SetModelState, SimTime, SpawnModel
from messages.std import Empty, Header, Time
from messages.std_srvs import EmptyResponse
from messages.topics import SET_LINK_STATE as SET_LINK_STATE_TOPIC
from messages.topics import SET_MODEL_STATE as SET_MODEL_STATE_TOPIC
from models.model import read_model
from models.sdf import read_sdf_pose
from models.sdf_robot import is_sdf, model_name
from services.runtime.errors import BadInput, EleaError
from services.runtime.node import Node
from services.runtime.requests import DeferredReply
from services.runtime.step import STEP_S
from services.sim.entities import WORLD_FRAMES, find_link, frame_state, world_body
from services.sim.physics.world import GRAVITY, SOLVER_ITERATIONS
from services.sim.services import JointServices, PropertyServices, SimulationServices, pose_from_msg
from services.sim.simulation import Simulation

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

GROUND = "ground_plane"
"""Gazebo's name for the ground of its worlds."""
OWN_MODELS = {
    "turtlebot3_burger": "burger",
    "turtlebot3_waffle": "waffle",
    "turtlebot3_waffle_pi": "waffle_pi",
    "pioneer3dx": "p3dx",
    "p3dx": "p3dx",
    "ppend": "arm",
}
"""Robots that come with Elea, by their names in descriptions made elsewhere; ours are spawned in their place."""
LOG_PERIOD_S = 1.0
"""Minimum wall time between two log lines about refused commands."""
_JOINT_TYPES = {"revolute": gz.REVOLUTE, "continuous": gz.CONTINUOUS, "prismatic": gz.PRISMATIC}


class TimeServices(Protocol):
    """The requests that move time; they act between two ticks."""

    def set_paused(self, paused: bool) -> DeferredReply[SimTime]:
        """Pause or resume time."""
        ...

    def reset(self, time_too: bool) -> DeferredReply[SimTime]:
        """Reset all models, and time if asked."""
        ...


def _refusal(response: type[R], error: BaseException) -> R:
    fields: dict[str, Any] = {"success": False, "status_message": str(error)}
    return response(**fields)


def _refusing(response: type[R], handler: Callable[[Q], R | DeferredReply[R]]) -> Callable[[Q], R | DeferredReply[R]]:
    """Return the handler of a request that reports refusals in its response, if that has the fields."""
    fields = {each.name for each in msgspec.structs.fields(response)}

    def answer(request: Q) -> R | DeferredReply[R]:
        try:
            return handler(request)
        except (EleaError, ValueError) as error:
            if "success" not in fields:
                raise
            return _refusal(response, error)

    return answer


class GazeboServices:
    """Serves Gazebo's services, and carries out the commands on its topics."""

    def __init__(
        self,
        simulation: Simulation,
        node: Node,
        models: SimulationServices,
        joints: JointServices,
        properties: PropertyServices,
        time: TimeServices,
    ) -> None:
        self._simulation, self._node, self._world = simulation, node, simulation.world
        self._models, self._joints, self._properties = models, joints, properties
        self._serve_state(GET_MODEL_STATE, self._get_model_state, lambda request: request.model_name)
        self._serve(SET_MODEL_STATE, self._set_model_state)
        self._serve_state(GET_LINK_STATE, self._get_link_state, lambda request: request.link_name)
        self._serve(SET_LINK_STATE, self._set_link_state)
        self._serve(GET_MODEL_PROPERTIES, self._get_model_properties)
        self._serve(GET_WORLD_PROPERTIES, self._get_world_properties)
        self._serve_state(GET_JOINT_PROPERTIES, self._get_joint_properties, lambda request: request.joint_name)
        self._serve(GET_LINK_PROPERTIES, self._get_link_properties)
        self._serve(APPLY_JOINT_EFFORT, self._apply_joint_effort)
        self._serve(CLEAR_JOINT_FORCES, self._clear_joint_forces)
        self._serve(APPLY_BODY_WRENCH, self._apply_body_wrench)
        self._serve(CLEAR_BODY_WRENCHES, self._clear_body_wrenches)
        self._serve(SET_MODEL_CONFIGURATION, self._set_model_configuration)
        self._serve(SPAWN_URDF_MODEL, self._spawn)
        self._serve(SPAWN_SDF_MODEL, self._spawn)
        self._serve(DELETE_MODEL, self._delete_model)
        self._serve(GET_PHYSICS_PROPERTIES, self._get_physics_properties)
        self._serve(SET_PHYSICS_PROPERTIES, self._set_physics_properties)
        node.serve(PAUSE_PHYSICS, lambda _: _without_result(time.set_paused(True)))
        node.serve(UNPAUSE_PHYSICS, lambda _: _without_result(time.set_paused(False)))
        node.serve(RESET_WORLD, lambda _: _without_result(time.reset(False)))
        node.serve(RESET_SIMULATION, lambda _: _without_result(time.reset(True)))
        self._model_commands = node.subscribe(SET_MODEL_STATE_TOPIC)
        self._link_commands = node.subscribe(SET_LINK_STATE_TOPIC)
        simulation.commands.append(self.apply_commands)
        self._pushed: set[str] = set()
        self._waiting: list[tuple[DeferredReply[Any], Callable[[], Any]]] = []
        simulation.after_step.append(self._answer_waiting)

    def _serve(self, request: Request[Q, R], handler: Callable[[Q], R | DeferredReply[R]]) -> None:
        """Serve a request; if its response has the fields, a refusal is reported in it instead of raised."""
        self._node.serve(request, _refusing(request.response_type, handler))

    def _serve_state(
        self, request: Request[Q, R], handler: Callable[[Q], R | DeferredReply[R]], model: Callable[[Q], str]
    ) -> None:
        """Serve a request for a state.

        In real time, the state of a model that an effort or wrench was applied to since the last step is returned only
        after the next step. Otherwise a loop that reads, pushes and reads again would see the same state several times;
        in Gazebo it does not, as a step there is shorter than a call. A pause meanwhile answers with the state then.
        """
        respond = _refusing(request.response_type, handler)

        def answer(message: Q) -> R | DeferredReply[R]:
            pushed = self._pushed and self._simulation.runs_by_wall_clock
            if not pushed or self._model_of(model(message)) not in self._pushed:
                return respond(message)
            reply: DeferredReply[R] = DeferredReply()
            self._waiting.append((reply, lambda: respond(message)))
            return reply

        self._node.serve(request, answer)

    def _answer_waiting(self) -> None:
        """Answer the deferred state requests, after a step or as time is paused."""
        if self._pushed:
            self._pushed.clear()
            waiting, self._waiting = self._waiting, []
            for reply, response in waiting:
                reply.answer(response)

    def _model_of(self, name: str) -> str:
        """Return the model that a joint or link belongs to, if its name is unambiguous; else an empty name."""
        if name in self._world.names:
            return name
        for scope in ("::", "/"):
            model, _, _ = name.rpartition(scope)
            if model in self._world.names:
                return model
        owners = [each for each in self._world.names if self._has(each, name)]
        return owners[0] if len(owners) == 1 else ""

    def _has(self, model: str, part: str) -> bool:
        body = self._world.body(model)
        return part in body.joints or part in body.links

    def apply_commands(self) -> None:
        """Carry out the commands received for this tick, the newest for each model and link."""
        models = {each.model_name: each for each, _ in self._model_commands.messages}
        links = {each.link_name: each for each, _ in self._link_commands.messages}
        for subscriber in (self._model_commands, self._link_commands):
            subscriber.messages = []
        for model in models.values():
            self._command(self._move_model, model)
        for link in links.values():
            self._command(self._move_link, link)

    def _command(self, move: Callable[[Q], None], state: Q) -> None:
        try:
            move(state)
        except (EleaError, ValueError) as error:
            self._node.log.warn(f"a command to move a model is rejected: {error}", every=LOG_PERIOD_S)

    def _get_model_state(self, request: gz.GetModelState) -> gz.GetModelStateResponse:
        frame = request.relative_entity_name
        header = Header(stamp=Time.of(self._simulation.now), frame_id=frame)
        if request.model_name == GROUND:
            return gz.GetModelStateResponse(header=header, success=True)
        state = self._models.get_state(GetModelState(name=request.model_name, relative_entity=self._frame(frame)))
        return gz.GetModelStateResponse(header=header, pose=state.pose, twist=state.twist, success=True)

    def _set_model_state(self, request: gz.SetModelState) -> gz.SetModelStateResponse:
        self._move_model(request.model_state)
        return gz.SetModelStateResponse(success=True, status_message=f"{request.model_state.model_name} was moved")

    def _get_link_state(self, request: gz.GetLinkState) -> gz.GetLinkStateResponse:
        state = self._properties.link_state(
            LinkName(link_name=request.link_name, reference_frame=self._frame(request.reference_frame))
        )
        found = gz.LinkState(
            link_name=request.link_name, pose=state.pose, twist=state.twist, reference_frame=request.reference_frame
        )
        return gz.GetLinkStateResponse(link_state=found, success=True)

    def _set_link_state(self, request: gz.SetLinkState) -> gz.SetLinkStateResponse:
        self._move_link(request.link_state)
        return gz.SetLinkStateResponse(success=True, status_message=f"{request.link_state.link_name} was moved")

    def _get_model_properties(self, request: gz.GetModelProperties) -> gz.GetModelPropertiesResponse:
        if request.model_name == GROUND or request.model_name in self._world.world_bodies:
            return gz.GetModelPropertiesResponse(
                canonical_body_name="link",
                body_names=("link",),
                is_static=request.model_name == GROUND,
                success=True,
            )
        found = self._properties.model_properties(Name(name=request.model_name))
        return gz.GetModelPropertiesResponse(
            canonical_body_name=found.links[0],
            body_names=found.links,
            joint_names=found.joints,
            is_static=found.is_static,
            success=True,
        )

    def _get_world_properties(self, _: gz.GetWorldProperties) -> gz.GetWorldPropertiesResponse:
        found = self._properties.world_properties(Empty())
        bodies = dict.fromkeys((*found.obstacles, *self._world.world_bodies))
        return gz.GetWorldPropertiesResponse(
            sim_time=found.sim_time.ns / 1e9, model_names=(GROUND, *bodies, *found.model_names), success=True
        )

    def _get_joint_properties(self, request: gz.GetJointProperties) -> gz.GetJointPropertiesResponse:
        found = self._joints.properties(_joint(request.joint_name))
        return gz.GetJointPropertiesResponse(
            type=_JOINT_TYPES[found.type],
            damping=(found.damping,),
            position=(found.position,),
            rate=(found.rate,),
            success=True,
        )

    def _get_link_properties(self, request: gz.GetLinkProperties) -> gz.GetLinkPropertiesResponse:
        link = find_link(self._world, request.link_name)
        found = self._world.body(link.body).inertia(link.name)
        axes = [rotate(found.centre.orientation, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]

        def moment(row: int, column: int) -> float:
            return sum(size * axis[row] * axis[column] for size, axis in zip(found.moments, axes, strict=True))

        return gz.GetLinkPropertiesResponse(
            com=Pose3(found.centre.position).to_msg(),
            mass=found.mass,
            ixx=moment(0, 0),
            ixy=moment(0, 1),
            ixz=moment(0, 2),
            iyy=moment(1, 1),
            iyz=moment(1, 2),
            izz=moment(2, 2),
            success=True,
        )

    def _apply_joint_effort(self, request: gz.ApplyJointEffort) -> gz.ApplyJointEffortResponse:
        joint = _joint(request.joint_name)
        job = msgspec.convert(
            {
                "joint_name": joint.joint_name,
                "effort": request.effort,
                "start_time": request.start_time,
                "duration": _seconds(request.duration.ns),
            },
            JointEffort,
        )
        done = self._joints.apply_effort(ApplyEffort(model=joint.model, job=job))
        self._pushed.add(self._model_of(request.joint_name))
        return gz.ApplyJointEffortResponse(success=True, status_message=done.text)

    def _clear_joint_forces(self, request: gz.JointRequest) -> gz.JointRequestResponse:
        self._joints.clear_effort(_joint(request.joint_name))
        return gz.JointRequestResponse()

    def _apply_body_wrench(self, request: gz.ApplyBodyWrench) -> gz.ApplyBodyWrenchResponse:
        done = self._joints.apply_wrench(
            ApplyWrench(
                body_name=request.body_name,
                reference_frame=self._frame(request.reference_frame),
                reference_point=self._point_of_link(request),
                wrench=request.wrench,
                start_time=request.start_time,
                duration=_seconds(request.duration.ns),
            )
        )
        self._pushed.add(self._model_of(request.body_name))
        return gz.ApplyBodyWrenchResponse(success=True, status_message=done.text)

    def _clear_body_wrenches(self, request: gz.BodyRequest) -> gz.BodyRequestResponse:
        self._joints.clear_wrench(LinkName(link_name=request.body_name))
        return gz.BodyRequestResponse()

    def _set_model_configuration(self, request: gz.SetModelConfiguration) -> gz.SetModelConfigurationResponse:
        self._joints.set_configuration(
            SetConfiguration(
                model=request.model_name,
                joint_names=request.joint_names,
                joint_positions=request.joint_positions,
            )
        )
        return gz.SetModelConfigurationResponse(
            success=True, status_message=f"{len(request.joint_names)} joints were set"
        )

    def _spawn(self, request: gz.SpawnModel) -> gz.SpawnModelResponse | DeferredReply[gz.SpawnModelResponse]:
        spawn, notes = self._spawn_request(request)
        answer = self._models.spawn(spawn)
        done = gz.SpawnModelResponse(success=True, status_message=f"spawned {request.model_name}{notes}")
        if not isinstance(answer, DeferredReply):
            return done
        reply: DeferredReply[gz.SpawnModelResponse] = DeferredReply()

        def respond(response: Callable[[], Any]) -> None:
            def spawned() -> gz.SpawnModelResponse:
                try:
                    response()
                except (EleaError, ValueError) as error:
                    return _refusal(gz.SpawnModelResponse, error)
                return done

            reply.answer(spawned)

        answer.bind(respond)
        return reply

    def _spawn_request(self, request: gz.SpawnModel) -> tuple[SpawnModel, str]:
        """Return the request in the simulation's form, and remarks."""
        if not request.model_name:
            raise BadInput("model_name is empty: the model to spawn needs a name")
        known = model_name(request.model_xml)
        pose, notes = _pose(request.initial_pose), ""
        model, urdf = OWN_MODELS.get(known, ""), request.model_xml
        if model:
            urdf = ""
            notes = f": Elea's own model {model} is used for {known}"
        elif is_sdf(urdf):
            pose = pose @ read_sdf_pose(urdf)
        elif not request.model_xml.strip():
            raise BadInput(f"{request.model_name}: its model_xml is empty: was the file or parameter found?")
        namespace, prefix = self._place(request, model, urdf)
        # As the TurtleBots' Gazebo plugin publishes it: true odometry.
        exact = (Assignment(name="odometry", value="world"),) if model and read_model(model).drifts else ()
        spawn = SpawnModel(
            name=request.model_name,
            model=model or known[:255] or request.model_name,
            urdf=urdf,
            namespace=namespace,
            frame_prefix=prefix,
            pose=pose.to_msg(),
            reference_frame=self._frame(request.reference_frame),
            parameters=exact,
        )
        return spawn, notes

    def _place(self, request: gz.SpawnModel, model: str, urdf: str) -> tuple[str, str | None]:
        """Return namespace and frame prefix: Gazebo's for a robot that drives, if no other robot has them.

        An object without a plugin has topics, too; they are in a namespace of its own.
        """
        if request.robot_namespace.strip("/"):
            return request.robot_namespace, None
        taken = any(robot.namespace == "/" for robot in self._simulation.robots)
        drives = bool(model) or "<plugin" in urdf
        return ("/", "") if drives and not taken else ("", None)

    def _delete_model(self, request: gz.DeleteModel) -> gz.DeleteModelResponse:
        if request.model_name == GROUND or request.model_name in self._world.world_bodies:
            raise BadInput(f"{request.model_name} is part of the world and cannot be deleted")
        done = self._models.delete(Name(name=request.model_name))
        return gz.DeleteModelResponse(success=True, status_message=done.text)

    def _get_physics_properties(self, _: gz.GetPhysicsProperties) -> gz.GetPhysicsPropertiesResponse:
        found = self._properties.world_properties(Empty())
        return gz.GetPhysicsPropertiesResponse(
            time_step=found.time_step,
            pause=found.pause,
            max_update_rate=0.0 if found.mode == "lockstep" else found.factor / found.time_step,
            gravity=found.gravity,
            ode_config=gz.ODEPhysics(sor_pgs_iters=SOLVER_ITERATIONS),
            success=True,
        )

    def _set_physics_properties(self, request: gz.SetPhysicsProperties) -> gz.SetPhysicsPropertiesResponse:
        step, gravity = STEP_S, Vector3(z=-GRAVITY)
        if request.time_step not in (0.0, step):
            raise BadInput(f"the time_step is fixed at {step:g} s")
        apart = max(abs(request.gravity.x), abs(request.gravity.y), abs(request.gravity.z - gravity.z))
        if apart > 0.05:
            raise BadInput(f"gravity is fixed at (0, 0, {gravity.z:g}) m/s2")
        rate = self._get_physics_properties(gz.GetPhysicsProperties()).max_update_rate
        if abs(request.max_update_rate - rate) > 1e-6 * rate:
            raise BadInput(
                f"max_update_rate is {rate:g} per second: to change the speed of time, set the parameter factor of "
                "/sim (./elea param set /sim factor 2)"
            )
        return gz.SetPhysicsPropertiesResponse(success=True, status_message="the physics has these properties already")

    def _move_model(self, state: gz.ModelState) -> None:
        fixed = state.model_name in self._world.names and self._simulation.find(state.model_name).model.fixed_base
        self._models.set_state(
            SetModelState(
                name=state.model_name,
                pose=_pose(state.pose).to_msg(),
                twist=Twist() if fixed else state.twist,
                reference_frame=self._frame(state.reference_frame),
            )
        )

    def _move_link(self, state: gz.LinkState) -> None:
        name = world_body(self._world, state.link_name)
        if not name:
            link = find_link(self._world, state.link_name)
            root = self._world.body(link.body).links[0]
            if link.name != root:
                raise BadInput(
                    f"{link} is attached by joints: only the root link {root} of {link.body} can be moved; use "
                    "set_model_configuration for joints"
                )
            name = link.body
        self._move_model(
            gz.ModelState(model_name=name, pose=state.pose, twist=state.twist, reference_frame=state.reference_frame)
        )

    def _point_of_link(self, request: gz.ApplyBodyWrench) -> Point:
        """Return the point at which a force acts, in the link's own frame."""
        link = find_link(self._world, request.body_name)
        body, point = self._world.body(link.body), request.reference_point
        frame = self._frame(request.reference_frame)
        if frame in WORLD_FRAMES and point == Point():
            x, y, z = body.inertia(link.name).centre.position
            return Point(x=x, y=y, z=z)
        seen = frame_state(self._world, frame)
        a, b, c = (Pose3(seen.position, seen.orientation) @ Pose3((point.x, point.y, point.z))).position
        place = body.link_pose(link.name)
        u, v, w = place.position
        x, y, z = rotate_inverse(place.orientation, (a - u, b - v, c - w))
        return Point(x=x, y=y, z=z)

    def _frame(self, name: str) -> str:
        """Return the simulation's name of a reference frame; Gazebo's empty name is the world."""
        return "world" if name in WORLD_FRAMES or name == GROUND else name


def _joint(name: str) -> JointName:
    model, _, joint = name.rpartition("::")
    return JointName(model=model, joint_name=joint)


def _pose(pose: Pose) -> Pose3:
    """Convert a pose; the orientation (0, 0, 0, 0), ROS 1's default, becomes the identity, as in Gazebo."""
    if pose.orientation == Quaternion(w=0.0):
        return pose_from_msg(msgspec.structs.replace(pose, orientation=Quaternion()))
    return pose_from_msg(pose)


def _seconds(nanoseconds: int) -> float:
    """Convert a duration to s; -1 for a negative one, which has no end."""
    return -1.0 if nanoseconds < 0 else nanoseconds / 1e9


def _without_result(reply: DeferredReply[SimTime]) -> DeferredReply[EmptyResponse]:
    made: DeferredReply[EmptyResponse] = DeferredReply()

    def respond(response: Callable[[], Any]) -> None:
        def done() -> EmptyResponse:
            response()
            return EmptyResponse()

        made.answer(done)

    reply.bind(respond)
    return made
