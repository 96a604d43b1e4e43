"""What a fleet file must hold beyond its types: names that exist, are legal and differ, and values within bounds."""

from __future__ import annotations

from collections.abc import Iterator

from deploy.catalogue import declaration
from deploy.fleet import Fleet, Member, Robot
from deploy.report.bounds import check_bounds
from deploy.toml_place import Source, Step
from deploy.wiring import IMPLIED, parameters_of
from messages.names import BadName, Identity, identify, parse_remap
from models import MODELS
from services.runtime.errors import BadInput, unknown
from services.runtime.parameters.record import build


def check(fleet: Fleet, source: Source) -> None:
    """Raise BadInput, with file and line, for the first thing that cannot be run."""
    robots: set[str] = set()
    for index, robot in enumerate(fleet.robot):
        _check_robot(robot, ("robot", index), robots, source)
    _check_models(fleet, source)
    nodes: dict[str, str] = {}
    for path, member, owner in members(fleet):
        _check_member(member, path, owner, source)
        node = identity(member, owner, source.at(*path)).node
        if node in nodes:
            raise BadInput(f"{source.at(*path)}: a service {node} is already stated at {nodes[node]}: give it a name")
        nodes[node] = source.at(*path)
    for name in fleet.bounds:
        check_bounds({name: fleet.bounds[name]}, source.at("bounds", name))
    for mode, bounds in fleet.mode_bounds.items():
        for name in bounds:
            check_bounds({name: bounds[name]}, source.at("bounds", mode, name))
    if fleet.run.ends == "duration" and not fleet.run.duration:
        raise BadInput(f'{source.at("run", "ends")}: ends = "duration" needs a duration [s] above 0')


def identity(member: Member, owner: Robot | None, where: str = "") -> Identity:
    """Namespace and node of a service; raises BadInput for a name that is none."""
    namespace = member.namespace or (f"/{owner.name}" if owner else "/")
    try:
        return identify(member.name or declaration(member.kind, where).name, namespace, ())
    except BadName as error:
        raise BadInput(f"{where}: {error}") from None


def members(fleet: Fleet) -> Iterator[tuple[tuple[Step, ...], Member, Robot | None]]:
    """Every service as it will run: its place in the file and its robot."""
    for index, member in enumerate(fleet.service):
        yield ("service", index), member, None
    for number, robot in enumerate(fleet.robot):
        for index, member in enumerate(robot.services):
            yield ("robot", number, "services", index), member, robot
        for index, member in fleet.shared(robot):
            yield ("every_robot", index), member, robot


def _check_robot(robot: Robot, path: tuple[Step, ...], names: set[str], source: Source) -> None:
    where = source.at(*path, "name")
    try:
        if identify(robot.name, "/", ()).node in names:
            raise BadInput(f"{where}: there is already a robot {robot.name!r}: each has a name of its own")
    except BadName as error:
        raise BadInput(f"{where}: {error}") from None
    names.add(f"/{robot.name}")
    if robot.model not in MODELS:
        raise unknown("model", robot.model, MODELS, source.at(*path, "model"))
    for name, value in robot.parameters.items():
        build(parameters_of(robot.model), {name: value}, source.at(*path, "parameters", name))


def _check_models(fleet: Fleet, source: Source) -> None:
    """Models are stated for those of every robot alone, and each of them has a robot of them."""
    own = {robot.model for robot in fleet.robot}
    for index, member in enumerate(fleet.every_robot):
        for name in member.models:
            if name not in own:
                raise unknown("model", name, own, source.at("every_robot", index, "models"))
    for path, member, _ in members(fleet):
        if member.models and path[0] != "every_robot":
            raise BadInput(f"{source.at(*path, 'models')}: models is for [[every_robot]] alone")


def _check_member(member: Member, path: tuple[Step, ...], owner: Robot | None, source: Source) -> None:
    record = declaration(member.kind, source.at(*path, "kind")).parameters
    for name, value in member.parameters.items():
        build(record, {name: value}, source.at(*path, "parameters", name))
    for name in member.from_start:
        place = source.at(*path, "from_start")
        if owner is None:
            raise BadInput(f"{place}: from_start needs a robot: state the service under a robot or as [[every_robot]]")
        if not _is_points(member.parameters.get(name)):
            raise BadInput(f"{place}: {name} is not stated as a list of points [x, y]")
    for origin, target in member.remap.items():
        try:
            parse_remap(f"{origin}:={target}")
        except BadName as error:
            raise BadInput(f"{source.at(*path, 'remap', origin)}: {error}") from None
    if owner is None and member.kind in IMPLIED and (member.name or member.namespace):
        raise BadInput(f"{source.at(*path)}: the {member.kind} keeps its name: every part of a fleet looks for it")


def _is_points(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, list) and len(each) == 2 for each in value)
