"""``elea roslaunch``: run a launch file of ROS 1 as a fleet."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from deploy.commands.options import fleet_option
from deploy.fleet import MODES
from services.runtime.errors import BadInput

if TYPE_CHECKING:
    from deploy.launch.fleet_of_launch import FleetOfLaunch
    from deploy.launch.launch_file import Launch


@click.command("roslaunch")
@click.argument("words", nargs=-1, required=True, metavar="(PACKAGE FILE | PATH) [ARG:=VALUE]...")
@click.option("--print", "show", is_flag=True, help="Print the fleet as TOML that ./elea up reads, and start nothing.")
@click.option("--ros-args", is_flag=True, help="List the arguments of the launch file.")
@click.option("--nodes", is_flag=True, help="List its nodes.")
@click.option("--args", "args_of", metavar="NODE", default="", help="Show the command line of a node.")
@click.option("--dump-params", is_flag=True, help="Print its parameters as YAML.")
@click.option("--mode", type=click.Choice(MODES), help="How time runs; real by default.")
@click.option("--factor", type=float, help="Simulated seconds per wall-clock second, in mode real.")
@click.option("--duration", type=float, metavar="S", help="End after S seconds of simulation time.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a key of the fleet, as ./elea up.")
@click.option("--detach", is_flag=True, help="Return when all is ready; stop it with ./elea down.")
@click.option("--report", metavar="DIR", default="", help="Folder for the results.")
@click.option("--runs", metavar="DIR", default="", help="Parent folder of the run folders; runs by default.")
@click.option("--seed", type=int, metavar="N", help="Random seed of the sensor noise and of the programs.")
@click.option("--domain", default="", help="Isolate the fleet from others on the same network.")
@click.option("--record", is_flag=True, help="Record all topics into a bag next to the report.")
@click.option("--new", "apart", is_flag=True, help="Start a fleet of its own, even if one is running.")
@click.option("--no-view", is_flag=True, help="Neither open a viewer nor serve the run to one.")
@click.option("--no-picture", is_flag=True, help="Write no report.png; drawing it takes half a second.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
@click.option("--screen", is_flag=True, help="Show what all programs print; it is logged in any case.")
@click.option("-v", "verbose", is_flag=True, hidden=True)
@fleet_option
def command(
    words: tuple[str, ...], show: bool, ros_args: bool, nodes: bool, args_of: str, dump_params: bool, **options: Any
) -> None:
    """Run a launch file of ROS 1: that of a PACKAGE found on disk, or one named by its PATH.

    If it does not start Gazebo, its nodes join the running fleet, if there is one. Otherwise it becomes a fleet of its
    own, with supervision, logs and a report. Packages are used as they are on disk; nothing is built.
    """
    from deploy.launch.launch_file import declared_arguments
    from deploy.launch.open_launch import checked_fleet, find_launch, make_fleet, split_words

    names, arguments = split_words(words)
    path, packages = find_launch(names, Path.cwd())
    if ros_args:
        for each in declared_arguments(path):
            value = f" (fixed: {each.value})" if each.value is not None else f" (default {each.default!r})"
            needed = " (must be given)" if each.default is None and each.value is None else value
            click.echo(f"{each.name}{needed}{f': {each.doc}' if each.doc else ''}")
        return
    launch, made = make_fleet(path, arguments, packages)
    if nodes or args_of or dump_params:
        click.echo(_listing(launch, made, nodes, args_of), nl=False)
    elif show:
        checked_fleet(path, made)
        click.echo(made.toml(), nl=False)
    else:
        if options["screen"]:
            made.show_programs()
        raise SystemExit(_start(path, made, options))


def _listing(launch: Launch, made: FleetOfLaunch, nodes: bool, args_of: str) -> str:
    import yaml

    from services.runtime.errors import unknown_name

    if nodes:
        return "".join(f"{each.node}\n" for each in launch.nodes)
    if args_of:
        by_name = {each.node: each for each in launch.nodes}
        node = by_name.get(args_of) or by_name.get(f"/{args_of}")
        if node is None:
            raise unknown_name("node", args_of, by_name)
        remaps = [f"{origin}:={target}" for origin, target in node.remaps]
        return " ".join(["rosrun", node.package, node.type, node.args, *remaps, f"__name:={node.name}"]) + "\n"
    return yaml.safe_dump(made.table.get("rosparam", {}), sort_keys=True)


def _start(path: Path, made: FleetOfLaunch, options: dict[str, Any]) -> int:
    from deploy.launch.open_launch import checked_fleet
    from deploy.live.output import printable
    from services.runtime.fleet_instances import running_fleets
    from services.runtime.network_address import select_fleet
    from services.runtime.process import die_with_parent

    if not options["detach"]:
        die_with_parent()  # a program may start it
    for note in made.notes:
        sys.stderr.write(printable(f"{note}\n"))
    fleet = checked_fleet(path, made, options["overrides"])
    running = [] if options["apart"] else list(running_fleets())
    if options["port"] is not None:
        running = [each for each in running if each.port == options["port"]]
    if running:
        from deploy.launch.join_fleet import ROSCORE, join_fleet, stop_fleet

        chosen = select_fleet(options["port"])
        if not made.has_gazebo:
            for line in made.by_hand:
                sys.stderr.write(printable(f"{line}\n"))
            return join_fleet(fleet, chosen)
        if chosen.fleet != ROSCORE:
            raise BadInput(
                f"the fleet {chosen.fleet} is running, and {path.name} brings a world of its own: stop it with "
                "./elea down, or take another --port with --new"
            )
        stop_fleet(chosen)
    from deploy.commands.up import override_run, run_described

    fleet = override_run(fleet, options)
    for line in made.by_hand:
        sys.stderr.write(printable(f"{line}\n"))
    if options["detach"]:
        from deploy.detach import start_detached

        return start_detached(fleet.name, options["report"], options["as_json"], options["runs"])
    up_options = {**options, "params": "", "no_saved": True, "connect": (), "listen": (), "insecure": False}
    return run_described(
        fleet, options["report"], options["runs"], options["as_json"], options["overrides"], up_options
    )
