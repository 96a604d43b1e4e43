"""Packages of a catkin workspace on disk, used in place: nothing is built, nothing is written.

A package is a folder with a ``package.xml`` and has the name stated there, whatever the folder is called; rosbuild
packages, from before catkin, have a ``manifest.xml`` and the folder's name. Packages are searched in the package of a
file and the workspace around it, in ROS_PACKAGE_PATH, and in the workspaces whose ``devel`` or ``install`` folder the
shell has sourced (CMAKE_PREFIX_PATH); the first of a name counts.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from models.packages import package_name

MAX_FOLDERS = 20_000
"""Maximum number of a workspace's folders that are searched."""
MAX_DEPTH = 8
"""Maximum depth of the search."""
_PACKAGE_FILES = ("package.xml", "manifest.xml")
_IGNORED = ("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")
_NO_SOURCES = frozenset(["build", "devel", "install", "logs", "node_modules", "__pycache__"])
_NAMED_FOLDER = r"""["']([\w.]*)["']\s*:\s*["']([^"']*)["']"""
"""Matches ``package_dir`` in a setup.py: a module's name, empty for all, and its folder."""
_MARKERS = (".catkin_workspace", ".catkin_tools", ".rosinstall")


@dataclass(frozen=True)
class Workspace:
    """The packages around a file: ``own`` is its package's folder or None, ``roots`` are the folders that contain
    packages.
    """

    own: Path | None
    roots: tuple[Path, ...]

    def package_path(self, name: str) -> Path | None:
        """Return the folder of a package; None if it is missing."""
        return self.packages().get(name)

    def packages(self) -> dict[str, Path]:
        """Return the folders of all packages by name, sorted; they are searched once."""
        return self._packages

    def python_paths(self) -> tuple[Path, ...]:
        """Return the folders of Python modules: ``src`` of each package, or those of its setup.py, the file's own
        first.
        """
        folders = [self.own, *self._packages.values()] if self.own else list(self._packages.values())
        return tuple(dict.fromkeys(place for each in folders for place in _places(each) if _has_modules(place)))

    @cached_property
    def _packages(self) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for folder in ([self.own] if self.own else []) + [each for root in self.roots for each in _crawl(root)]:
            found.setdefault(package_name(folder) or folder.name, folder)
        return dict(sorted(found.items()))


def workspace_of(place: Path, environment: Mapping[str, str] | None = None) -> Workspace:
    """Return the workspace around a file or folder; ROS_PACKAGE_PATH is that of ``environment``, by default the
    process's.
    """
    environment = os.environ if environment is None else environment
    place = Path(os.path.abspath(place))
    folders = [place, *place.parents] if place.is_dir() else list(place.parents)
    own = next((each for each in folders if any((each / marker).is_file() for marker in _PACKAGE_FILES)), None)
    roots = [_root_around(own)] if own else list(_roots_near(folders))
    roots += [Path(each) for each in environment.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if each]
    for prefix in environment.get("CMAKE_PREFIX_PATH", "").split(os.pathsep):
        roots += _sourced(Path(prefix)) if prefix else []
    return Workspace(own, tuple(dict.fromkeys(each for each in roots if each.is_dir())))


def _root_around(package: Path) -> Path:
    """Return the folder that contains related packages: the workspace's ``src``, else the
    repository, else the parent.
    """
    above = list(package.parents)[:MAX_DEPTH]
    for each in above:
        if each.name == "src" or any((each / marker).exists() for marker in _MARKERS):
            return each
    return next((each for each in above if (each / ".git").exists()), package.parent)


def _roots_near(folders: list[Path]) -> Iterator[Path]:
    """Yield the roots around a folder outside any package: a workspace's ``src``, else the folder itself if it has
    packages.
    """
    for each in folders[:MAX_DEPTH]:
        if (each / "src").is_dir() and (
            any((each / marker).exists() for marker in _MARKERS)
            or (each / "src" / "CMakeLists.txt").exists()
            or next(_crawl(each / "src", limit=500), None)
        ):
            yield each / "src"
            return
        if each.name == "src":
            yield each
            return
    if folders and _holds_packages(folders[0]):
        yield folders[0]


def _holds_packages(folder: Path) -> bool:
    try:
        folders = [each for each in folder.iterdir() if each.is_dir()]
        return any((each / marker).is_file() for each in folders for marker in _PACKAGE_FILES)
    except OSError:
        return False


def _sourced(prefix: Path) -> list[Path]:
    """Return the source folders of a ``devel`` folder, listed in its file ``.catkin``; the content of ``install``."""
    try:
        listed = (prefix / ".catkin").read_text(encoding="utf-8", errors="replace")
    except OSError:
        listed = ""
    share = prefix / "share"
    return [*(Path(each) for each in listed.split(";") if each), *([share] if share.is_dir() else [])]


def _crawl(root: Path, limit: int = MAX_FOLDERS) -> Iterator[Path]:
    """Yield the packages at or below a folder, as catkin finds them: sorted, none nested, links followed once."""
    pending, seen = [(root, 0)], set[str]()
    while pending and len(seen) < limit:
        folder, depth = pending.pop(0)
        real = os.path.realpath(folder)
        if real in seen:
            continue
        seen.add(real)
        try:
            with os.scandir(folder) as found:
                entries = sorted((each.name, each.is_dir()) for each in found)
        except OSError:
            continue
        names = {name for name, is_folder in entries if not is_folder}
        if names & set(_IGNORED):
            continue
        if names & set(_PACKAGE_FILES):
            yield folder
            continue
        if depth < MAX_DEPTH:
            pending += [
                (folder / name, depth + 1)
                for name, is_folder in entries
                if is_folder and not name.startswith(".") and name not in _NO_SOURCES
            ]


def _places(package: Path) -> Iterator[Path]:
    """Yield the folders that may contain a package's Python modules."""
    yield package / "src"
    try:
        text = (package / "setup.py").read_text(errors="replace")
    except OSError:
        return
    for name, folder in re.findall(_NAMED_FOLDER, "".join(re.findall(r"package_dir\s*=\s*\{([^}]*)\}", text))):
        parts = name.split(".") if name else []
        place = package / folder
        if [*place.parts[len(place.parts) - len(parts) :]] == parts:
            yield Path(*place.parts[: len(place.parts) - len(parts)])


def _has_modules(folder: Path) -> bool:
    try:
        with os.scandir(folder) as entries:
            return any(
                each.name.endswith(".py") or (each.is_dir() and os.path.isfile(os.path.join(each.path, "__init__.py")))
                for each in entries
            )
    except OSError:
        return False
