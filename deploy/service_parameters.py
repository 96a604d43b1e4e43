"""The parameters that each service gets from its fleet, including those of arms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from deploy.controller_files import KIND as CONTROLLER_MANAGER
from deploy.controller_files import joint_state_rate
from deploy.fleet import Fleet, ReferenceConfig, RobotConfig, ServiceConfig
from deploy.run_folder import BAG_FOLDER, RECORDING_FILE, ROSPARAM_FILE, SCHEDULE_FILE, STOPS_FILE
from messages.names import join
from messages.topics import CONTROL_STATE
from models.dynamics import read_pendulum
from models.model import read_model
from models.urdf import read_joint_limits
from services.arm import ArmParameters
from services.catalog import is_script
from services.logger import LoggerParameters
from services.panel.address import ADDRESS_FILE as PANEL_FILE
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.validation import build
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh_config import PORT
from services.sim.drive.config import odometry_config, robot_config
from services.sim.parameters import BaseParameters, JointParameters
from services.sim.robot_names import robot_frame_prefix, robot_namespace

UNLIMITED_NM = 1e9
"""Effort [N m] at which an arm's controller counts as saturated if its joint has no limit."""
CHANGE_MARGIN_S = 1.0
"""Minimum time [s] between the last scheduled change and an end by goals, so that its effect is measured."""


def is_arm(robot: RobotConfig) -> bool:
    """Return whether a robot is an arm: it has no driving base, but a joint with limits."""
    return not read_model(robot.model).has_base and bool(_limited_joints(robot))


def controlled_joint(robot: RobotConfig) -> str:
    """Return the controlled joint of an arm: the first with a range, from the root on."""
    return next(iter(_limited_joints(robot)))


def arm_parameters(kind: str, fleet: Fleet, robot: RobotConfig | None) -> dict[str, Any]:
    """Return the parameters of an arm's controller or reference; without a robot, for the fleet's only arm."""
    if kind not in ("arm", "reference"):
        return {}
    arms = [each for each in fleet.robot if is_arm(each)]
    if robot is None and len(arms) == 1:
        robot = arms[0]
    if robot is None or not is_arm(robot):
        return {}
    joint = controlled_joint(robot)
    lower, upper = _limited_joints(robot)[joint]
    ends = {"lower": math.degrees(lower), "upper": math.degrees(upper)}
    if kind == "reference":
        return ends
    weight = read_pendulum(robot.model, joint)
    return {
        "joint": joint,
        **ends,
        "gravity_torque": weight.torque,
        "gravity_rest": math.degrees(weight.rest),
        "inertia": weight.inertia,
    }


def state_parameters(kind: str, robot: RobotConfig | None) -> dict[str, Any]:
    """Return the parameters of a robot's service ``state``: the prefix of its frames."""
    return {"frame_prefix": robot_frame_prefix(robot)} if kind == "state" and robot is not None else {}


def grader_arms(fleet: Fleet) -> list[dict[str, Any]]:
    """Return the grader's arms: those with a reference, or not driven by a controller manager."""
    return [
        _referred_arm(each, each.reference) if each.reference is not None else _grader_arm(fleet, each)
        for each in fleet.robot
        if is_arm(each) and (each.reference is not None or not _has_controller_manager(fleet, each))
    ]


def referred_joint(robot: RobotConfig, reference: ReferenceConfig) -> str:
    """Return the joint of a set-point; raises BadInput."""
    joints = _limited_joints(robot)
    if not is_arm(robot) or not joints:
        raise BadInput(f"{robot.name} is not an arm: a reference is the set-point of a joint that has a range")
    if reference.joint and reference.joint not in joints:
        raise unknown_name("joint with a range", reference.joint, joints)
    return reference.joint or controlled_joint(robot)


def reference_topic(robot: RobotConfig, reference: ReferenceConfig) -> str:
    """Return the absolute name of a set-point's topic."""
    absolute = reference.topic.startswith("/")
    return reference.topic if absolute else join(robot_namespace(robot), reference.topic)


def _referred_arm(robot: RobotConfig, reference: ReferenceConfig) -> dict[str, Any]:
    joint = referred_joint(robot, reference)
    return {
        "name": robot.name,
        "joint": joint,
        "saturation": read_joint_limits(robot.model)[joint].effort or UNLIMITED_NM,
        "state": "",
        "reference": reference_topic(robot, reference),
        "reference_type": reference.type,
        "reference_unit": reference.unit,
    }


def _has_controller_manager(fleet: Fleet, robot: RobotConfig) -> bool:
    return any(each.kind == CONTROLLER_MANAGER for each in _own_services(fleet, robot))


def _own_services(fleet: Fleet, robot: RobotConfig) -> tuple[ServiceConfig, ...]:
    """Return the services in the namespace of a robot."""
    return (*robot.services, *(each for _, each in fleet.shared_services(robot)))


