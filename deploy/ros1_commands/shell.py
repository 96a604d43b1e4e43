"""The shell code that adds the commands of ROS 1 to a shell's PATH."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from pathlib import Path

from services.script.workspace import workspace_of

BIN = Path(__file__).parent / "bin"
"""The folder of the commands."""

_FUNCTIONS = """
_elea_folder() {
  _elea_found=$(rospack find "${1%%/*}") || return
  case $1 in */*) _elea_found=$_elea_found/${1#*/};; esac
}
roscd() { _elea_folder "$1" && cd "$_elea_found"; }
rosls() { _elea_folder "$1" && shift && ls "$@" "$_elea_found"; }
""".lstrip()


def shell_code(here: Path, environment: Mapping[str, str] | None = None) -> str:
    """Return shell code for ``eval`` in bash, zsh or sh: commands, variables and ``roscd`` until the shell exits.

    ``here`` is the current folder; the workspace around it is then found from everywhere, as after sourcing its setup.
    """
    environment = os.environ if environment is None else environment
    path = [each for each in environment.get("PATH", "").split(os.pathsep) if each and each != str(BIN)]
    roots = [str(each) for each in workspace_of(here, {}).roots]
    roots += [each for each in environment.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if each and each not in roots]
    values = {
        "PATH": os.pathsep.join([str(BIN), *path]),
        "ROS_PACKAGE_PATH": os.pathsep.join(roots),
        "ROS_DISTRO": "noetic",
        "ROS_VERSION": "1",
        "ROS_MASTER_URI": environment.get("ROS_MASTER_URI", "http://localhost:11311"),
    }
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in values.items())
    return exports + _FUNCTIONS
