"""The processes that a fleet needs, as data: what to run, in which order, and what their end means."""

from __future__ import annotations

import json
import sys
from typing import Any

import msgspec

from deploy.arm_wiring import arm_wired
from deploy.catalogue import declaration
from deploy.fleet import Fleet, Member, Robot
from deploy.fleet_check import identity
from deploy.own_service import is_own
from deploy.policy import Policy, When
from deploy.wiring import IMPLIED, ONLOOKERS, Nodes, Terms, endpoint, wired

_RESTART: dict[str, When] = {"router": "always", "grader": "never"}
"""A router has no work that could be done; a grader that comes back has lost what it measured."""


SUPERVISOR = "/supervisor"
"""The node of who starts them all."""

_BEFORE = ("router", "sim")
"""Services that time does not wait for: the first carries what the others tell, the second is who waits."""

_NEEDS = {"router": (), "params": ("router",), "sim": ("router", "params")}
"""What must be ready before; everything else needs router and simulation, and by them the parameters."""


class Process(msgspec.Struct, frozen=True, kw_only=True):
    """One process. The fleet ends with a ``required`` one; ``depends_on`` names those that must be ready before.

    Simulation time begins when every process that ``begins`` it is ready: the sim and those that it waits for.
    """

    name: str
    node: str
    kind: str
    argv: tuple[str, ...]
    required: bool = False
    begins: bool = False
    policy: Policy = Policy()
    depends_on: tuple[str, ...] = ()


class _Stated(msgspec.Struct, frozen=True):
    member: Member
    robot: Robot | None

    @property
    def node(self) -> str:
        return identity(self.member, self.robot).node

    @property
    def required(self) -> bool:
        return self.member.required if self.member.required is not None else self.member.kind in IMPLIED


def processes(fleet: Fleet, terms: Terms) -> tuple[Process, ...]:
    """Every process of the fleet, those first that others depend on: router, parameters, simulation, then the rest."""
    stated = _stated(fleet)
    taking_part = [each for each in stated if each.member.kind not in ONLOOKERS]
    awaited = [each for each in taking_part if each.member.kind not in _BEFORE]
    nodes = Nodes(
        members=tuple(each.node for each in stated if fleet.run.mode == "lockstep" and _steps(each.member.kind)),
        awaits=tuple(each.node for each in awaited),
        requires=tuple(each.node for each in awaited if each.required),
        readers=(SUPERVISOR, *(each.node for each in taking_part)),
    )
    return tuple(_process(each, fleet, terms, nodes) for each in stated)


def _stated(fleet: Fleet) -> list[_Stated]:
    own = {each.kind: each for each in fleet.service if each.kind in IMPLIED}
    stated = [_Stated(own.get(kind, Member(kind=kind)), None) for kind in IMPLIED]
    stated += [_Stated(each, None) for each in fleet.service if each.kind not in IMPLIED]
    for robot in fleet.robot:
        stated += [_Stated(each, robot) for each in robot.services]
        stated += [_Stated(each, robot) for _, each in fleet.shared(robot)]
    return stated


def _steps(kind: str) -> bool:
    """Whether lockstep waits for services of this kind at each tick."""
    service = declaration(kind)
    return service.holds_lockstep and service.rate is not None


def _process(stated: _Stated, fleet: Fleet, terms: Terms, nodes: Nodes) -> Process:
    member, kind = stated.member, stated.member.kind
    told = {**wired(kind, fleet, terms, nodes), **arm_wired(kind, fleet, stated.robot)}
    parameters = {**told, **_shifted(stated)}
    match member.restart:
        case None:
            policy = Policy(when=_RESTART.get(kind, "on-failure"))
        case Policy() as policy:
            pass
        case when:
            policy = Policy(when=when)
    return Process(
        name=stated.node.removeprefix("/"),
        node=stated.node,
        kind=kind,
        argv=(sys.executable, "-P", "-m", *_module(kind), *_arguments(stated, fleet, terms, nodes, parameters)),
        required=stated.required,
        begins=kind == "sim" or stated.node in nodes.awaits,
        policy=policy,
        depends_on=_NEEDS.get(kind, ("router", "sim")),
    )


def _module(kind: str) -> tuple[str, ...]:
    """What Python runs; a file of the user's own runs as in ``./elea run``, with its folder on the path."""
    return ("deploy", "run", kind) if is_own(kind) else (f"services.{kind}",)


def _arguments(stated: _Stated, fleet: Fleet, terms: Terms, nodes: Nodes, parameters: dict[str, Any]) -> list[str]:
    member = stated.member
    namespace, node = identity(member, stated.robot)
    arguments = ["--namespace", namespace, "--name", node.rpartition("/")[2]]
    if member.kind != "router":
        arguments += ["--connect", endpoint(fleet), "--topology", fleet.run.topology]
    if terms.domain:
        arguments += ["--domain", terms.domain]
    if fleet.run.mode == "lockstep" and (node in nodes.members or member.kind == "sim"):
        arguments.append("--lockstep")
    if "params" in _NEEDS.get(member.kind, ("params",)):
        arguments.append("--await-params")
    for origin, target in member.remap.items():
        arguments += ["--remap", f"{origin}:={target}"]
    for name, value in parameters.items():
        arguments += ["--fleet-param", f"{name}={json.dumps(value)}"]
    return arguments


def _shifted(stated: _Stated) -> dict[str, Any]:
    """The service's own parameters, with the points counted from the robot's start put there."""
    parameters = dict(stated.member.parameters)
    if stated.robot is not None:
        start = stated.robot.pose
        for name in stated.member.from_start:
            parameters[name] = [[x + start.x, y + start.y] for x, y in parameters[name]]
    return parameters
