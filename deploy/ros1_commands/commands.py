"""Maps each ROS 1 command to a command of Elea, to a program with ROS's output, or to a note that it is not needed."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from services.runtime.errors import BadInput, EleaError, did_you_mean, unknown_name
from services.runtime.fleet_instances import running_fleets
from services.runtime.network_address import resolve_address
from services.runtime.process import ROOT
from services.script.workspace import workspace_of

TOOLS = ROOT / "services" / "ros1" / "command_line"
ROSCORE = Path(__file__).parent / "roscore.toml"

NOTHING_TO_BUILD = (
    "nothing needs to be built: programs, launch files and message definitions are used in place; there is no "
    "devel/setup.bash to source either"
)
_NO_DEPENDENCIES = "nothing needs to be installed: Elea brings its own ROS packages"
_PACKAGE_XML = """<?xml version="1.0"?>
<package format="2">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>The {name} package</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>unstated</license>
  <buildtool_depend>catkin</buildtool_depend>
{depends}</package>
"""

Command = Callable[[list[str]], int]


def run_command(name: str, words: Sequence[str]) -> int:
    """Run a ROS 1 command by name; return the exit status, if this process is not replaced. Raises BadInput."""
    if name.startswith("rqt"):
        return _elea("panel")
    if name not in COMMANDS:
        raise unknown_name("command of ROS 1", name, COMMANDS)
    return COMMANDS[name](list(words))


def _elea(*words: str) -> NoReturn:
    _python("-m", "deploy", *words)


def _python(*words: str) -> NoReturn:
    sys.stdout.flush()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    os.execve(sys.executable, [sys.executable, "-P", *words], environment)


def _tool(name: str, *words: str, network: bool = True) -> NoReturn:
    """Run a program with ROS 1's output on the network of the running fleet."""
    fleets, port = running_fleets(), _chosen_port()
    several = port is None and len(fleets) > 1
    if network and not fleets:
        raise EleaError(
            "Unable to communicate with master! No fleet is running: roscore, roslaunch or ./elea up starts one"
        )
    if network and several:
        choices = ", ".join(f"http://localhost:{each.port} ({each.fleet})" for each in fleets)
        raise BadInput(
            f"several fleets are running: choose one with export ROS_MASTER_URI=URL, URL being one of {choices}"
        )
    address = resolve_address(port=port).arguments if fleets and not several else []
    _python("-m", "services.script", "--wall-time", *address, str(TOOLS / f"{name}_command.py"), *words)


def _chosen_port() -> int | None:
    """Return the port in ROS_MASTER_URI if a fleet runs there, which selects one of several fleets."""
    found = re.search(r":(\d+)/?$", os.environ.get("ROS_MASTER_URI", ""))
    return next((each.port for each in running_fleets() if found and each.port == int(found[1])), None)


def _with_port(words: list[str]) -> list[str]:
    port = _chosen_port()
    return words if port is None else ["--port", str(port), *words]


def _roscore(words: list[str]) -> int:
    if fleets := running_fleets():
        sys.stderr.write(f"roscore has nothing to do: the fleet {fleets[0].fleet} is running\n")
        return 0
    _elea("up", str(ROSCORE), "--no-view", "--no-picture", "--no-saved")


def _rosbag(words: list[str]) -> int:
    command, *rest = words or [""]
    if command in ("play", "info") and any(map(_is_ros1_bag, rest)):
        _tool("rosbag", *words, network=command == "play")
    if command == "record":
        made: list[str] = []
        while rest:
            word = rest.pop(0)
            if word in ("-O", "-o", "--output-name", "--output-prefix") and rest:
                made += ["-o", rest.pop(0).removesuffix(".bag")]
            elif word not in ("-q", "--lz4", "-j", "--bz2", "--tcpnodelay"):
                made.append(word)
        _elea("bag", "record", *made)
    if command == "play":
        made = []
        taking = False
        while rest:
            word = rest.pop(0)
            if word.startswith("-"):
                taking = word == "--topics"
            if word in ("-s", "--start", "-u", "--duration", "-r", "--rate") and rest:
                made += [{"-s": "--start", "-u": "--duration"}.get(word, word), rest.pop(0)]
            elif word in ("--clock", "--pause", "-q", "--quiet", "-i", "--immediate", "--topics"):
                made += ["-r", "0"] if word in ("-i", "--immediate") else []
            elif taking:
                made += ["--topics", word]
            elif ":=" in word:
                made += ["-m", word]
            else:
                made.append(_bag(word))
        _elea("bag", "play", *made)
    if command == "info":
        _elea("bag", "info", *(_bag(each) for each in rest if not each.startswith("-")))
    raise unknown_name("command of rosbag", command, ("record", "play", "info"))


