"""Packages for launch files: those on disk, and stand-ins for well-known ones that are missing."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from services.runtime.errors import BadInput, did_you_mean
from services.script.inspect_script import is_python
from services.script.workspace import Workspace

ENDINGS = (".launch", ".test", ".xml")
"""Suffixes of launch files."""
STAND_INS = Path(__file__).parent / "packages"
"""Launch files of ours under the names of well-known ones, in a folder for each package."""

WITHOUT_FILES = frozenset(
    [
        *("xacro", "rviz", "rqt_gui", "tf", "tf2_ros", "robot_state_publisher", "joint_state_publisher", "map_server"),
        *("turtlebot3_description", "p3dx_description", "turtlesim", "controller_manager", "gazebo_worlds"),
        *("joint_state_publisher_gui", "teleop_twist_keyboard", "gazebo_plugins", "gazebo_ros_control"),
    ]
)
"""Packages whose files are not needed: one of our robots replaces the description."""

_FOLDERS = ("scripts", "nodes", "src", "bin", "script", ".")
MAX_SEARCHED = 5000
"""Maximum number of a package's files searched for a node."""


@dataclass(frozen=True)
class LaunchPackages:
    """The packages of a workspace, then the stand-ins."""

    workspace: Workspace

    def find(self, name: str) -> Path:
        """Return the folder of a package; raises BadInput with the nearest name."""
        if (found := self.on_disk(name)) is not None:
            return found
        if name in WITHOUT_FILES or (STAND_INS / name).is_dir():
            return STAND_INS / name
        known = self.names()
        raise BadInput(
            f"there is no package {name!r}{did_you_mean(name, known)}: packages are looked for in the workspace of the "
            f"launch file and in ROS_PACKAGE_PATH (found: {', '.join(list(self.workspace.packages())[:12]) or 'none'})"
        )

    def on_disk(self, name: str) -> Path | None:
        """Return the folder of a package on disk; None if it is missing."""
        return self.workspace.package_path(name)

    def names(self) -> list[str]:
        """Return the names of the packages."""
        return sorted({*self.workspace.packages(), *WITHOUT_FILES, *_stand_ins()})

    def launch_file(self, package: str, name: str) -> Path:
        """Return a launch file of a package by its name, in any folder of it; raises BadInput."""
        folder = self.find(package)
        for each in (folder, STAND_INS / package):
            found = sorted(path for path in _files_below(each) if path.name == name)
            if found:
                return found[0]
        known = sorted(path.name for path in _files_below(folder) if path.name.endswith(ENDINGS))
        shown = f" (it has {', '.join(known[:20])})" if known else ""
        raise BadInput(f"{package} in {folder} has no launch file {name}{did_you_mean(name, known)}{shown}")

    def included(self, path: Path) -> Path:
        """Return the file of an include; for a missing file of a well-known package, the stand-in."""
        if path.is_file():
            return path
        for package in _stand_ins():
            parts = path.parts
            if package in parts:
                inner = parts[len(parts) - parts[::-1].index(package) :]
                if (stand_in := STAND_INS.joinpath(package, *inner)).is_file():
                    return stand_in
        near = did_you_mean(path.name, [each.name for each in _siblings(path)])
        raise BadInput(f"there is no file {path}{near}")

    def script(self, package: str, name: str) -> Path | None:
        """Return the Python program of a node: by its name, with or without ``.py``, in the usual folders of programs,
        else anywhere in the package; else one of ours with that name. None if there is none.
        """
        own = self.on_disk(package)
        for folder in (own, STAND_INS / package) if own is not None else (STAND_INS / package,):
            names = (name, f"{name}.py")
            usual = (folder / inner / each for inner in _FOLDERS for each in names)
            anywhere = (each for each in _files_below(folder) if each.name in names)
            for path in (*usual, *anywhere):
                if path.is_file() and is_python(path):
                    return path
        return None

    def scripts(self, package: str) -> list[str]:
        """Return the names of a package's Python programs."""
        folder = self.on_disk(package)
        found = _files_below(folder) if folder else ()
        return sorted({each.name for each in found if is_python(each) and each.name not in ("setup.py", "__init__.py")})


def _stand_ins() -> list[str]:
    return sorted(each.name for each in STAND_INS.iterdir() if each.is_dir())


def _files_below(folder: Path) -> Iterator[Path]:
    """Yield the files of a package, nearest to its root first, without hidden folders and nested packages."""
    pending, seen = [folder], 0
    while pending and seen < MAX_SEARCHED:
        here = pending.pop(0)
        try:
            with os.scandir(here) as found:
                entries = sorted((each.name, each.is_dir()) for each in found)
        except OSError:
            continue
        if here != folder and ("package.xml", False) in entries:
            continue
        for name, is_folder in entries:
            seen += 1
            if is_folder and not name.startswith("."):
                pending.append(here / name)
            elif not is_folder:
                yield here / name


def _siblings(path: Path) -> list[Path]:
    try:
        return [each for each in path.parent.iterdir() if each.is_file()]
    except OSError:
        return []
