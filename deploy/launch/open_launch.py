"""Finds and reads the launch file that the arguments of ``roslaunch`` name, and makes its fleet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.fleet import Fleet
from deploy.fleet_file import parse_fleet
from deploy.launch.fleet_of_launch import FleetOfLaunch, fleet_of_launch
from deploy.launch.launch_file import Launch, read_launch
from deploy.launch.packages import ENDINGS, LaunchPackages
from services.runtime.errors import BadInput
from services.script.workspace import workspace_of


def find_launch(words: Sequence[str], here: Path) -> tuple[Path, LaunchPackages]:
    """Return the launch file for ``PACKAGE FILE`` or a path, and the packages around it; raises BadInput."""
    if len(words) == 1:
        path = (here / Path(words[0]).expanduser()).absolute()
        if not path.is_file():
            hint = f"; for a launch file of a package, give both: {words[0]} FILE.launch"
            hint = "" if words[0].endswith(ENDINGS) else hint
            raise BadInput(f"there is no launch file {words[0]}{hint}")
        return path, LaunchPackages(workspace_of(path))
    if len(words) != 2:
        raise BadInput("name a package and its launch file, as in turtlebot3_gazebo turtlebot3_world.launch, or a path")
    package, name = words
    packages = LaunchPackages(workspace_of(here))
    path = packages.launch_file(package, name)
    own = LaunchPackages(workspace_of(path))
    return path, own if packages.on_disk(package) is not None else packages


def split_words(words: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Split a command line into names and arguments ``x:=1``."""
    names = [each for each in words if ":=" not in each]
    pairs = [each.partition(":=") for each in words if ":=" in each]
    return names, {name: value for name, _, value in pairs}


def make_fleet(path: Path, arguments: Mapping[str, str], packages: LaunchPackages) -> tuple[Launch, FleetOfLaunch]:
    """Return a launch file, and the fleet made from it; raises BadInput."""
    launch = read_launch(path, arguments, packages)
    return launch, fleet_of_launch(launch, packages)


def checked_fleet(path: Path, made: FleetOfLaunch, overrides: Sequence[str] = ()) -> Fleet:
    """Return the fleet of a launch file as ``./elea up`` would read it; raises BadInput."""
    try:
        return parse_fleet(path.with_suffix(".toml"), made.toml(), overrides)
    except BadInput as error:
        raise BadInput(f"{error} (in the fleet that {path.name} makes: --print shows it)") from None
