"""Validates a fleet beyond its types: names are known, legal and unique, and values within bounds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from deploy.controller_files import check_controllers
from deploy.fleet import Fleet, RobotConfig, ServiceConfig
from deploy.report.checks import check_bounds
from deploy.rosparam_tree import parameter_tree
from deploy.service_parameters import (
    BUILTIN_SERVICES,
    reference_topic,
    referred_joint,
    robot_parameter_set,
    robot_parameters_type,
)
from messages.names import BadName, Identity, parse_remap, validate
from models import display_name
from models.toml_source import TomlKey, TomlSource
from services.catalog import is_script, load_service
from services.runtime.errors import BadInput, unknown_name
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.validation import build
from services.sim.engines import check_engine
from services.sim.joints.config import check_positions
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
        builtin = node.removeprefix("/")
        if builtin in (*BUILTIN_SERVICES, "supervisor") and member.kind != builtin:
            raise BadInput(f"{source.location(*path)}: every fleet has a node {node}: give the service another name")
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
    for name, value in fleet.rosparam.items():
        parameter_tree({name: value}, source.location("rosparam", name))
    if fleet.run.engine:
        check_engine(fleet.run.engine, source.location("run", "engine"))
    if fleet.run.ends == "duration" and not fleet.run.duration:
        raise BadInput(f'{source.location("run", "ends")}: ends = "duration" needs a duration [s] above 0')


def service_identity(member: ServiceConfig, owner: RobotConfig | None, where: str = "") -> Identity:
    """Return namespace and node of a service; raises BadInput for an invalid name."""
    namespace = member.namespace or (robot_namespace(owner) if owner else "/")
    try:
        return Identity.of(member.name or load_service(member.kind, where).name, namespace)
    except BadName as error:
        raise BadInput(f"{where}: {error}") from None


def all_services(fleet: Fleet) -> Iterator[tuple[tuple[TomlKey, ...], ServiceConfig, RobotConfig | None]]:
    """Yield every service as it will run, with its path in the file and its robot."""
    for index, member in enumerate(fleet.service):
        yield ("service", index), member, None
    for number, robot in enumerate(fleet.robot):
        for index, member in enumerate(robot.services):
            yield ("robot", number, "services", index), member, robot
        for index, member in fleet.shared_services(robot):
            yield ("every_robot", index), member, robot


def _check_robot(fleet: Fleet, index: int, source: TomlSource) -> None:
    robot, path = fleet.robot[index], ("robot", index)
    if robot.reference is not None:
        try:
            validate(reference_topic(robot, robot.reference))
            referred_joint(robot, robot.reference)
        except (BadInput, BadName) as error:
            raise BadInput(f"{source.location(*path, 'reference')}: {error}") from None
    where = source.location(*path, "name")
    try:
        Identity.of(robot.name)
        check_robot_names(robot, fleet.robot[:index])
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    for name, position in robot.joints.items():
        try:
            check_positions(robot.model, {name: position})
        except BadInput as error:
            raise BadInput(f"{source.location(*path, 'joints', name)}: {error}") from None
    for name, value in robot.parameters.items():
        build(robot_parameters_type(robot.model), {name: value}, source.location(*path, "parameters", name))


def _check_models(fleet: Fleet, source: TomlSource) -> None:
    """Raise BadInput if ``models`` is stated outside ``[[every_robot]]``, or names a model that no robot has."""
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
    if is_script(member.kind):
        _check_script(member, path, source)
    elif name := next((each for each in ("args", "environment", "cwd", "frame_prefix") if getattr(member, each)), ""):
        raise BadInput(f"{source.location(*path, name)}: {name} is for programs of ROS alone; a service has parameters")
    for name, value in () if is_script(member.kind) else member.parameters.items():
        build(record, {name: value}, source.location(*path, "parameters", name))
    check_controllers(member, path, owner, source)
    for name in member.from_start:
        place = source.location(*path, "from_start")
        if owner is None:
            raise BadInput(f"{place}: from_start needs a robot: state the service under a robot or as [[every_robot]]")
        if not _is_points(member.parameters.get(name)):
            raise BadInput(f"{place}: {name} is not stated as a list of points [x, y]")
    for name in member.from_robot:
        _check_from_robot(name, member, record, owner, source.location(*path, "from_robot"))
    for origin, target in member.remap.items():
        try:
            parse_remap(f"{origin}:={target}")
        except BadName as error:
            raise BadInput(f"{source.location(*path, 'remap', origin)}: {error}") from None
    if owner is None and member.kind in BUILTIN_SERVICES and (member.name or member.namespace):
        raise BadInput(f"{source.location(*path)}: the {member.kind} cannot be renamed: the fleet relies on its name")


def _check_from_robot(
    name: str, member: ServiceConfig, record: type[Parameters], owner: RobotConfig | None, place: str
) -> None:
    if owner is None:
        raise BadInput(f"{place}: from_robot needs a robot: state the service under a robot or as [[every_robot]]")
    if not owner.goals:
        raise BadInput(
            f"{place}: the robot {owner.name} has no goals: state its goals, or a rule for those of its grid"
        )
    if name in member.parameters:
        raise BadInput(f"{place}: {name} is stated among the parameters, too: leave it out of one of them")
    build(record, {name: [list(each) for each in owner.goals]}, place)


def _check_script(member: ServiceConfig, path: tuple[TomlKey, ...], source: TomlSource) -> None:
    for name in ("from_start", "from_robot"):
        if getattr(member, name):
            raise BadInput(f"{source.location(*path, name)}: {name} is for services, not for programs of ROS")
    for name in member.environment:
        if not name or "=" in name or "\0" in name:
            raise BadInput(f"{source.location(*path, 'environment')}: {name!r} is not a valid variable name")
    if member.cwd and not Path(member.cwd).is_dir():
        raise BadInput(f"{source.location(*path, 'cwd')}: there is no folder {member.cwd}")
    for name, value in member.parameters.items():
        parameter_tree({name: value}, source.location(*path, "parameters", name))


def _is_points(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, list) and len(each) == 2 for each in value)
