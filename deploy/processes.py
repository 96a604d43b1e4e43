"""Plans the processes of a fleet as data: what to run, in which order, and what their end means."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from deploy.composition import PlacedService, group_services
from deploy.controller_files import manager_parameters
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.fleet_validation import service_identity
from deploy.restart_policy import RestartMode, RestartPolicy
from deploy.run_folder import CONTAINERS_FOLDER
from deploy.service_parameters import (
    BUILTIN_SERVICES,
    OBSERVER_SERVICES,
    NodeGroups,
    RunOptions,
    arm_parameters,
    fleet_endpoint,
    odometry_counts_from_start,
    service_parameters,
    state_parameters,
)
from messages.se2 import Pose2
from services.catalog import is_script, is_user_file, load_service
from services.runtime.atomic_file import write_atomic
from services.runtime.graph import SUPERVISOR
from services.script.command_line import hash_environment

_RESTART_MODES: dict[str, RestartMode] = {"router": "always", "grader": "never"}
"""Restart policies by kind: a router never finishes, and a restarted grader has lost its measurements."""


_NOT_AWAITED = ("router", "sim")
"""Services that simulation time does not wait for: the router starts first, and the simulation itself waits."""

_DEPENDENCIES = {"router": (), "params": ("router",), "sim": ("router", "params")}
"""Services that must be ready first; all others need the simulation, and through it the router and the parameters."""

_STEADY_LINKS = ("router", "sim", *OBSERVER_SERVICES)
"""Services that step with none, but in lockstep keep their links to a process that stands still as long as those that
do. Otherwise such a process would lose messages of theirs, and a recording would miss them."""


class NodeSpec(msgspec.Struct, frozen=True, kw_only=True):
    """A node: its name, its kind of service, and its own options, without those of its process."""

    name: str
    kind: str
    arguments: tuple[str, ...] = ()

    @property
    def command_line(self) -> str:
        """The line that ``services container`` reads."""
        return shlex.join((self.kind, *self.arguments))


class ProcessSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One process and its nodes: one, or those of a container.

    The fleet ends with a ``required`` process; ``depends_on`` names those that must be ready first. With ``ends_run``,
    exiting with status 0 ends the run, and is no failure. Simulation time begins when every ``awaited`` process is
    ready: the simulation and those that it waits for.
    """

    name: str
    nodes: tuple[NodeSpec, ...]
    kind: str
    argv: tuple[str, ...]
    required: bool = False
    ends_run: bool = False
    awaited: bool = False
    policy: RestartPolicy = RestartPolicy()
    depends_on: tuple[str, ...] = ()
    environment: Mapping[str, str] = {}
    cwd: str = ""
    screen: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its nodes."""
        return tuple(each.name for each in self.nodes)


MOST_DIRECT = 20
"""Maximum number of nodes whose processes connect to each other directly; in a larger fleet they connect to the router
only.

