"""The files of controllers that a fleet names: found beside the fleet file, and checked against the robot's joints."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from deploy.fleet import RobotConfig, ServiceConfig
from models.model import read_model
from models.toml_source import TomlKey, TomlSource
from models.urdf import read_joint_limits
from services.controller_manager.config import ManagerConfig
from services.controller_manager.config_file import read_config
from services.controller_manager.joint_pid import PidParameters
from services.runtime.errors import BadInput, unknown_name
from services.sim.robot_names import robot_namespace

KIND = "controller_manager"


def with_controllers_found(member: ServiceConfig, folder: Path) -> ServiceConfig:
    """A controller manager with its file counted from the ``folder`` of the fleet file; any other service as it is."""
    config = member.parameters.get("config")
    if member.kind != KIND or not isinstance(config, str) or not config:
        return member
    return replace(member, parameters={**member.parameters, "config": str((folder / config).resolve())})


def manager_parameters(kind: str, robot: RobotConfig | None) -> dict[str, Any]:
    """The parameters that a controller manager gets from its robot."""
    return {"robot": robot.name} if kind == KIND and robot is not None else {}


def joint_state_rate(members: Iterable[ServiceConfig], robot: RobotConfig) -> float:
    """The rate [Hz] of joint states that a controller manager among the services of a robot asks for; 0 for none."""
    return max((_read(each, robot).joint_state_rate for each in members if each.kind == KIND), default=0.0)


def gain_values(member: ServiceConfig, owner: RobotConfig | None) -> dict[str, PidParameters]:
    """The sets of gains that a controller manager announces, with the values of its file; none of another service."""
    if member.kind != KIND:
        return {}
    namespace = _namespace(member, owner)
    return {
        f"{namespace.rstrip('/')}/{name}": PidParameters.of(gains)
        for name, gains in _read(member, owner).gain_sets.items()
    }


def _namespace(member: ServiceConfig, owner: RobotConfig | None) -> str:
    return member.namespace or (robot_namespace(owner) if owner is not None else "/")


def _read(member: ServiceConfig, owner: RobotConfig | None) -> ManagerConfig:
    path, chosen = Path(member.parameters["config"]), member.parameters.get("controllers", ())
    return read_config(path, _namespace(member, owner), chosen)


def check_controllers(
    member: ServiceConfig, path: tuple[TomlKey, ...], owner: RobotConfig | None, source: TomlSource
) -> None:
    """Read the file of a controller manager; raises BadInput with the lines of both files."""
    if member.kind != KIND:
        return
    here = source.location(*path)
    if owner is None and not (member.namespace and member.parameters.get("robot")):
        raise BadInput(
            f"{here}: a {KIND} is for one robot: state it under that robot, or give it its "
            'namespace and parameters = { robot = "NAME" }'
        )
    if not member.parameters.get("config"):
        raise BadInput(
            f'{here}: a {KIND} needs parameters = {{ config = "controllers.yaml" }}, the file of its controllers'
        )
    where = source.location(*path, "parameters", "config")
    try:
        config = _read(member, owner)
        if owner is not None:
            config.check_joints(read_joint_limits(owner.model))
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    wheels = read_model(owner.model).wheels if owner is not None else None
    for joint in (wheels.left_joint, wheels.right_joint) if wheels is not None else ():
        if joint in config.joints:
            controller, place = config.joints[joint]
            raise BadInput(f"{where}: {place}: {controller}: {joint} is a wheel, which the base drives by cmd_vel")
    known = [each.name for each in config.controllers]
    for name in member.parameters.get("controllers", ()):
        if name not in known:
            raise unknown_name("controller", name, known, source.location(*path, "parameters", "controllers"))