def control_state_topics(fleet: Fleet) -> list[str]:
    """Return the topic of the joint controller's state for each robot; empty if it is not an arm."""
    arms = {each["name"]: each["state"] for each in grader_arms(fleet)}
    return [arms.get(each.name, "") for each in fleet.robot]


def earliest_end(fleet: Fleet) -> float:
    """Return the earliest simulation time [s] at which goals may end the run."""
    return max((each.at + CHANGE_MARGIN_S for each in fleet.change), default=0.0)


def _grader_arm(fleet: Fleet, robot: RobotConfig) -> dict[str, Any]:
    members = [*robot.services, *(each for _, each in fleet.shared_services(robot)), *fleet.service]
    member = next((each for each in members if each.kind == "arm"), ServiceConfig(kind="arm"))
    return {
        "name": robot.name,
        "joint": member.parameters.get("joint", controlled_joint(robot)),
        "saturation": member.parameters.get("saturation", ArmParameters().saturation),
        "state": member.remap.get(CONTROL_STATE.name, CONTROL_STATE.name),
    }


def _limited_joints(robot: RobotConfig) -> dict[str, tuple[float, float]]:
    """Return the revolute joints of a robot that have a range, rad."""
    limits = read_joint_limits(robot.model).items()
    return {
        name: (each.lower, each.upper)
        for name, each in limits
        if each.kind == "revolute" and each.lower is not None and each.upper is not None and each.lower < each.upper
    }


BUILTIN_SERVICES = ("router", "params", "sim", "grader")
"""Services that every fleet has; a fleet file states one only to set its parameters."""

OBSERVER_SERVICES = ("panel",)
"""Services that affect neither a run nor its results: messages that they lose do not count as losses of the run."""


class RunOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options of the command line besides the fleet file: result folder, network, viewer, and the report's picture.

    ``saved`` is the file of saved parameters; without one, changes last for the run only. The router connects to those
    at ``links``, and also listens at ``listen``; ``insecure`` allows addresses that other machines can reach.
    ``overrides`` are the overridden keys of the fleet file, for the report. ``tcp_port`` replaces the fleet's port for
    a fleet that uses TCP.
    """

    folder: Path
    saved: Path | None = None
    domain: str = ""
    links: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()
    insecure: bool = False
    overrides: tuple[str, ...] = ()
    tcp_port: int | None = None
    view: bool = True
    picture: bool = True


def has_rosparam(fleet: Fleet) -> bool:
    """Return whether a fleet has ROS 1 parameters or scripts."""
    members = (*fleet.service, *fleet.every_robot, *(each for robot in fleet.robot for each in robot.services))
    return bool(fleet.rosparam) or any(is_script(each.kind) for each in members)


def fleet_endpoint(fleet: Fleet) -> str:
    """Return the endpoint of the fleet's router for this user's processes."""
    return router_endpoint(fleet.run.port)


def listen_endpoints(fleet: Fleet, options: RunOptions) -> tuple[str, ...]:
    """Return the additional endpoints of the fleet's router."""
    own = (f"tcp/127.0.0.1:{options.tcp_port or fleet.run.port}",) if fleet.run.tcp else ()
    return (*own, *(each for each in options.listen if each not in own))


class NodeGroups(msgspec.Struct, frozen=True, kw_only=True):
    """The nodes of a fleet by role.

    Lockstep waits for ``members`` at each tick. Simulation time waits for ``awaits`` before it begins, and does not
    begin without ``requires``. ``turtlesims`` are the nodes that simulate turtles. Messages that ``readers`` lose count
    as losses of the run.
    """

    members: tuple[str, ...] = ()
    awaits: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    turtlesims: tuple[str, ...] = ()
    readers: tuple[str, ...] = ()


