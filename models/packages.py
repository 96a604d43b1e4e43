"""Finds the files that a robot's description refers to: ``package://``, ``model://``, ``file://`` and relative paths.

A package NAME is a folder of that name, or one whose ``package.xml`` has it in ``<name>``. It is searched for above the
referring file and beside its parents, then in the user's folders, in ROS_PACKAGE_PATH and in AMENT_PREFIX_PATH
(``share/NAME``); for ``model://`` also in GAZEBO_MODEL_PATH and GZ_SIM_RESOURCE_PATH.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from messages.errors import BadInput, did_you_mean
from models.input_file import read_limited

MAX_FOLDERS = 5000
"""Maximum number of folders searched below one of ROS_PACKAGE_PATH."""
MAX_DEPTH = 4
"""Maximum depth of that search."""
MAX_PACKAGE_XML = 1 << 20
"""Maximum size of a ``package.xml`` [bytes]."""

_MODEL_PATHS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")


class FileNotAllowed(BadInput):
    """A description refers to a file that it may not read, or to a package that does not exist."""


class FileMissing(FileNotAllowed):
    """A description refers to a package, model or file that is not on this machine."""


@dataclass(frozen=True)
class FileAccess:
    """The files that a description may read.

    ``folders`` must contain its files, after following links; None allows the whole disk. A xacro is expanded only with
    ``run_xacro``, since it is code.
    """

    folders: tuple[Path, ...] | None = None
    run_xacro: bool = True

    def check(self, path: Path, uri: str) -> None:
        """Raise FileNotAllowed for a file outside these folders; ``uri`` is the path as written."""
        if self.folders is None:
            return
        real = Path(os.path.realpath(path))
        if not any(real.is_relative_to(os.path.realpath(each)) for each in self.folders):
            known = ", ".join(map(str, self.folders)) or "none"
            raise FileNotAllowed(
                f"{uri} lies outside the folders from which a request may read files ({known}): put it there, add "
                "the folder to packages in [run] of the fleet file, or spawn it with ./elea sim spawn"
            )


OWNER = FileAccess()
"""Access for the user's own files and command line: unrestricted."""


@dataclass(frozen=True)
class PackagePath:
    """Search path of packages: the user's folders, each a package or a folder of packages, and those of ROS."""

    folders: tuple[Path, ...] = ()
    environment: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))

    def find(self, name: str, source: Path, kind: str = "package") -> Path:
        """Return the folder of the package ``name`` that the file ``source`` refers to; raises FileNotAllowed."""
        if not re.fullmatch(r"[A-Za-z0-9_.-]+", name) or name in (".", ".."):
            raise FileNotAllowed(f"{name[:80]!r} is not a valid {kind} name")
        for folder in self._candidates(name, source, kind):
            if folder.is_dir():
                return folder
        near = did_you_mean(name, self._names(source))
        variables = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", *(_MODEL_PATHS if kind == "model" else ()))
        raise FileMissing(
            f"there is no {kind} {name!r}{near}: searched above {source}, in packages in [run] of the fleet file, and "
            f"in {', '.join(variables)}"
        )

    def roots(self) -> tuple[Path, ...]:
        """Return all folders in which packages are searched for, except those above a file."""
        ros = (*self._listed("ROS_PACKAGE_PATH"), *(each / "share" for each in self._listed("AMENT_PREFIX_PATH")))
        return (*self.folders, *ros)

    def _candidates(self, name: str, source: Path, kind: str) -> Iterator[Path]:
        above = list(Path(os.path.abspath(source)).parents)
        for parent in above:
            if is_package(parent, name):
                yield parent
        for parent in above[:-1]:
            yield parent / name
        for folder in self.folders:
            yield folder / name
            yield from _packages_below(folder, name)
        for folder in self._listed("ROS_PACKAGE_PATH"):
            yield folder / name
            yield from _packages_below(folder, name)
        for folder in self._listed("AMENT_PREFIX_PATH"):
            yield folder / "share" / name
        if kind == "model":
            for variable in _MODEL_PATHS:
                for folder in self._listed(variable):
                    yield folder / name

    def _listed(self, variable: str) -> tuple[Path, ...]:
        return tuple(Path(each) for each in self.environment.get(variable, "").split(os.pathsep) if each)

    def _names(self, source: Path) -> Iterator[str]:
        """Yield the names of packages and folders that are searched."""
        parents = list(Path(os.path.abspath(source)).parents)[:6]
        yield from (package_name(each) or each.name for each in parents)
        for folder in (*parents[1:4], *self.roots()):
            try:
                with os.scandir(folder) as entries:
                    yield from [each.name for each, _ in zip(entries, range(500), strict=False) if each.is_dir()]
            except OSError:
                continue


def is_package(folder: Path, name: str) -> bool:
    """Whether a folder is the package ``name``."""
    return folder.name == name or package_name(folder) == name


def package_name(folder: Path) -> str:
    """Return the name in the ``package.xml`` of a folder; empty without one."""
    path = folder / "package.xml"
    if not path.is_file():
        return ""
    try:
        text = read_limited(path, MAX_PACKAGE_XML, "a package.xml")
    except BadInput:
        return ""
    found = re.search(rb"<name>\s*([^<\s]+)\s*</name>", text)
    return found[1].decode("utf-8", "replace") if found else ""


def find_file(uri: str, source: Path, packages: PackagePath, access: FileAccess = OWNER) -> Path:
    """Resolve a path or URI written in ``source`` as ``uri``; raises FileNotAllowed if it may not refer to it.

    The file need not exist. A file of a package must be inside it, after following links: a link may lead to another
    copy of the same package, as in a workspace built with symlinks.
    """
    scheme, colon, rest = uri.partition("://")
    if not colon:
        path = (source.parent / os.path.expanduser(uri)) if access.folders is None else source.parent / uri
    elif scheme == "file":
        path = Path(rest)
        if not path.is_absolute():
            path = source.parent / rest
    elif scheme in ("package", "model"):
        name, _, inner = rest.partition("/")
        folder = packages.find(name, source, scheme)
        path = folder / inner.lstrip("/")
        _check_inside(path, folder, name, uri)
    else:
        raise FileNotAllowed(f"{uri[:200]!r}: a file is given by package://, model://, file:// or a path")
    access.check(path, uri)
    return Path(os.path.abspath(path))


def _check_inside(path: Path, folder: Path, name: str, uri: str) -> None:
    real = Path(os.path.realpath(path))
    if real.is_relative_to(os.path.realpath(folder)) and Path(os.path.abspath(path)).is_relative_to(
        os.path.abspath(folder)
    ):
        return
    if Path(os.path.abspath(path)).is_relative_to(os.path.abspath(folder)) and any(
        package_name(each) == name for each in real.parents
    ):
        return
    raise FileNotAllowed(f"{uri[:200]} leads out of the package {name}, to {real}")


def _packages_below(folder: Path, name: str) -> Iterator[Path]:
    """Yield those of the folder and its subfolders that are the package; as in rospack, packages are not nested."""
    pending, seen = [(folder, 0)], 0
    while pending and seen < MAX_FOLDERS:
        here, depth = pending.pop(0)
        seen += 1
        own = package_name(here)
        if own == name:
            yield here
        if own or depth >= MAX_DEPTH:
            continue
        try:
            with os.scandir(here) as entries:
                below = [each.path for each in entries if each.is_dir() and not each.name.startswith(".")]
        except OSError:
            continue
        pending += [(Path(each), depth + 1) for each in sorted(below)]
