"""The initial tree of ROS 1 parameters of a fleet: its table ``[rosparam]`` and the private ones of scripts."""

from __future__ import annotations

import json
from pathlib import Path

from deploy.fleet import Fleet
from deploy.fleet_validation import all_services, service_identity
from deploy.rosparam_tree import Tree, get_parameter, parameter_tree, set_parameter
from messages.names import join
from models import urdf_path
from services.catalog import is_script
from services.runtime.atomic_file import write_atomic
from services.sim.robot_names import robot_namespace

DESCRIPTION = "robot_description"


def fleet_parameter_tree(fleet: Fleet) -> Tree:
    """Return the whole tree: the robots' descriptions in their namespaces, ``[rosparam]``, and each script's
    ``parameters``, which are private to its node and override the others.
    """
    tree: Tree = {}
    for robot in fleet.robot:
        set_parameter(
            tree, join(robot_namespace(robot), DESCRIPTION), urdf_path(robot.model).read_text(encoding="utf-8")
        )
        if len(fleet.robot) == 1:
            tree.setdefault(DESCRIPTION, get_parameter(tree, join(robot_namespace(robot), DESCRIPTION)))
    set_parameter(tree, "/", parameter_tree(fleet.rosparam, "rosparam"))
    for _, member, owner in all_services(fleet):
        if is_script(member.kind) and member.parameters:
            node = service_identity(member, owner).node
            set_parameter(tree, node, parameter_tree(member.parameters, node))
    return tree


def write_parameter_tree(tree: Tree, path: Path) -> None:
    """Write the file that the parameter service starts from."""
    write_atomic(path, json.dumps(tree).encode())