Each of N direct processes opens N links, and looks up each topic that another declares among all that it knows. Up to
20 nodes the topologies perform alike (16 robots with a controller each: 3.1 and 3.5 x real time); 36 processes start in
12 s directly and in 4.6 s in star, and run at 0.6 and 1.8 x; a hundred robots in 8 processes block each other directly.
"""


def choose_topology(fleet: Fleet) -> Fleet:
    """Return the fleet with a topology chosen by its size, unless it states one."""
    if fleet.run.topology != "auto":
        return fleet
    nodes = len(_place_services(fleet))
    topology: Literal["direct", "star"] = "star" if nodes > MOST_DIRECT else "direct"
    return msgspec.structs.replace(fleet, run=msgspec.structs.replace(fleet.run, topology=topology))


def plan_processes(fleet: Fleet, options: RunOptions) -> tuple[ProcessSpec, ...]:
    """Return every process of the fleet, dependencies first: router, parameters, simulation, then the rest."""
    fleet = choose_topology(fleet)
    stated = _place_services(fleet)
    taking_part = [each for each in stated if each.service.kind not in OBSERVER_SERVICES]
    awaited = [each for each in taking_part if each.service.kind not in _NOT_AWAITED]
    nodes = NodeGroups(
        members=tuple(
            each.node for each in stated if fleet.run.mode == "lockstep" and _is_lockstep_member(each.service.kind)
        ),
        awaits=tuple(each.node for each in awaited),
        requires=tuple(each.node for each in awaited if each.required),
        turtlesims=tuple(each.node for each in stated if each.service.kind == "turtlesim"),
        readers=(SUPERVISOR, *(each.node for each in taking_part)),
    )
    singles = {each.node: _process_spec(each, fleet, options, nodes) for each in stated}
    groups = ((group.name, [singles[each.node] for each in group.members]) for group in group_services(stated, fleet))
    return tuple(_container_spec(name, members, fleet, options) if name else members[0] for name, members in groups)


def write_containers(plan: Sequence[ProcessSpec], folder: Path) -> None:
    """Write the file that lists the nodes of each container into the run's folder."""
    for each in plan:
        if len(each.nodes) > 1:
            file = folder / CONTAINERS_FOLDER / each.name
            file.parent.mkdir(exist_ok=True)
            write_atomic(file, "".join(f"{node.command_line}\n" for node in each.nodes).encode())


def _place_services(fleet: Fleet) -> list[PlacedService]:
    own = {each.kind: each for each in fleet.service if each.kind in BUILTIN_SERVICES}
    stated = [PlacedService(own.get(kind, ServiceConfig(kind=kind)), None) for kind in BUILTIN_SERVICES]
    stated += [PlacedService(each, None) for each in fleet.service if each.kind not in BUILTIN_SERVICES]
    for robot in fleet.robot:
        stated += [PlacedService(each, robot) for each in robot.services]
        stated += [PlacedService(each, robot) for _, each in fleet.shared_services(robot)]
    return stated


def _is_lockstep_member(kind: str) -> bool:
    """Return whether lockstep waits for services of this kind at each tick."""
    return load_service(kind).steps


def _container_spec(name: str, singles: Sequence[ProcessSpec], fleet: Fleet, options: RunOptions) -> ProcessSpec:
    """Return the process of nodes that would each have one of ``singles``; their command lines are in a file of the
    run.
    """
    arguments = ["--name", name, *_network_arguments(fleet, options), "--await-params"]
    if any("--lockstep" in each.argv for each in singles):
        arguments.append("--lockstep")
    arguments += ["--nodes", str(options.folder / CONTAINERS_FOLDER / name)]
    return msgspec.structs.replace(
        singles[0],
        name=name,
        nodes=tuple(node for each in singles for node in each.nodes),
        kind="container",
        argv=(sys.executable, "-P", "-m", "services", "container", *arguments),
        required=any(each.required for each in singles),
        awaited=any(each.awaited for each in singles),
        screen=any(each.screen for each in singles),
    )


def _process_spec(stated: PlacedService, fleet: Fleet, options: RunOptions, nodes: NodeGroups) -> ProcessSpec:
    member, kind = stated.service, stated.service.kind
    own = _own_arguments(stated, {} if is_script(kind) else _parameters(stated, fleet, options, nodes))
    match member.restart:
        case None:
            policy = RestartPolicy(when=_RESTART_MODES.get(kind, "on-failure"))
        case RestartPolicy() as policy:
            pass
        case when:
            policy = RestartPolicy(when=when)
    return ProcessSpec(
        name=stated.node.removeprefix("/"),
        nodes=(NodeSpec(name=stated.node, kind=kind, arguments=tuple(own)),),
        kind=kind,
        argv=(sys.executable, "-P", "-m", *_command(stated, own, fleet, options, nodes)),
        required=stated.required,
        ends_run=stated.required and is_script(kind),
        awaited=kind == "sim" or stated.node in nodes.awaits,
        policy=policy,
        depends_on=_DEPENDENCIES.get(kind, ("router", "sim")),
        environment=member.environment | _lockstep_environment(stated, fleet, nodes),
        cwd=member.cwd,
        screen=member.output == "screen",
    )


