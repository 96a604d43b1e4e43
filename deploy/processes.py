"""The processes that a fleet needs, as data: what to run, in which order, and what their end means."""

from __future__ import annotations

import json
import sys
from typing import Any

import msgspec

from deploy.controller_files import manager_parameters
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.fleet_validation import service_identity
from deploy.restart_policy import RestartMode, RestartPolicy
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
from services.catalog import is_user_file, load_service

_RESTART_MODES: dict[str, RestartMode] = {"router": "always", "grader": "never"}
"""Restart policies by kind: a router never finishes, and a restarted grader has lost its measurements."""


SUPERVISOR = "/supervisor"
"""The supervisor's node."""

_NOT_AWAITED = ("router", "sim")
"""Services that time does not wait for: the router starts first, and the simulation is the one that waits."""

_DEPENDENCIES = {"router": (), "params": ("router",), "sim": ("router", "params")}
"""Services that must be ready before; all others need the simulation, and through it the router and the parameters."""


class ProcessSpec(msgspec.Struct, frozen=True, kw_only=True):
    """One process. The fleet ends with a ``required`` one; ``depends_on`` names those that must be ready before.

    Simulation time begins when every ``awaited`` process is ready: the sim and those that it waits for.
    """

    name: str
    node: str
    kind: str
    argv: tuple[str, ...]
    required: bool = False
    awaited: bool = False
    policy: RestartPolicy = RestartPolicy()
    depends_on: tuple[str, ...] = ()


class _PlacedService(msgspec.Struct, frozen=True):
    service: ServiceConfig
    robot: RobotConfig | None

    @property
    def node(self) -> str:
        return service_identity(self.service, self.robot).node

    @property
    def required(self) -> bool:
        return self.service.required if self.service.required is not None else self.service.kind in BUILTIN_SERVICES


def plan_processes(fleet: Fleet, options: RunOptions) -> tuple[ProcessSpec, ...]:
    """Every process of the fleet, those first that others depend on: router, parameters, simulation, then the rest."""
    stated = _place_services(fleet)
    taking_part = [each for each in stated if each.service.kind not in OBSERVER_SERVICES]
    awaited = [each for each in taking_part if each.service.kind not in _NOT_AWAITED]
    nodes = NodeGroups(
        members=tuple(
            each.node for each in stated if fleet.run.mode == "lockstep" and _is_lockstep_member(each.service.kind)
        ),
        awaits=tuple(each.node for each in awaited),
        requires=tuple(each.node for each in awaited if each.required),
        readers=(SUPERVISOR, *(each.node for each in taking_part)),
    )
    return tuple(_process_spec(each, fleet, options, nodes) for each in stated)


def _place_services(fleet: Fleet) -> list[_PlacedService]:
    own = {each.kind: each for each in fleet.service if each.kind in BUILTIN_SERVICES}
    stated = [_PlacedService(own.get(kind, ServiceConfig(kind=kind)), None) for kind in BUILTIN_SERVICES]
    stated += [_PlacedService(each, None) for each in fleet.service if each.kind not in BUILTIN_SERVICES]
    for robot in fleet.robot:
        stated += [_PlacedService(each, robot) for each in robot.services]
        stated += [_PlacedService(each, robot) for _, each in fleet.shared_services(robot)]
    return stated


def _is_lockstep_member(kind: str) -> bool:
    """Whether lockstep waits for services of this kind at each tick."""
    return load_service(kind).steps


def _process_spec(stated: _PlacedService, fleet: Fleet, options: RunOptions, nodes: NodeGroups) -> ProcessSpec:
    member, kind = stated.service, stated.service.kind
    told = {
        **service_parameters(kind, fleet, options, nodes),
        **arm_parameters(kind, fleet, stated.robot),
        **state_parameters(kind, stated.robot),
        **manager_parameters(kind, stated.robot),
    }
    parameters = {**told, **_shift_points(stated)}
    match member.restart:
        case None:
            policy = RestartPolicy(when=_RESTART_MODES.get(kind, "on-failure"))
        case RestartPolicy() as policy:
            pass
        case when:
            policy = RestartPolicy(when=when)
    return ProcessSpec(
        name=stated.node.removeprefix("/"),
        node=stated.node,
        kind=kind,
        argv=(sys.executable, "-P", "-m", *_module(kind), *_arguments(stated, fleet, options, nodes, parameters)),
        required=stated.required,
        awaited=kind == "sim" or stated.node in nodes.awaits,
        policy=policy,
        depends_on=_DEPENDENCIES.get(kind, ("router", "sim")),
    )


def _module(kind: str) -> tuple[str, ...]:
    """Python's arguments; a user's file runs as in ``./elea run``, with its folder on the path."""
    return ("deploy", "run", kind) if is_user_file(kind) else ("services", kind)


def _arguments(
    stated: _PlacedService, fleet: Fleet, options: RunOptions, nodes: NodeGroups, parameters: dict[str, Any]
) -> list[str]:
    member = stated.service
    identity = service_identity(member, stated.robot)
    arguments = ["--namespace", identity.namespace, "--name", identity.node.rpartition("/")[2]]
    if member.kind != "router":
        arguments += ["--connect", fleet_endpoint(fleet), "--topology", fleet.run.topology]
    if options.domain:
        arguments += ["--domain", options.domain]
    if fleet.run.mode == "lockstep" and (identity.node in nodes.members or member.kind == "sim"):
        arguments.append("--lockstep")
    if "params" in _DEPENDENCIES.get(member.kind, ("params",)):
        arguments.append("--await-params")
    for origin, target in member.remap.items():
        arguments += ["--remap", f"{origin}:={target}"]
    for name, value in parameters.items():
        arguments += ["--fleet-param", f"{name}={json.dumps(value)}"]
    return arguments


def _shift_points(stated: _PlacedService) -> dict[str, Any]:
    """The service's own parameters, with points counted from the robot's start put into the frame of its odometry."""
    parameters = dict(stated.service.parameters)
    if stated.robot is not None:
        for name in stated.service.from_start:
            parameters[name] = [_point_in_odometry(stated.robot, x, y) for x, y in parameters[name]]
    return parameters


def _point_in_odometry(robot: RobotConfig, x: float, y: float) -> list[float]:
    """A point that lies (x, y) [m] from the robot's start in the axes of the world, as its odometry has it."""
    start = robot.pose
    if not odometry_counts_from_start(robot):
        return [x + start.x, y + start.y]
    there = Pose2(yaw=start.yaw).between(Pose2(x, y))
    return [there.x, there.y]
