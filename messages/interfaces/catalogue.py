"""The catalogue: all known message, service and action types by name, in the form of ROS 1 or ROS 2."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from messages.errors import BadInput, did_you_mean
from messages.interfaces import standard
from messages.interfaces.definition import (
    SIMPLE,
    TIMES,
    ActionDefinition,
    BadDefinition,
    Definitions,
    MessageDefinition,
    ServiceDefinition,
    parse_action,
    parse_message,
    parse_service,
    ros1_form,
    ros2_form,
    short_type_name,
)

Ros = Literal[1, 2]
Kind = Literal["msg", "srv", "action"]
KINDS: tuple[Kind, ...] = "msg", "srv", "action"

MOST_FILES = 2000
"""Maximum number of definitions of a workspace package."""
LARGEST_FILE = 1 << 20
"""Maximum size of a definition [bytes]."""
LONGEST_ARRAY = 1_000_000
"""Maximum length of a fixed-size array, since decoding creates as many values."""
DEEPEST = 16
"""Maximum levels of nested types; ROS has five."""

SERVICE_PARTS = "Request", "Response"
ACTION_PARTS = "ActionGoal", "ActionResult", "ActionFeedback", "Action", "Goal", "Result", "Feedback"
SEPARATOR = "=" * 80


class UnknownType(BadInput, LookupError):
    """No package defines this type; the text names similar ones."""


def _stated_folders(folder: Path) -> dict[Kind, list[str]]:
    """Return the folders, relative to the package's, that ``add_message_files(DIRECTORY …)`` and the like name."""
    found: dict[Kind, list[str]] = {kind: [] for kind in KINDS}
    try:
        with (folder / "CMakeLists.txt").open(encoding="utf-8", errors="replace") as file:
            text = re.sub(r"#.*", "", file.read(LARGEST_FILE))
    except OSError:
        return found
    names: dict[str, Kind] = {"message": "msg", "service": "srv", "action": "action"}
    for name, words in re.findall(r"\badd_(message|service|action)_files\s*\(([^)]*)\)", text, re.IGNORECASE):
        for each in re.findall(r"\bDIRECTORY\s+\"?([\w./-]+)", words):
            if ".." not in Path(each).parts and not Path(each).is_absolute():
                found[names[name.lower()]].append(each)
    return found