def _command(
    stated: PlacedService, own: Sequence[str], fleet: Fleet, options: RunOptions, nodes: NodeGroups
) -> tuple[str, ...]:
    """Return module and arguments of a process.

    A user's file runs as in ``./elea run``, with its folder on the path; for a ROS script, everything after its file's
    name is its own.
    """
    kind, node = stated.service.kind, stated.node
    network = _network_arguments(fleet, options) if kind != "router" else _domain_arguments(options)
    if fleet.run.mode == "lockstep" and (node in nodes.members or kind in _STEADY_LINKS):
        network.append("--lockstep")
    if "params" in _DEPENDENCIES.get(kind, ("params",)):
        network.append("--await-params")
    if is_script(kind):
        seed = ("--seed", str(fleet.run.seed))
        prefix = ("--frame-prefix", frames) if (frames := stated.service.frame_prefix) else ()
        return ("services.script", *own, *network, *seed, *prefix, kind, *stated.service.args)
    module = ("deploy", "run", kind) if is_user_file(kind) else ("services", kind)
    return (*module, *own, *network)


def _lockstep_environment(stated: PlacedService, fleet: Fleet, nodes: NodeGroups) -> dict[str, str]:
    """Return the environment that a script in lockstep needs from the start; without it, it would restart itself."""
    if fleet.run.mode == "lockstep" and is_script(stated.service.kind) and stated.node in nodes.members:
        return hash_environment(fleet.run.seed)
    return {}


def _network_arguments(fleet: Fleet, options: RunOptions) -> list[str]:
    """Return the options for joining the fleet's network."""
    return ["--connect", fleet_endpoint(fleet), "--topology", fleet.run.topology, *_domain_arguments(options)]


def _domain_arguments(options: RunOptions) -> list[str]:
    return ["--domain", options.domain] if options.domain else []


def _own_arguments(stated: PlacedService, parameters: dict[str, Any]) -> list[str]:
    """Return the options of a node, in its own process or in a container."""
    identity = service_identity(stated.service, stated.robot)
    arguments = ["--namespace", identity.namespace, "--name", identity.node.rpartition("/")[2]]
    for origin, target in stated.service.remap.items():
        arguments += ["--remap", f"{origin}:={target}"]
    for name, value in parameters.items():
        arguments += ["--fleet-param", f"{name}={json.dumps(value)}"]
    return arguments


def _parameters(stated: PlacedService, fleet: Fleet, options: RunOptions, nodes: NodeGroups) -> dict[str, Any]:
    """Return the parameters that a service gets from its fleet and from its own table."""
    kind = stated.service.kind
    return {
        **service_parameters(kind, fleet, options, nodes),
        **arm_parameters(kind, fleet, stated.robot),
        **state_parameters(kind, stated.robot),
        **manager_parameters(kind, stated.robot),
        **_shift_points(stated),
    }


def _shift_points(stated: PlacedService) -> dict[str, Any]:
    """Return the service's own parameters, with points relative to the start, and goals, in its
    robot's odometry frame.
    """
    parameters = dict(stated.service.parameters)
    if stated.robot is not None:
        for name in stated.service.from_start:
            parameters[name] = [_point_in_odometry(stated.robot, x, y) for x, y in parameters[name]]
        start = stated.robot.pose
        for name in stated.service.from_robot:
            parameters[name] = [
                _point_in_odometry(stated.robot, x - start.x, y - start.y) for x, y in stated.robot.goals
            ]
    return parameters


def _point_in_odometry(robot: RobotConfig, x: float, y: float) -> list[float]:
    """Return a point (x, y) [m] from the robot's start, in world axes, in the frame of its odometry."""
    start = robot.pose
    if not odometry_counts_from_start(robot):
        return [x + start.x, y + start.y]
    there = Pose2(yaw=start.yaw).between(Pose2(x, y))
    return [there.x, there.y]
