"""``elea run``: run a service, or a Python file of the user's own, in this terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import click

from deploy.commands.completion import KIND
from deploy.commands.options import fleet_option
from services.runtime import process
from services.runtime.errors import BadInput, unknown_name
from services.runtime.network_address import port_of_fleet, resolve_address
from services.runtime.process import ROOT

ROBOT_TOPICS = ("cmd_vel", "odom", "scan", "imu", "joint_states", "battery_state")
"""Topics of a robot that programs written for a single robot name absolutely."""


@click.command("run", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@fleet_option
@click.option("--namespace", default="", help="Namespace of the node's relative names, such as /tb3_0.")
@click.option("--name", default="", help="Name of the node.")
@click.option("--remap", multiple=True, metavar="FROM:=TO", help="Use another name.")
@click.option("--connect", multiple=True, metavar="ENDPOINT", help="Router to join; the running fleet's by default.")
@click.option("--domain", default="", help="Domain of the fleet; it separates fleets on the same network.")
@click.option("--log-level", default="", metavar="LEVEL", help="Log this level and above: debug, info, warn or error.")
@click.option("--robot", default="", metavar="NAME", help="ROS: use the /cmd_vel, /odom, … and frames of this robot.")
@click.option("--frame-prefix", metavar="PREFIX", help="ROS: prefix of that robot's frames; NAME/ by default.")
@click.option("--wall-time", is_flag=True, help="ROS: follow the wall clock; no simulation is needed.")
@click.option("--rate", type=float, metavar="HZ", help="ROS: steps per second in lockstep; 100 by default.")
@click.option("--seed", type=int, metavar="N", help="ROS: seed of its random numbers.")
@click.argument("target", type=KIND)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(target: str, arguments: tuple[str, ...], port: int | None, **options: Any) -> None:
    """Run TARGET, the name of a service or a .py file of your own, with the remaining arguments.

    A program written for ROS 1 (it imports rospy) runs unchanged; the words after its name are its arguments, as in
    `./elea run --namespace /tb3_0 talker.py chatter:=news _rate:=5`.

    TARGET container runs several services in one process:
    `./elea run container --node "waypoint --namespace /tb3_0" --node "waypoint --namespace /tb3_1"`.

    It joins the running fleet (--fleet or --port selects one of several) unless --connect is given.

    `./elea run waypoint --help` shows the options that all services have.

    To import Elea from a Python environment of your own, install the packages of requirements.lock there, and put a
    file elea.pth into its site-packages whose only line is the path of this checkout. `./elea python` runs this
    project's own Python.
    """
    from services.catalog import NO_ROS2, is_user_file, script_api, service_kinds
    from services.runtime.container_main import NAME as CONTAINER
    from services.script.inspect_script import runs_nothing

    if is_user_file(target):
        api = script_api(target)
        if api == "ros2":
            raise BadInput(f"{target} is written for ROS 2 (rclpy): {NO_ROS2}")
        if api == "ros1":
            run_script(Path(target), arguments, port, options)
        if runs_nothing(Path(target)):
            raise BadInput(f"{target} defines things but runs nothing: a controller ends with a call of main")
    elif target not in (*service_kinds(), CONTAINER):
        raise unknown_name("service", target, (*service_kinds(), CONTAINER))
    for name in ("robot", "frame_prefix", "wall_time", "rate", "seed"):
        if options[name] not in (None, "") and options[name] is not False:
            raise BadInput(f"--{name.replace('_', '-')} is for programs of ROS, which {target} is not")
    if target == CONTAINER and (options["namespace"] or options["remap"]):
        raise BadInput("--namespace and --remap belong to a node: state them in its --node")
    port, arguments = _extract_fleet(port, arguments)
    arguments = (*_node_arguments(options), *arguments)
    if target != "router" and not _states_network(arguments):
        arguments = (*_network_arguments(port, arguments), *arguments)
    if is_user_file(target):
        file = Path(target).resolve()
        _execute([str(file)], arguments, target, str(file.parent))
    _execute(["-m", "services", target], arguments, target)


def run_script(file: Path, arguments: Sequence[str], port: int | None, options: Mapping[str, Any]) -> None:
    """Replace this process by a ROS 1 program; ``arguments`` are its own, ``options`` those of ``command``."""
    own = _node_arguments(options)
    if robot := options.get("robot", "").strip("/"):
        own += ["--namespace", f"/{robot}"] if not options.get("namespace") else []
        own += [word for topic in ROBOT_TOPICS for word in ("--remap", f"/{topic}:=/{robot}/{topic}")]
    prefix = options.get("frame_prefix")
    if prefix is None and robot:
        prefix = f"{robot}/"
    own += ["--frame-prefix", prefix] if prefix else []
    own += ["--wall-time"] if options.get("wall_time") else []
    for name in ("rate", "seed"):
        own += [f"--{name}", str(options[name])] if options.get(name) is not None else []
    if not _states_network(tuple(own)):
        own = [*_network_arguments(port, tuple(own)), *own]
    libraries = os.environ.get("PYTHONPATH", "")
    _execute(["-m", "services.script", *own, str(file.absolute())], arguments, str(file), libraries)


def _node_arguments(options: Mapping[str, Any]) -> list[str]:
    """Return the options before TARGET that services and scripts share."""
    single = [(name, options.get(name)) for name in ("namespace", "name", "domain", "log_level")]
    several = [(name, each) for name in ("remap", "connect") for each in options.get(name, ())]
    return [word for name, each in (*single, *several) if each for word in (f"--{name.replace('_', '-')}", each)]


def _execute(place: list[str], arguments: Sequence[str], target: str, folder: str = "") -> NoReturn:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), folder]))}
    environment[process.PROGRAM] = f"./elea run {target}"
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, "-P", *place, *arguments], environment)


def _extract_fleet(port: int | None, arguments: tuple[str, ...]) -> tuple[int | None, tuple[str, ...]]:
    """Return the port that --port or --fleet after TARGET selects, and the other arguments; raises BadInput."""
    fleet, left = "", list(arguments)
    for option in ("--port", "--fleet"):
        index = next((at for at, word in enumerate(left) if word.partition("=")[0] == option), None)
        if index is None:
            continue
        _, equals, value = left[index].partition("=")
        value = value if equals else "".join(left[index + 1 : index + 2])
        del left[index : index + (1 if equals else 2)]
        if option == "--fleet":
            fleet = value
        elif value.isdigit() and 0 < int(value) <= 65535:
            port = int(value)
        else:
            raise BadInput(f"--port {value}: give the port of a fleet's router, 1 to 65535")
    return (port_of_fleet(fleet, port) if fleet else port), tuple(left)


def _states_network(arguments: tuple[str, ...]) -> bool:
    """Return whether the arguments select a network, or need none."""
    return any(each.partition("=")[0] in ("--connect", "--help", "--print-config") for each in arguments)


def _network_arguments(port: int | None, arguments: tuple[str, ...]) -> list[str]:
    """Return the arguments for joining the selected fleet; a given domain is kept."""
    address = resolve_address(port=port)
    if any(each.partition("=")[0] == "--domain" for each in arguments):
        address = address._replace(domain="")
    return address.arguments


@click.command("python", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def python_command(arguments: tuple[str, ...]) -> None:
    """Run the Python of this project with ARGUMENTS, from any folder: a script, -m MODULE, or none for a prompt.

    It can import Elea, as in `from services.runtime import connect`.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))}
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, *arguments], environment)
