"""``elea rosrun``: run a program of a ROS 1 package in this terminal."""

from __future__ import annotations

from pathlib import Path

import click

from deploy.commands.options import fleet_option
from services.runtime.errors import BadInput, did_you_mean


@click.command("rosrun", context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False})
@fleet_option
@click.option("--wall-time", is_flag=True, help="Follow the wall clock; no simulation is needed.")
@click.argument("package")
@click.argument("program")
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(package: str, program: str, arguments: tuple[str, ...], port: int | None, wall_time: bool) -> None:
    """Run PROGRAM of PACKAGE with its ARGUMENTS, as `./elea rosrun my_pkg talker.py chatter:=news _rate:=5`.

    The package is looked for around the current folder and in ROS_PACKAGE_PATH. For well-known packages that are
    not here, Elea has substitutes: turtlesim, the keyboards, the viewer, the panel.
    """
    from deploy.commands.run import run_script
    from deploy.launch.packages import LaunchPackages
    from deploy.launch.run_node import run_known_node
    from services.catalog import NO_ROS2, script_api
    from services.script.workspace import workspace_of

    packages = LaunchPackages(workspace_of(Path.cwd()))
    path = packages.script(package, program)
    if path is not None:
        if script_api(str(path)) == "ros2":
            raise BadInput(f"{path} is written for ROS 2 (rclpy): {NO_ROS2}")
        run_script(path, arguments, port, {"wall_time": wall_time})
    if run_known_node(package, program, arguments, port):
        return
    folder = packages.on_disk(package)
    if folder is None:
        near = did_you_mean(package, packages.names())
        found = ", ".join(list(packages.workspace.packages())[:12]) or "none"
        raise BadInput(
            f"there is no package {package!r}{near}: packages are looked for around {Path.cwd()} and in "
            f"ROS_PACKAGE_PATH (found: {found})"
        )
    known = packages.scripts(package)
    raise BadInput(
        f"{package} in {folder} has no Python program {program!r}{did_you_mean(program, known)} "
        f"(it has {', '.join(known[:20]) or 'none'}; C++ is not run)"
    )
