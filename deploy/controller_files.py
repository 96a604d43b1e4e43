"""Controller files named by a fleet: resolved against the fleet file's folder, and checked against
the robot's joints.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from deploy.fleet import RobotConfig, ServiceConfig
from models.model import read_model
from models.toml_source import TomlKey, TomlSource
from models.urdf import read_joint_limits
from services.controller_manager.config import ManagerConfig
from services.controller_manager.config_file import is_text, load_config
from services.controller_manager.joint_pid import PidParameters
from services.runtime.errors import BadInput, unknown_name
from services.sim.robot_names import robot_namespace

KIND = "controller_manager"


FILE_PARAMETERS = {KIND: "config", "map_server": "map"}
"""The parameter that is a file path, by kind of service."""


def with_file_found(member: ServiceConfig, folder: Path) -> ServiceConfig:
    """Resolve the service's file, if its kind has one, relative to ``folder``, that of the fleet file."""
    name = FILE_PARAMETERS.get(member.kind, "")
    path = member.parameters.get(name)
    if not isinstance(path, str) or not path or (member.kind == KIND and is_text(path)):
        return member
    return replace(member, parameters={**member.parameters, name: str((folder / os.path.expanduser(path)).resolve())})


def manager_parameters(kind: str, robot: RobotConfig | None) -> dict[str, Any]:
    """Return the parameters that a controller manager gets from its robot."""
    return {"robot": robot.name} if kind == KIND and robot is not None else {}


def joint_state_rate(members: Iterable[ServiceConfig], robot: RobotConfig) -> float:
    """Return the highest rate [Hz] of joint states that a robot's controller managers ask for; 0 without any."""
    return max((_read(each, robot).joint_state_rate for each in members if each.kind == KIND), default=0.0)


def manager_rate(member: ServiceConfig, robot: RobotConfig | None) -> float:
    """Return the control rate [Hz] of a controller manager, before lockstep rounds its period to
    whole physics steps.
    """
    return float(member.parameters.get("update_rate", 0) or _read(member, robot).update_rate)


def gain_values(member: ServiceConfig, owner: RobotConfig | None) -> dict[str, PidParameters]:
    """Return the gain sets that a controller manager announces, with the values of its file; empty
    for other services.
    """
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
    chosen = member.parameters.get("controllers", ())
    return load_config(member.parameters["config"], _namespace(member, owner), chosen)


def check_controllers(
    member: ServiceConfig, path: tuple[TomlKey, ...], owner: RobotConfig | None, source: TomlSource
) -> None:
    """Check the file of a controller manager; raises BadInput with the lines of both files."""
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
