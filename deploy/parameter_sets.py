"""The sets of parameters of a fleet: who follows them, what the fleet itself gives them, and changes on the way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from deploy.catalogue import declaration
from deploy.fleet import Fleet, Member, Robot
from deploy.fleet_check import identity, members
from deploy.process import Process
from deploy.toml_place import Source
from deploy.wiring import IMPLIED
from messages.names import resolve
from messages.requests import PARAMS_ANNOUNCE
from models.figures import read_model
from services.runtime.errors import BadInput, unknown
from services.runtime.parameters.leaves import flatten, leaves
from services.runtime.parameters.record import build, check_value, read_assignments
from services.runtime.service import Parameters, Service
from services.sim import BaseParameters, JointParameters
from services.sim.base.settings import configured
from services.sim.joints.terms import completed


def parameter_sets(fleet: Fleet) -> dict[str, list[type[Parameters]]]:
    """The sets by name, each with the records of those who follow it."""
    stated = {each.kind for each in fleet.service}
    every: list[tuple[Member, Robot | None]] = [(Member(kind=kind), None) for kind in IMPLIED if kind not in stated]
    every += [(member, owner) for _, member, owner in members(fleet)]
    sets: dict[str, list[type[Parameters]]] = {}
    for member, owner in every:
        service = declaration(member.kind)
        if (name := _set_of(service, identity(member, owner).node)) is not None:
            sets.setdefault(name, []).append(service.parameters)
    for robot in fleet.robot:
        wheeled = read_model(robot.model).wheels is not None
        sets[_of_robot(robot, wheeled)] = [BaseParameters if wheeled else JointParameters]
    return sets


def own_values(fleet: Fleet, plan: Sequence[Process]) -> dict[str, dict[str, Any]]:
    """What the fleet itself and the records' defaults give the live parameters of each set, by dotted names."""
    values: dict[str, dict[str, Any]] = {}
    for process in plan:
        service = declaration(process.kind)
        if (name := _set_of(service, process.node)) is not None:
            options = zip(process.argv, process.argv[1:], strict=False)
            stated = read_assignments(value for option, value in options if option == "--fleet-param")
            values.setdefault(name, {}).update(_live(build(service.parameters, stated)))
    for robot in fleet.robot:
        wheeled = read_model(robot.model).wheels is not None
        made: Parameters = (
            configured(robot.model, build(BaseParameters, robot.parameters)).parameters
            if wheeled
            else completed(robot.model, build(JointParameters, robot.parameters))
        )
        values[_of_robot(robot, wheeled)] = _live(made)
    return values


def check_changes(fleet: Fleet, source: Source) -> None:
    """Raise BadInput, with file and line, for a change that no set of the fleet can take."""
    sets = parameter_sets(fleet) if fleet.change else {}
    for index, change in enumerate(fleet.change):
        if change.set not in sets:
            raise unknown("set of parameters", change.set, sets, source.at("change", index, "set"))
        if not change.values:
            raise BadInput(f"{source.at('change', index)}: a change without values")
        records = sets[change.set]
        for name, value in change.values.items():
            # Of several that share a set, those that know the name decide.
            knowing = [each for each in records if any(leaf.name == name for leaf in leaves(each))]
            for record in knowing or records[:1]:
                check_value(record, name, value, source.at("change", index, "values", name))


def _of_robot(robot: Robot, wheeled: bool) -> str:
    """The set that the simulation follows for a robot: of its base, or of its joints."""
    return f"/{robot.name}/{'base' if wheeled else 'joints'}"


def _set_of(service: Service, node: str) -> str | None:
    """The set that a service follows as ``node``; None without parameters, and for the parameter service."""
    if service.parameters is Parameters or PARAMS_ANNOUNCE in service.serves:
        return None
    return resolve(service.parameter_set or node, node.rpartition("/")[0] or "/", node)


def _live(params: Parameters) -> dict[str, Any]:
    flat = flatten(params)
    each = leaves(type(params))
    return {leaf.name: flat[leaf.name] for leaf in each if leaf.extra("live", True) and not leaf.structured}