def _is_ros1_bag(name: str) -> bool:
    """Return whether an argument names a ROS 1 bag file."""
    try:
        with Path(name).open("rb") as file:
            return file.read(7) == b"#ROSBAG"
    except OSError:
        return False


def _bag(name: str) -> str:
    """Return the folder of a bag that was recorded under a file's name."""
    return name.removesuffix(".bag") if not Path(name).exists() else name


def _rospack(words: list[str]) -> int:
    command, *rest = words or [""]
    packages = workspace_of(Path.cwd()).packages()
    if command == "find" and len(rest) == 1:
        if rest[0] not in packages:
            raise BadInput(f"[rospack] Error: package '{rest[0]}' not found{did_you_mean(rest[0], packages)}")
        sys.stdout.write(f"{packages[rest[0]]}\n")
    elif command in ("list", "list-names"):
        lines = (name if command == "list-names" else f"{name} {folder}" for name, folder in packages.items())
        sys.stdout.write("".join(f"{line}\n" for line in lines))
    elif command == "profile":
        sys.stdout.write("packages are read from disk directly: there is no index\n")
    else:
        raise unknown_name("command of rospack", command, ("find", "list", "list-names"))
    return 0


def _print_text(text: str) -> Command:
    def say(_: list[str]) -> int:
        sys.stdout.write(f"{text}\n")
        return 0

    return say


def _create_package(words: list[str]) -> int:
    """Create a folder with a package.xml, as catkin_create_pkg does."""
    names = [each for each in words if not each.startswith("-")]
    if not names or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", names[0]):
        raise BadInput(
            "usage: catkin_create_pkg NAME [DEPENDENCY]...; NAME has letters, digits, '_' and '-', a letter first"
        )
    folder = Path(names[0])
    if folder.exists():
        raise BadInput(f"{folder} exists already")
    (folder / "src").mkdir(parents=True)
    depends = "".join(f"  <depend>{each}</depend>\n" for each in names[1:])
    (folder / "package.xml").write_text(_PACKAGE_XML.format(name=names[0], depends=depends))
    sys.stdout.write(f"Created {folder}/package.xml and {folder}/src\n")
    return 0


COMMANDS: dict[str, Command] = {
    "roslaunch": lambda words: _elea("roslaunch", *_with_port(words)),
    "rosrun": lambda words: _elea("rosrun", *_with_port(words)),
    "rostest": lambda words: _elea("rostest", *words),
    "rostopic": lambda words: _tool("rostopic", *words),
    "rosservice": lambda words: _tool("rosservice", *words),
    "rosparam": lambda words: _tool("rosparam", *words),
    "rosconsole": lambda words: _tool("rosconsole", *words),
    "rosmsg": lambda words: _tool("rosmsg", "rosmsg", *words, network=False),
    "rossrv": lambda words: _tool("rosmsg", "rossrv", *words, network=False),
    "rosnode": lambda words: _tool("rosnode", *words),
    "roscore": _roscore,
    "rosbag": _rosbag,
    "rospack": _rospack,
    "rosversion": _print_text("noetic"),
    "roswtf": lambda words: _elea("doctor"),
    "rviz": lambda words: _elea("view"),
    "rqt": lambda words: _elea("panel"),
    "gazebo": lambda words: _elea("view"),
    "rosdep": _print_text(_NO_DEPENDENCIES),
    "catkin_make": _print_text(NOTHING_TO_BUILD),
    "catkin": _print_text(NOTHING_TO_BUILD),
    "catkin_init_workspace": _print_text(NOTHING_TO_BUILD),
    "catkin_create_pkg": _create_package,
}
"""The commands by name; others that begin with ``rqt`` open the panel."""
