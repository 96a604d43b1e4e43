"""The parameter sets of a fleet: their services, the values that the fleet gives, and how a run deviated from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from deploy.controller_files import gain_values
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.fleet_validation import all_services, service_identity
from deploy.processes import ProcessSpec
from deploy.report.record import EffectiveParameter
from deploy.service_parameters import BUILTIN_SERVICES, robot_parameter_set
from messages.names import resolve
from messages.parameters import Parameter, ParameterValues
from models.model import read_model
from models.toml_source import TomlSource
from services.catalog import is_script, load_service
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import fields_of, flatten
from services.runtime.parameters.validation import build, check_value, read_assignments
from services.runtime.service import Service
from services.sim.drive.config import robot_config
from services.sim.joints.config import with_urdf_defaults
from services.sim.parameters import BaseParameters, JointParameters


def parameter_sets(fleet: Fleet) -> dict[str, list[type[Parameters]]]:
    """Return the sets by name, each with the parameter records of the services that use it."""
    stated = {each.kind for each in fleet.service}
    every: list[tuple[ServiceConfig, RobotConfig | None]] = [
        (ServiceConfig(kind=kind), None) for kind in BUILTIN_SERVICES if kind not in stated
    ]
    every += [(member, owner) for _, member, owner in all_services(fleet)]
    sets: dict[str, list[type[Parameters]]] = {}
    for member, owner in every:
        service = load_service(member.kind)
        if (name := _service_set(service, service_identity(member, owner).node)) is not None:
            sets.setdefault(name, []).append(service.parameters)
        sets |= {gains: [type(values)] for gains, values in gain_values(member, owner).items()}
    for robot in fleet.robot:
        wheeled = read_model(robot.model).has_base
        sets[robot_parameter_set(robot)] = [BaseParameters if wheeled else JointParameters]
    return sets


def fleet_values(fleet: Fleet, plan: Sequence[ProcessSpec]) -> dict[str, dict[str, Any]]:
    """Return the live parameters of each set by dotted name, from the fleet file and the defaults only."""
    values: dict[str, dict[str, Any]] = {}
    for node in (each for process in plan for each in process.nodes):
        service = load_service(node.kind)
        if (name := _service_set(service, node.name)) is not None:
            options = pairwise(node.arguments)
            stated = read_assignments(value for option, value in options if option == "--fleet-param")
            values.setdefault(name, {}).update(_live_values(build(service.parameters, stated)))
    for robot in fleet.robot:
        wheeled = read_model(robot.model).has_base
        made: Parameters = (
            robot_config(robot.model, build(BaseParameters, robot.parameters)).parameters
            if wheeled
            else with_urdf_defaults(robot.model, build(JointParameters, robot.parameters))
        )
        values[robot_parameter_set(robot)] = _live_values(made)
    for _, member, owner in all_services(fleet):
        values |= {name: _live_values(gains) for name, gains in gain_values(member, owner).items()}
    return values


def check_changes(fleet: Fleet, source: TomlSource) -> None:
    """Raise BadInput, with file and line, for a scheduled change that no set of the fleet can accept.

    The sets of a ROS script are known only once it announces them.
    """
    sets = parameter_sets(fleet) if fleet.change else {}
    scripts = _script_nodes(fleet) if fleet.change else []
    for index, change in enumerate(fleet.change):
        if not change.values:
            raise BadInput(f"{source.location('change', index)}: a change without values")
        if any(change.set == node or change.set.startswith(f"{node}/") for node in scripts):
            continue
        if change.set not in sets:
            where = source.location("change", index, "set")
            raise unknown_name("set of parameters", change.set, (*sets, *scripts), where)
        records = sets[change.set]
        for name, value in change.values.items():
            # Of several records that share a set, those that have the name decide.
            knowing = [each for each in records if any(leaf.name == name for leaf in fields_of(each))]
            for record in knowing or records[:1]:
                check_value(record, name, value, source.location("change", index, "values", name))


def _script_nodes(fleet: Fleet) -> list[str]:
    """Return the nodes of ROS scripts, each of which may serve dynamic_reconfigure."""
    return [service_identity(member, owner).node for _, member, owner in all_services(fleet) if is_script(member.kind)]


def _service_set(service: Service, node: str) -> str | None:
    """Return the set that a service uses as ``node``; None without parameters, and for the parameter service."""
    if service.parameters is Parameters or service.parameter_set is None:
        return None
    return resolve(service.parameter_set or node, node.rpartition("/")[0] or "/", node)


def _live_values(params: Parameters) -> dict[str, Any]:
    flat = flatten(params)
    each = fields_of(type(params))
    return {leaf.name: flat[leaf.name] for leaf in each if leaf.extra("live", True) and not leaf.structured}


ReportedValues = Callable[[], Mapping[str, ParameterValues]]
"""Returns the values of each set received so far; does not block."""

FleetValues = Mapping[str, Mapping[str, Any]]
"""The values of each set's live parameters from the fleet file and the defaults only."""


class SavedParameterNotes:
    """Reports once per set which saved values override the fleet's."""

    def __init__(self, received: ReportedValues, own: FleetValues) -> None:
        self._received, self._own = received, own
        self._reported: set[str] = set()

    def new_lines(self) -> Iterator[str]:
        """Yield a line for each newly received set that has such values."""
        for name, values in self._received().items():
            if name in self._reported:
                continue
            self._reported.add(name)
            own = self._own.get(name, {})
            if parts := [
                _difference(each, own) for each in values.values if each.origin == "saved" and _differs(each, own)
            ]:
                yield f"saved parameters override the fleet file: {name} {', '.join(parts)}; --no-saved ignores them"


def effective_parameters(
    received: Mapping[str, ParameterValues], own: FleetValues
) -> dict[str, dict[str, EffectiveParameter]]:
    """Return the live parameters whose origin is not their default, by set and name, sorted."""
    found = {
        name: {
            each.name: EffectiveParameter(value=each.value, origin=each.origin)
            for each in values.values
            if each.origin != "default" and each.name in own.get(name, {})
        }
        for name, values in sorted(received.items())
    }
    return {name: parameters for name, parameters in found.items() if parameters}


def overridden_parameter_note(
    received: Mapping[str, ParameterValues], own: FleetValues, fleet: Fleet
) -> tuple[str, ...]:
    """Return one note with the values that differ from the fleet file's, or none if no value does."""
    scheduled = {(change.set, name) for change in fleet.change for name in change.values}
    parts = [
        f"{name} {_difference(each, own[name])}"
        for name, values in sorted(received.items())
        for each in values.values
        if each.origin in ("saved", "command line", "run")
        and (name, each.name) not in scheduled
        and _differs(each, own.get(name, {}))
    ]
    if not parts:
        return ()
    return (
        f"Parameters differed from the fleet file: {', '.join(parts)}. Only a run with the same values repeats "
        "this one; ./elea up --no-saved ignores saved values.",
    )


def _differs(each: Parameter, own: Mapping[str, Any]) -> bool:
    return each.name in own and own[each.name] != each.value


def _difference(each: Parameter, own: Mapping[str, Any]) -> str:
    return f"{each.name} = {each.value} ({each.origin}; the fleet's is {own[each.name]})"
