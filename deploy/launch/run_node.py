"""Runs the replacement of a well-known node that is started by hand, e.g. ``rosrun turtlesim turtlesim_node``."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deploy.launch import known_nodes
from deploy.launch.launch_file import LaunchNode, join_names
from deploy.launch.launch_values import Description, command_output
from services.runtime.errors import BadInput
from services.runtime.process import ROOT
from services.script.workspace import workspace_of


def run_known_node(package: str, program: str, arguments: Sequence[str], port: int | None) -> bool:
    """Replace this process by the replacement of a node; return False without one, True if nothing needs to be done."""
    remaps = [each.partition(":=")[::2] for each in arguments if ":=" in each]
    if (inherited := os.environ.get("ROS_NAMESPACE")) and "__ns" not in dict(remaps):
        remaps.append(("__ns", inherited))
    words = [each for each in arguments if ":=" not in each]
    node = LaunchNode(package, program, program, "/", shlex.join(words), f"rosrun {package} {program}")
    network = ["--port", str(port)] if port is not None else []
    if (package, program) in (("tf", "tf_echo"), ("tf2_tools", "echo.py")):
        _elea(["tf", "echo", *network, *words[:2]])
    if program.removesuffix(".py") == "view_frames":
        _elea(["tf", "tree", *network])
    if package == "xacro":
        _expand(arguments)
        return True
    if package == "rviz":
        _elea(["view"])
    if known_nodes.is_panel(node):
        _elea(["panel", *network])
    if (package, program) == ("turtlesim", "turtlesim_node"):
        _elea(["run", *network, "turtlesim", *_node_options(remaps)])
    if (package, program) == ("turtlesim", "turtle_teleop_key"):
        _elea(["teleop", *network, "--speed", "2", "--turn", "2", "/turtle1"])
    if known_nodes.is_static_transform(node):
        return _service("static_transform", known_nodes.static_transform(node), remaps, network)
    if (package, program) == ("map_server", "map_server") and (file := known_nodes.map_file(node)) is not None:
        return _service("map_server", {"map": str(file.absolute())}, remaps, network)
    if (why := known_nodes.lookup(known_nodes.NOTHING_TO_DO, node)) is not None:
        sys.stderr.write(f"{node.what} has nothing to do here{f': {why}' if why else ''}\n")
        return True
    if package == "robot_state_publisher":
        sys.stderr.write(f"{node.what} has nothing to do here: {known_nodes.PUBLISHED_BY_SIM}\n")
        return True
    if (command := known_nodes.lookup(known_nodes.KEYBOARDS, node)) is not None and command:
        own = dict(remaps).get("__ns", "")
        namespace = next(
            (target.rpartition("/")[0] for origin, target in remaps if origin.strip("/") == "cmd_vel"),
            join_names("/", own) if own else "",
        )
        _elea(["teleop", *network, *([namespace] if namespace else [])])
    if package in known_nodes.NOT_HERE:
        raise BadInput(f"{node.what} cannot be run: {known_nodes.NOT_HERE[package]}")
    return False


def _expand(words: Sequence[str]) -> None:
    """Expand a xacro to standard output, or to the file given by -o."""
    rest, output = list(words), ""
    if "-o" in rest[:-1]:
        index = rest.index("-o")
        output = rest[index + 1]
        del rest[index : index + 2]
    made = command_output(shlex.join(["xacro", *rest]), "rosrun xacro xacro")
    text = made.text(tuple(workspace_of(Path.cwd()).roots)) if isinstance(made, Description) else made
    if output:
        Path(output).write_text(text, encoding="utf-8")
    else:
        sys.stdout.write(text)


def _service(kind: str, parameters: dict[str, Any], remaps: list[tuple[str, str]], network: list[str]) -> bool:
    options = [word for name, value in parameters.items() for word in ("--param", f"{name}={json.dumps(value)}")]
    _elea(["run", *network, kind, *_node_options(remaps), *options])
    return True


def _node_options(remaps: list[tuple[str, str]]) -> list[str]:
    found: list[str] = []
    for origin, target in remaps:
        if origin == "__name":
            found += ["--name", target]
        elif origin == "__ns":
            found += ["--namespace", target]
        elif not origin.startswith("_"):
            found += ["--remap", f"{origin}:={target}"]
    return found


def _elea(words: list[str]) -> None:
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, "-P", "-m", "deploy", *words], {**os.environ, "PYTHONPATH": str(ROOT)})