def service_parameters(kind: str, fleet: Fleet, options: RunOptions, nodes: NodeGroups) -> dict[str, Any]:
    """Return the parameters that a service gets from the fleet; its own table in the fleet file overrides them."""
    run, robots = fleet.run, fleet.robot
    match kind:
        case "router":
            return {
                "listen": fleet_endpoint(fleet),
                "also": list(listen_endpoints(fleet, options)),
                "insecure": options.insecure,
                "link": list(options.links),
            }
        case "params":
            return {
                "file": str(options.saved) if options.saved is not None else "",
                "schedule": [msgspec.to_builtins(each) for each in fleet.change],
                "schedule_file": str(options.folder / SCHEDULE_FILE) if fleet.change else "",
                **({"rosparam_file": str(options.folder / ROSPARAM_FILE)} if has_rosparam(fleet) else {}),
            }
        case "sim":
            return {
                **({"world": fleet.world} if fleet.world else {}),
                "robots": [_sim_robot(fleet, each) for each in robots],
                "mode": run.mode,
                "factor": run.factor,
                **({"engine": run.engine} if run.engine else {}),
                "latency": run.latency,
                "seed": run.seed,
                "members": list(nodes.members),
                "awaits": [each for each in nodes.awaits if each not in nodes.members],
                "requires": list(nodes.requires),
                "stops_file": str(options.folder / STOPS_FILE),
                "model_folders": [fleet.folder, *run.packages] if fleet.folder else [],
            }
        case "grader":
            return {
                "robots": [each.name for each in robots],
                "namespaces": [robot_namespace(each) for each in robots],
                "halting": [_braking_spec(each) for each in robots if read_model(each.model).has_base],
                "sizes": _size_specs([each for each in robots if not is_arm(each)]),
                "arms": grader_arms(fleet),
                "ends": run.ends,
                "not_before": earliest_end(fleet),
                "duration": run.duration,
                "turtlesims": list(nodes.turtlesims),
                "readers": list(nodes.readers),
                "output": str(options.folder),
            }
        case "logger":
            viewer = {} if options.view else {"view": "never", "serve": False}
            return {
                "robots": [each.name for each in robots],
                "namespaces": [robot_namespace(each) for each in robots],
                "frame_prefixes": [robot_frame_prefix(each) for each in robots],
                "models": [each.model for each in robots] or ["burger"],
                "states": control_state_topics(fleet),
                # In lockstep all nodes wait for the simulation, which needs a tenth more CPU in lab to publish its
                # laser scans.
                "scans": run.mode != "lockstep",
                "file": str(options.folder / RECORDING_FILE),
                **_live_view_port(run.port),
                **viewer,
            }
        case "recorder":
            return {"output": str(options.folder / BAG_FOLDER), "members": list(nodes.members), "resume": True}
        case "panel":
            return {"address": str(options.folder / PANEL_FILE)}
        case _:
            return {}


def _live_view_port(router: int) -> dict[str, int]:
    """Return the port of the live view, offset from the default like the router's, so that two fleets differ."""
    port = LoggerParameters().port + router - PORT
    return {"port": port} if router != PORT and 1024 <= port <= 65535 else {}


def _sim_robot(fleet: Fleet, robot: RobotConfig) -> dict[str, Any]:
    pose = {"x": robot.pose.x, "y": robot.pose.y, "z": robot.pose.z, "yaw": robot.pose.yaw}
    table = "parameters" if read_model(robot.model).has_base else "joint_parameters"
    names: dict[str, Any] = {"name": robot.name, "model": robot.model}
    if robot.namespace:
        names["namespace"] = robot.namespace
    if robot.frame_prefix is not None:
        names["frame_prefix"] = robot.frame_prefix
    if rate := joint_state_rate(_own_services(fleet, robot), robot):
        names["joint_state_rate"] = rate
    if robot.joints:
        names["joints"] = robot.joints
    return {**names, **pose, table: robot.parameters}


def odometry_counts_from_start(robot: RobotConfig) -> bool:
    """Return whether the odometry of a robot is 0 at its start; otherwise it begins at the robot's
    pose in the world.
    """
    model = read_model(robot.model)
    if model.wheels is None:
        return False
    config = odometry_config(model, build(BaseParameters, robot.parameters))
    return config.source != "world" and not config.in_world


def robot_parameter_set(robot: RobotConfig) -> str:
    """Return the parameter set of a robot in the simulation: that of its base or joints."""
    return join(robot_namespace(robot), "base" if read_model(robot.model).has_base else "joints")


def robot_parameters_type(model: str) -> type[Parameters]:
    """Return the parameter record of a robot of this model."""
    return BaseParameters if read_model(model).has_base else JointParameters


def _size_specs(robots: Sequence[RobotConfig]) -> list[dict[str, Any]]:
    """Return the space that each robot occupies; without a top if its URDF does not give its height."""
    from models.extents import vertical_extent  # imports numpy and mesh decoders, which a plain command never needs

    extents = {model: vertical_extent(model) for model in dict.fromkeys(each.model for each in robots)}
    sizes: list[dict[str, Any]] = []
    for robot in robots:
        bottom, top = extents[robot.model]
        size = {"name": robot.name, "radius": read_model(robot.model).radius, "bottom": bottom}
        sizes.append(size if math.isinf(top) else {**size, "top": top})
    return sizes


def _braking_spec(robot: RobotConfig) -> dict[str, Any]:
    """Return the braking of a robot's base after its last command, from its parameters or its model."""
    base = robot_config(robot.model, build(BaseParameters, robot.parameters)).parameters
    return {"name": robot.name, "timeout": base.cmd_vel_timeout, "brake": base.brake}
