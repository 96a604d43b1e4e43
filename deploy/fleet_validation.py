"""Validates a fleet beyond its types: names exist, are legal and unique, and values are within bounds."""

from __future__ import annotations

from collections.abc import Iterator

from deploy.controller_files import check_controllers
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.report.checks import check_bounds
from deploy.service_parameters import BUILTIN_SERVICES, robot_parameter_set, robot_parameters_type
from messages.names import BadName, Identity, parse_remap
from models import display_name
from models.toml_source import TomlKey, TomlSource
from services.catalog import load_service
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.validation import build
from services.sim.robot_names import check_robot_names, robot_namespace


def validate_fleet(fleet: Fleet, source: TomlSource) -> None:
    """Raise BadInput, with file and line, for the first error."""
    for index in range(len(fleet.robot)):
        _check_robot(fleet, index, source)
    _check_models(fleet, source)
    sets = {robot_parameter_set(robot): robot.name for robot in fleet.robot}
    nodes: dict[str, str] = {}
    for path, member, owner in all_services(fleet):
        _check_member(member, path, owner, source)
        node = service_identity(member, owner, source.location(*path)).node
        if node in nodes:
            raise BadInput(
                f"{source.location(*path)}: a service {node} is already stated at {nodes[node]}: give it a name"
            )
        if node in sets:
            raise BadInput(
                f"{source.location(*path)}: {node} is the parameter set of the robot {sets[node]}: give the service "
                "another name"
            )
        nodes[node] = source.location(*path)
    for name in fleet.bounds:
        check_bounds({name: fleet.bounds[name]}, source.location("bounds", name))
    for mode, bounds in fleet.mode_bounds.items():
        for name in bounds:
            check_bounds({name: bounds[name]}, source.location("bounds", mode, name))
    if fleet.run.ends == "duration" and not fleet.run.duration:
        raise BadInput(f'{source.location("run", "ends")}: ends = "duration" needs a duration [s] above 0')


def service_identity(member: ServiceConfig, owner: RobotConfig | None, where: str = "") -> Identity:
    """Namespace and node of a service; raises BadInput for a name that is none."""
    namespace = member.namespace or (robot_namespace(owner) if owner else "/")
    try:
        return Identity.of(member.name or load_service(member.kind, where).name, namespace)
    except BadName as error:
        raise BadInput(f"{where}: {error}") from None


def all_services(fleet: Fleet) -> Iterator[tuple[tuple[TomlKey, ...], ServiceConfig, RobotConfig | None]]:
    """Every service as it will run: its place in the file and its robot."""
    for index, member in enumerate(fleet.service):
        yield ("service", index), member, None
    for number, robot in enumerate(fleet.robot):
        for index, member in enumerate(robot.services):
            yield ("robot", number, "services", index), member, robot
        for index, member in fleet.shared_services(robot):
            yield ("every_robot", index), member, robot


def _check_robot(fleet: Fleet, index: int, source: TomlSource) -> None:
    robot, path = fleet.robot[index], ("robot", index)
    where = source.location(*path, "name")
    try:
        Identity.of(robot.name)
        check_robot_names(robot, fleet.robot[:index])
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    for name, value in robot.parameters.items():
        build(robot_parameters_type(robot.model), {name: value}, source.location(*path, "parameters", name))


def _check_models(fleet: Fleet, source: TomlSource) -> None:
    """Models are stated for those of every robot alone, and each of them has a robot of them."""
    own = {display_name(robot.model) for robot in fleet.robot}
    for index, member in enumerate(fleet.every_robot):
        for name in member.models:
            if name not in own:
                raise unknown_name("model", name, own, source.location("every_robot", index, "models"))
    for path, member, _ in all_services(fleet):
        if member.models and path[0] != "every_robot":
            raise BadInput(f"{source.location(*path, 'models')}: models is only for [[every_robot]]")


def _check_member(
    member: ServiceConfig, path: tuple[TomlKey, ...], owner: RobotConfig | None, source: TomlSource
) -> None:
    record = load_service(member.kind, source.location(*path, "kind")).parameters
    for name, value in member.parameters.items():
        build(record, {name: value}, source.location(*path, "parameters", name))
    check_controllers(member, path, owner, source)
    for name in member.from_start:
        place = source.location(*path, "from_start")
        if owner is None:
            raise BadInput(f"{place}: from_start needs a robot: state the service under a robot or as [[every_robot]]")
        if not _is_points(member.parameters.get(name)):
            raise BadInput(f"{place}: {name} is not stated as a list of points [x, y]")
    for origin, target in member.remap.items():
        try:
            parse_remap(f"{origin}:={target}")
        except BadName as error:
            raise BadInput(f"{source.location(*path, 'remap', origin)}: {error}") from None
    if owner is None and member.kind in BUILTIN_SERVICES and (member.name or member.namespace):
        raise BadInput(f"{source.location(*path)}: the {member.kind} cannot be renamed: the fleet relies on its name")


def _is_points(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, list) and len(each) == 2 for each in value)