@dataclass(frozen=True)
class _Package:
    """A package: its definitions by file name (``Twist.msg``), as texts or paths."""

    name: str
    files: Mapping[str, tuple[str, str] | Path]

    def source(self, file: str, ros: Ros) -> tuple[str, str]:
        """Return the text of a definition, and its file or name for errors."""
        found = self.files[file]
        if isinstance(found, tuple):
            return found[ros - 1], f"{self.name}/{file}"
        try:
            if found.stat().st_size > LARGEST_FILE:
                raise BadDefinition(f"{found}: a definition has at most {LARGEST_FILE} bytes")
            return found.read_text(encoding="utf-8-sig"), str(found)
        except OSError as error:
            raise BadDefinition(f"{found}: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError as error:
            raise BadDefinition(f"{found}: it is not UTF-8: {error.reason} at byte {error.start}") from None


@dataclass
class Catalogue:
    """Type definitions by name; a workspace package takes precedence over the standard package of the same name.

    ``locate`` finds the folder of a package by name, or returns None.
    """

    locate: Callable[[str], Path | None] = lambda name: None
    _packages: dict[str, _Package | None] = field(default_factory=dict)
    _messages: dict[tuple[str, Ros], MessageDefinition] = field(default_factory=dict)
    _sums: dict[str, str] = field(default_factory=dict)

    def packages(self) -> list[str]:
        """Return the sorted names of the known packages; those found by ``locate`` are known after their first use."""
        found = {name for name, package in self._packages.items() if package is not None}
        return sorted(found | standard.packages())

    def add_package(self, name: str, folder: Path) -> bool:
        """Add the definitions in ``msg/``, ``srv/`` and ``action/`` of a package's folder, and in the folders that its
        ``CMakeLists.txt`` names; return False if there are none.

        They are read on first use. Raises BadInput if there are more than MOST_FILES.
        """
        files: dict[str, tuple[str, str] | Path] = {}
        stated = _stated_folders(folder)
        for kind in KINDS:
            for each in (*stated[kind], kind):
                files |= {path.name: path for path in sorted((folder / each).glob(f"*.{kind}")) if path.is_file()}
        if len(files) > MOST_FILES:
            raise BadInput(f"{folder}: {len(files)} definitions, the limit is {MOST_FILES}")
        if files:
            self._packages[name] = _Package(name, files)
            self._forget(name)
        return bool(files)

    def has_package(self, name: str) -> bool:
        """Whether a package with definitions is known or can be located."""
        return self._package(name) is not None

    def types(self, package: str, kind: Kind) -> list[str]:
        """Return the names of a package's types of a kind, without the package name; empty if there are none."""
        found = self._package(package)
        return sorted(Path(file).stem for file in found.files if file.endswith(f".{kind}")) if found else []

    def all_types(self, kind: Kind) -> list[str]:
        """Return all types of a kind in the known packages, as ``pkg/Type``."""
        return [f"{package}/{name}" for package in self.packages() for name in self.types(package, kind)]

    def message(self, name: str, ros: Ros = 1) -> MessageDefinition:
        """Return a message type, or a part of a service or action (``pkg/TypeRequest``, ``pkg/TypeGoal``).

        Raises UnknownType, or BadDefinition with file and line.
        """
        name = short_type_name(name)
        if (known := self._messages.get((name, ros))) is None:
            form = ros1_form if ros == 1 else ros2_form
            known = self._messages[name, ros] = form(self._read_message(name, ros))
        return known

    def service(self, name: str, ros: Ros = 1) -> ServiceDefinition:
        """Return a service type; raises UnknownType or BadDefinition."""
        name = name.replace("/srv/", "/", 1)
        read = parse_service(name, *self._source(name, "srv", ros))
        form = ros1_form if ros == 1 else ros2_form
        return ServiceDefinition(name, form(read.request), form(read.response))

    def action(self, name: str, ros: Ros = 1) -> ActionDefinition:
        """Return an action type; raises UnknownType or BadDefinition."""
        name = name.replace("/action/", "/", 1)
        read = parse_action(name, *self._source(name, "action", ros))
        form = ros1_form if ros == 1 else ros2_form
        parts = form(read.goal), form(read.result), form(read.feedback)
        return ActionDefinition(name, *parts, tuple(form(each) for each in read.messages))

    def closure(self, name: str, ros: Ros = 1) -> dict[str, MessageDefinition]:
        """Return a type and all types that it uses, in order of first use; raises UnknownType or BadDefinition."""
        found: dict[str, MessageDefinition] = {}
        self._collect(self.message(name, ros), ros, found, ())
        return found

    def definitions(self, name: str) -> Definitions:
        """Return the fields of a type and of all types it uses, in ROS 2's form; raises UnknownType, BadDefinition."""
        return {each: definition.fields for each, definition in self.closure(name, 2).items()}

    def md5(self, name: str) -> str:
        """Return the MD5 sum by which ROS 1 identifies a version of a message or service type; raises UnknownType."""
        name = short_type_name(name)
        if (known := self._sums.get(name)) is None:
            package, _, own = name.partition("/")
            found = self._package(package)
            if found and f"{own}.srv" in found.files and f"{own}.msg" not in found.files:
                text = "".join(self._sum_text(each) for each in self.service(name).messages)
            else:
                text = self._sum_text(self.message(name))
            known = self._sums[name] = hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()
        return known

    def full_text(self, name: str) -> str:
        """Return the ROS 1 definition of a message type, followed by those of all types that it uses."""
        texts = [
            definition.text if not index else f"MSG: {each}\n{definition.text}"
            for index, (each, definition) in enumerate(self.closure(name).items())
        ]
        return f"\n{SEPARATOR}\n".join(texts)

    def _package(self, name: str) -> _Package | None:
        if name not in self._packages:
            folder = self.locate(name)
            if folder is None or not self.add_package(name, folder):
                known = name in standard.packages()
                self._packages[name] = _Package(name, standard.texts(name)) if known else None
        return self._packages[name]

    def _forget(self, package: str) -> None:
        self._messages = {key: each for key, each in self._messages.items() if key[0].partition("/")[0] != package}
        self._sums = {}

    def _source(self, name: str, kind: Kind, ros: Ros) -> tuple[str, str]:
        package, _, own = name.partition("/")
        found = self._package(package)
        if found is None:
            raise UnknownType(f"unknown package {package[:80]!r}{did_you_mean(package, self.packages())}")
        if (file := f"{own}.{kind}") not in found.files:
            words = {"msg": "message", "srv": "service", "action": "action"}
            near = did_you_mean(name, self._names(found))
            raise UnknownType(f"{package} has no {words[kind]} {own[:80]!r}{near}")
        return found.source(file, ros)

    def _names(self, package: _Package) -> list[str]:
        found = []
        for file in package.files:
            own, _, kind = file.partition(".")
            parts = {"srv": ("", *SERVICE_PARTS), "action": ACTION_PARTS}.get(kind, ("",))
            found += [f"{package.name}/{own}{part}" for part in parts]
        return found

    def _read_message(self, name: str, ros: Ros) -> MessageDefinition:
        package, _, own = name.partition("/")
        found = self._package(package)
        files: Iterable[str] = found.files if found else ()
        if f"{own}.msg" not in files:
            for part in SERVICE_PARTS:
                if f"{own.removesuffix(part)}.srv" in files and own.endswith(part):
                    service = self.service(name.removesuffix(part), ros)
                    return next(each for each in service.messages if each.name == name)
            for part in ACTION_PARTS:
                if f"{own.removesuffix(part)}.action" in files and own.endswith(part):
                    action = self.action(name.removesuffix(part), ros)
                    return next(each for each in action.messages if each.name == name)
        return parse_message(name, *self._source(name, "msg", ros))

    def _collect(
        self, definition: MessageDefinition, ros: Ros, found: dict[str, MessageDefinition], above: tuple[str, ...]
    ) -> None:
        if definition.name in above:
            raise BadDefinition(f"{definition.name} contains itself: {' -> '.join((*above, definition.name))}")
        if len(above) > DEEPEST:
            raise BadDefinition(f"{above[0]}: types are nested more than {DEEPEST} levels deep")
        known = definition.name in found
        found.setdefault(definition.name, definition)
        if known:
            return
        for each in definition.fields:
            if (each.extent is not None and not -1 <= each.extent <= LONGEST_ARRAY) or each.extent == 0:
                place = self._place(definition.name, each.name)
                raise BadDefinition(f"{place}: an array of {each.extent} values; the limits are 1 and {LONGEST_ARRAY}")
            if each.type in SIMPLE or each.type in TIMES:
                continue
            try:
                nested = self.message(each.type, ros)
            except UnknownType as error:
                raise UnknownType(f"{self._place(definition.name, each.name)}: {error}") from None
            self._collect(nested, ros, found, (*above, definition.name))

    def _place(self, name: str, field_name: str) -> str:
        """Return the file and line where a field is defined, or ``type.field``."""
        package, _, own = name.partition("/")
        found = self._package(package)
        for file, source in (found.files if found else {}).items():
            stem = file.partition(".")[0]
            if isinstance(source, Path) and own in (stem, *(stem + part for part in (*SERVICE_PARTS, *ACTION_PARTS))):
                for number, line in enumerate(source.read_text(errors="replace").splitlines(), 1):
                    if line.partition("#")[0].split()[1:2] == [field_name]:
                        return f"{source}:{number}"
                return str(source)
        return f"{name}.{field_name}"

    def _sum_text(self, definition: MessageDefinition) -> str:
        """Return the text of which genmsg computes the MD5 sum: constants, then fields with the sums of their types."""
        self.closure(definition.name)
        lines = [str(each) for each in definition.constants]
        for each in definition.fields:
            simple = each.type in SIMPLE or each.type in TIMES
            lines.append(str(each) if simple else f"{self.md5(each.type)} {each.name}")
        return "\n".join(lines)


@cache
def standard_catalogue() -> Catalogue:
    """Return the standard packages alone, without those of a workspace."""
    return Catalogue()


@cache
def catalogue() -> Catalogue:
    """Return the catalogue of this process."""
    return Catalogue()
