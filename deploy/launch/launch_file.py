"""Reads a launch file with its includes as roslaunch does, into nodes, parameters and notes."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from deploy.launch.launch_values import (
    Description,
    command_output,
    convert_value,
    plain,
    read_parameters,
    read_text,
)
from deploy.launch.launch_xml import LaunchElement, read_launch_xml
from deploy.launch.packages import STAND_INS, LaunchPackages
from deploy.launch.substitution import Substitution, truth
from deploy.rosparam_tree import Tree, get_parameter, parameter_tree, set_parameter
from messages.names import BadName, parse_remap
from services.runtime.errors import BadInput, did_you_mean, unknown_name
from services.script.inspect_script import legal_node_name

MAX_INCLUDES = 500
"""Maximum number of includes of one launch file in total."""
MAX_DEPTH = 40
"""Maximum depth of includes."""

_CONDITION = {"if": False, "unless": False}
_FOUND = re.compile(r"\$\(find\s+([\w.-]+)\s*\)")
"""The package with which a path begins."""
TAGS = ("arg", "param", "rosparam", "node", "include", "group", "remap", "env", "machine", "test", "master")


@dataclass(frozen=True)
class LaunchNode:
    """A ``<node>`` or ``<test>``: ``args`` are as written, ``where`` is its file and line."""

    package: str
    type: str
    name: str
    namespace: str
    args: str
    where: str
    remaps: tuple[tuple[str, str], ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    respawn: bool = False
    respawn_delay: float = 0.0
    required: bool = False
    cwd: str = ""
    screen: bool = False
    prefix: str = ""
    test: str = ""
    time_limit: float = 60.0

    @property
    def node(self) -> str:
        """Its absolute name."""
        return join_names(self.namespace, self.name)

    @property
    def what(self) -> str:
        """``package/type``, as people call it."""
        return f"{self.package}/{self.type}"

    @property
    def words(self) -> list[str]:
        """``args`` split as by a shell; raises BadInput, with file and line."""
        try:
            return shlex.split(self.args)
        except ValueError as error:
            raise BadInput(f"{self.where}: the args of {self.name} cannot be read: {error}") from None


@dataclass(frozen=True)
class LoadedFile:
    """A YAML file loaded below a namespace, with its content."""

    namespace: str
    file: Path
    tree: Tree

    def sets(self, name: str) -> bool:
        """Return whether it sets a parameter or a table of parameters, by its absolute name."""
        prefix = self.namespace.rstrip("/") + "/"
        return name.startswith(prefix) and find_parameter(self.tree, name.removeprefix(prefix)) is not None

    def agrees(self, tree: Tree, names: Iterable[str]) -> bool:
        """Return whether it and the whole tree have the same values under these absolute names."""
        own: Tree = {}
        set_parameter(own, self.namespace, self.tree)
        return all(find_parameter(own, each) == find_parameter(tree, each) for each in names)


@dataclass
class Launch:
    """The content of a launch file. ``descriptions`` are parameters set from robot files, by absolute name."""

    path: Path
    nodes: list[LaunchNode] = field(default_factory=list)
    tests: list[LaunchNode] = field(default_factory=list)
    parameters: Tree = field(default_factory=dict)
    descriptions: dict[str, Description] = field(default_factory=dict)
    loaded: list[LoadedFile] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    """The reasons for omitted includes: their packages are missing."""
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Add a note for the user, once."""
        if text not in self.notes:
            self.notes.append(text)

    def search_parameter(self, namespace: str, key: str) -> Any:
        """Return the value of the nearest parameter of this name from a namespace upwards; None if there is none."""
        parts = [each for each in namespace.split("/") if each]
        for count in range(len(parts), -1, -1):
            here: Any = self.parameters
            for part in (*parts[:count], key):
                here = here.get(part) if isinstance(here, dict) else None
            if here is not None:
                return here
        return None


@dataclass(frozen=True)
class Argument:
    """An ``<arg>`` of a launch file: ``default`` is None if it is required; ``value`` if it is fixed."""

    name: str
    default: str | None
    value: str | None
    doc: str
    where: str


@dataclass(frozen=True)
class _Scope:
    """Namespace, remaps, environment and private parameters at a point of a launch file; a group has its own."""

    namespace: str
    remaps: list[tuple[str, str]]
    environment: list[tuple[str, str]]
    private: list[tuple[str, Any]]

    def inner(self, namespace: str) -> _Scope:
        return replace(
            self,
            namespace=namespace,
            remaps=list(self.remaps),
            environment=list(self.environment),
            private=list(self.private),
        )


def read_launch(path: Path, arguments: Mapping[str, str], packages: LaunchPackages) -> Launch:
    """Read a launch file with the command line's arguments; raises BadInput, with file and line.

    As in ROS, its names are in the namespace ``__ns``, else in that of ROS_NAMESPACE.
    """
    launch = Launch(path)
    reader = _Reader(launch, packages)
    given = dict(arguments)
    root = join_names("/", given.pop("__ns", os.environ.get("ROS_NAMESPACE", "")))
    reader.file(path, _Scope(root, [], [], []), given, depth=0)
    for name in given:
        if name not in reader.used:
            known = [each.name for each in declared_arguments(path)]
            launch.note(f"{name}:= is given, and {path.name} has no <arg> of this name{did_you_mean(name, known)}")
    _check_names(launch)
    return launch


def declared_arguments(path: Path) -> list[Argument]:
    """Return the arguments that a launch file declares, including those in groups; raises BadInput."""

    def below(element: LaunchElement) -> Iterator[LaunchElement]:
        for each in element.children:
            if each.tag == "arg":
                yield each
            elif each.tag == "group":
                yield from below(each)

    found: dict[str, Argument] = {}
    for each in below(read_launch_xml(path)):
        has = each.attributes
        name = has.get("name", "")
        found.setdefault(name, Argument(name, has.get("default"), has.get("value"), has.get("doc", ""), each.where))
    return list(found.values())


def find_parameter(tree: Tree, name: str) -> Any:
    """Return the value or branch of an absolute name; None if there is none."""
    try:
        return get_parameter(tree, name)
    except KeyError:
        return None


def join_names(namespace: str, name: str) -> str:
    """Return a name in a namespace; an absolute name stays."""
    if name.startswith("/"):
        return "/" + "/".join(part for part in name.split("/") if part)
    return "/" + "/".join(part for part in (*namespace.split("/"), *name.split("/")) if part)


def _check_names(launch: Launch) -> None:
    places: dict[str, str] = {}
    for each in launch.nodes:
        if each.node in places:
            raise BadInput(
                f"{each.where}: a node {each.node} is already started at {places[each.node]}: names are unique"
            )
        places[each.node] = each.where


class _Reader:
    """The state of a read: the launch under construction, and the open files."""

    def __init__(self, launch: Launch, packages: LaunchPackages) -> None:
        self.launch, self.packages = launch, packages
        self.used: set[str] = set()
        self._open: list[Path] = []
        self._includes = 0
        self._anonymous: dict[str, str] = {}

    def file(self, path: Path, scope: _Scope, given: Mapping[str, str], depth: int) -> set[str]:
        """Read a file with the arguments ``given`` to it; return those that it declares.

        An included file can use arguments that it does not declare, as in ROS.
        """
        root = read_launch_xml(path)
        arguments: dict[str, str] = dict(given) if depth else {}
        context = _File(
            self,
            Substitution(self.packages.find, path.parent, arguments, anonymous=self._anonymous),
            arguments,
            dict(given),
            depth,
        )
        self._open.append(path)
        context.children(root, scope)
        self._open.pop()
        if depth == 0:
            self.used |= context.declared
        return context.declared

    def include(
        self, element: LaunchElement, path: Path, scope: _Scope, given: Mapping[str, str], depth: int
    ) -> set[str]:
        """Read an included file."""
        self._includes += 1
        if depth > MAX_DEPTH or self._includes > MAX_INCLUDES:
            chain = " -> ".join(each.name for each in self._open[-4:])
            loop = (
                f"{path.name} includes itself: {chain} -> {path.name}" if path in self._open else f"{chain} -> {path}"
            )
            element.fail(f"too many includes (at most {MAX_DEPTH} deep, {MAX_INCLUDES} in all): {loop}")
        return self.file(path, scope, given, depth)


class _File:
    """A file being read: its arguments and substitutions."""

    def __init__(
        self, reader: _Reader, substitution: Substitution, arguments: dict[str, str], given: dict[str, str], depth: int
    ) -> None:
        self._reader, self._launch, self._substitution = reader, reader.launch, substitution
        self._arguments, self._given, self._depth = arguments, given, depth
        self._places: dict[str, str] = {}
        self.declared: set[str] = set()

    def children(self, parent: LaunchElement, scope: _Scope) -> None:
        if parent.text.strip() and parent.tag in ("launch", "group", "include"):
            text = " ".join(parent.text.split())[:60]
            self._launch.note(f"{parent.where}: the text {text!r} in <{parent.tag}> is not an element; it is left out")
        for element in parent.children:
            if self._holds(element):
                self._element(element, scope)

    def _element(self, element: LaunchElement, scope: _Scope) -> None:
        match element.tag:
            case "arg":
                self._arg(element)
            case "param":
                self._param(element, scope.namespace, scope)
            case "rosparam":
                self._rosparam(element, scope.namespace)
            case "node" | "test":
                self._node(element, scope)
            case "include":
                self._include(element, scope)
            case "group":
                self._check(element, {**_CONDITION, "ns": False, "clear_params": False})
                places, arguments = dict(self._places), dict(self._arguments)
                self.children(element, scope.inner(self._namespace(element, scope)))
                self._places = places
                self._arguments.clear()  # the substitutions share this dict
                self._arguments.update(arguments)
            case "remap":
                scope.remaps.append(self._remap(element))
            case "env":
                scope.environment.append(self._env(element))
            case "machine":
                self._machine(element)
            case "master":
                pass
            case _:
                self._unknown(element, TAGS)

    def _check(self, element: LaunchElement, known: Mapping[str, bool]) -> None:
        for text in element.check_attributes(known):
            self._launch.note(text)

    def _unknown(self, element: LaunchElement, known: Sequence[str]) -> None:
        """Note an element that roslaunch ignores."""
        near = did_you_mean(element.tag, known)
        self._launch.note(f"{element.where}: <{element.tag[:40]}> is not a launch file's element{near}; it is ignored")

    def _get(self, element: LaunchElement, name: str, default: str = "") -> str:
        value = element.attributes.get(name)
        return default if value is None else self._substitution.resolve(value, element.where)

    def _flag(self, element: LaunchElement, name: str) -> bool:
        value = self._get(element, name)
        return truth(value, element.where, name) if value.strip() else False

    def _holds(self, element: LaunchElement) -> bool:
        has = element.attributes
        if "if" in has and "unless" in has:
            element.fail(f"<{element.tag}> has both if and unless: state one of them")
        if "if" in has:
            return self._condition(element, "if")
        return not self._condition(element, "unless") if "unless" in has else True

    def _condition(self, element: LaunchElement, name: str) -> bool:
        value = self._get(element, name)
        return truth(value, element.where, name)

    def _namespace(self, element: LaunchElement, scope: _Scope) -> str:
        return join_names(scope.namespace, self._name(element, "ns"))

    def _name(self, element: LaunchElement, attribute: str) -> str:
        """Return a namespace, with illegal characters replaced."""
        given = self._get(element, attribute).strip()
        parts = [legal_node_name(each) for each in given.split("/") if each]
        made = ("/" if given.startswith("/") else "") + "/".join(parts)
        if [each for each in given.split("/") if each] != parts:
            self._launch.note(f"{element.where}: the name {given!r} is not legal; {made!r} is used instead")
        return made

    def _arg(self, element: LaunchElement) -> None:
        self._check(element, {**_CONDITION, "name": True, "default": False, "value": False, "doc": False})
        name = self._get(element, "name")
        if name in self._places:
            element.fail(f"<arg> {name!r} is already declared at {self._places[name]}")
        if {"default", "value"} <= set(element.attributes):
            element.fail(f"<arg> {name!r} has both default and value: default may be overridden, value may not")
        self._places[name] = element.where
        self.declared.add(name)
        if "value" in element.attributes:
            if name in self._given:
                self._launch.note(f"{element.where}: <arg> {name!r} has a fixed value: {name}:= does not change it")
            self._arguments[name] = self._get(element, "value")
        elif name in self._given:
            self._arguments[name] = self._given[name]
        elif "default" in element.attributes:
            self._arguments[name] = self._get(element, "default")
        else:
            doc = f" ({element.attributes['doc']})" if element.attributes.get("doc") else ""
            element.fail(f"<arg> {name!r}{doc} has no default and must be given: {name}:=VALUE")

    def _param(self, element: LaunchElement, namespace: str, scope: _Scope | None) -> None:
        known = ("value", "type", "textfile", "binfile", "command")
        self._check(element, {**_CONDITION, "name": True, **dict.fromkeys(known, False)})
        name = self._get(element, "name")
        sources = [each for each in ("value", "textfile", "binfile", "command") if each in element.attributes]
        if len(sources) != 1:
            element.fail(
                f"<param> {name!r} needs one of value, textfile and command, not {' and '.join(sources) or 'none'}"
            )
        where, value = element.where, self._value(element, name)
        if name.startswith("~"):
            if scope is None:
                name = name[1:].lstrip("/")
            else:
                scope.private.append((name[1:].lstrip("/"), value))
                return
        self._set(join_names(namespace, name), value, where)

    def _value(self, element: LaunchElement, name: str) -> Any:
        kind, where = self._get(element, "type", "auto").strip().lower(), element.where
        if "binfile" in element.attributes:
            element.fail(f"<param> {name!r}: binfile is not supported: use textfile or value")
        if "value" in element.attributes:
            return convert_value(self._get(element, "value").strip(), kind, where)
        if "command" in element.attributes:
            found = command_output(self._get(element, "command"), where)
        else:
            file = Path(self._get(element, "textfile"))
            if file.suffix == ".urdf":
                return Description(file)
            try:
                found = read_text(file)
            except BadInput as error:
                element.fail(f"<param> {name!r}: {error}")
        return found if isinstance(found, Description) else convert_value(found, kind, where)

    def _set(self, key: str, value: Any, where: str) -> None:
        if isinstance(value, Description):
            self._launch.descriptions[key] = value
            return
        self._launch.descriptions.pop(key, None)
        made = parameter_tree({"value": value}, where)["value"] if isinstance(value, dict) else value
        set_parameter(self._launch.parameters, key, plain(made, where))

    def _rosparam(self, element: LaunchElement, namespace: str) -> None:
        known = ("command", "file", "param", "ns", "subst_value")
        self._check(element, {**_CONDITION, **dict.fromkeys(known, False)})
        command = self._get(element, "command", "load")
        if command not in ("load", "dump", "delete"):
            raise unknown_name("command of <rosparam>", command, ("load", "dump", "delete"), element.where)
        if command == "dump":
            self._launch.note(f'{element.where}: <rosparam command="dump"> is left out: ./elea up writes rosparam.json')
            return
        space = join_names(namespace, self._get(element, "ns"))
        param = self._get(element, "param")
        key = join_names(space, param[1:].lstrip("/") if param.startswith("~") else param)
        if command == "delete":
            return  # roslaunch deletes before it sets, and the tree is empty at first
        text, where = element.text, element.where
        file = self._get(element, "file")
        if file:
            if text.strip():
                element.fail("<rosparam> has both a file and a text: state one of them")
            try:
                text = read_text(Path(file))
            except BadInput as error:
                element.fail(f"<rosparam>: {error}")
            where = file
        made = text
        if self._flag(element, "subst_value") or (
            not file and "$(" in text and "subst_value" not in element.attributes
        ):
            made = self._resolve_lines(text, element)
        value = read_parameters(made, where)
        if value in (None, ""):
            return
        if not isinstance(value, dict) and key == space:
            element.fail(f"<rosparam> has a single value, {str(value)[:60]!r}: param names it")
        if file and isinstance(value, dict) and made == text:
            self._launch.loaded.append(LoadedFile(key, Path(file), value))
        self._set(key, value, where)

    def _resolve_lines(self, text: str, element: LaunchElement) -> str:
        return "\n".join(self._substitution.resolve(line, element.where) for line in text.split("\n"))

    def _remap(self, element: LaunchElement) -> tuple[str, str]:
        self._check(element, {**_CONDITION, "from": True, "to": True})
        origin, target = self._get(element, "from").strip(), self._get(element, "to").strip()
        try:
            parse_remap(f"{_clean(origin)}:={_clean(target)}")
        except BadName as error:
            element.fail(f"<remap>: {error}")
        return _clean(origin), _clean(target)

    def _env(self, element: LaunchElement) -> tuple[str, str]:
        self._check(element, {**_CONDITION, "name": True, "value": True})
        return self._get(element, "name"), self._get(element, "value")

    def _machine(self, element: LaunchElement) -> None:
        address = self._get(element, "address", "localhost")
        if address not in ("localhost", "127.0.0.1"):
            element.fail(
                f"<machine> {self._get(element, 'name')!r}: nodes are not started elsewhere ({address}): start "
                "a fleet there, and join it with ./elea up --connect"
            )

    def _node(self, element: LaunchElement, scope: _Scope) -> None:
        test = element.tag == "test"
        own = ("test-name", "time-limit", "retry") if test else ("respawn", "respawn_delay", "required", "output")
        known = (*own, "name", "args", "ns", "machine", "clear_params", "launch-prefix", "cwd", "output")
        needed = {"pkg": True, "type": True, **({"test-name": True} if test else {"name": True})}
        self._check(element, {**_CONDITION, **dict.fromkeys(known, False), **needed})
        name = self._get(element, "name") or self._get(element, "test-name")
        legal = legal_node_name(name)
        if not legal:
            element.fail(f"<{element.tag}>: {name!r} is not a valid node name")
        if legal != name:
            self._launch.note(f"{element.where}: the node's name {name!r} is not legal; {legal!r} is used instead")
        namespace = self._namespace(element, scope)
        if "machine" in element.attributes and self._get(element, "machine") not in ("", "localhost"):
            self._launch.note(f"{element.where}: machine={self._get(element, 'machine')!r}: all nodes run on this one")
        inside = scope.inner(namespace)
        self._inside_node(element, inside, join_names(namespace, legal))
        if self._flag(element, "respawn") and self._flag(element, "required"):
            element.fail(f"<node> {name!r} cannot be both respawn and required")
        node = LaunchNode(
            package=self._get(element, "pkg").strip(),
            type=self._get(element, "type").strip(),
            name=legal,
            namespace=namespace,
            args=_arguments(self._get(element, "args")),
            where=element.where,
            remaps=tuple(dict(inside.remaps).items()),
            environment=tuple(dict(inside.environment).items()),
            respawn=self._flag(element, "respawn"),
            respawn_delay=self._seconds(element, "respawn_delay", 0.0),
            required=self._flag(element, "required"),
            cwd=self._get(element, "cwd"),
            screen=self._get(element, "output") == "screen",
            prefix=self._get(element, "launch-prefix"),
            test=self._get(element, "test-name"),
            time_limit=self._seconds(element, "time-limit", 60.0),
        )
        (self._launch.tests if test else self._launch.nodes).append(node)

    def _inside_node(self, element: LaunchElement, scope: _Scope, node: str) -> None:
        for name, value in scope.private:
            self._set(join_names(node, name), value, element.where)
        for each in element.children:
            if not self._holds(each):
                continue
            match each.tag:
                case "param":
                    self._param(each, node, None)
                case "rosparam":
                    self._rosparam(each, node)
                case "remap":
                    scope.remaps.append(self._remap(each))
                case "env":
                    scope.environment.append(self._env(each))
                case _:
                    self._unknown(each, ("param", "rosparam", "remap", "env"))

    def _seconds(self, element: LaunchElement, name: str, default: float) -> float:
        value = self._get(element, name)
        try:
            return float(value) if value else default
        except ValueError:
            element.fail(f"{name}={value[:40]!r} is not a number of seconds")

    def _include(self, element: LaunchElement, scope: _Scope) -> None:
        known = ("ns", "clear_params", "pass_all_args")
        self._check(element, {**_CONDITION, "file": True, **dict.fromkeys(known, False)})
        if self._leave_out(element):
            return
        inner = scope.inner(self._namespace(element, scope))
        everything = self._flag(element, "pass_all_args")
        given, stated = (dict(self._arguments) if everything else {}), set()
        for each in element.children:
            if not self._holds(each):
                continue
            if each.tag == "env":
                inner.environment.append(self._env(each))
            elif each.tag == "arg":
                self._check(each, {**_CONDITION, "name": True, "value": False, "default": False, "doc": False})
                name = self._get(each, "name")
                if not {"value", "default"} & set(each.attributes):
                    each.fail(f"<arg> {name!r} of an include needs a value")
                given[name] = self._get(each, "value" if "value" in each.attributes else "default")
                stated.add(name)
            else:
                self._unknown(each, ("arg", "env"))
        file = Path(self._get(element, "file").strip())
        try:
            path = self._reader.packages.included(file if file.is_absolute() else self._substitution.folder / file)
        except BadInput as error:
            element.fail(f"<include>: {error}")
        declared = self._reader.include(element, path, inner, given, self._depth + 1)
        unused = sorted(stated - declared)
        if unused and not path.is_relative_to(STAND_INS):
            near = did_you_mean(unused[0], declared)
            element.fail(
                f"<include>: {path.name} has no <arg> {unused[0]!r}{near} (it has {', '.join(sorted(declared))})"
            )

    def _leave_out(self, element: LaunchElement) -> bool:
        """Omit the include of a file whose package is missing, as its nodes would be; return whether it was omitted."""
        for name in _FOUND.findall(element.attributes["file"]):
            try:
                self._reader.packages.find(name)
            except BadInput as error:
                self._launch.missing.append(f"{element.where}: {error}")
                self._launch.note(f"{element.where}: the include of {element.attributes['file']} is left out: {error}")
                return True
        return False


def _arguments(text: str) -> str:
    """Return a node's arguments in one line, with the blanks that quotes or backslashes may protect."""
    return re.sub(r"\s", " ", text).strip() if set(text) & set("'\"\\") else " ".join(text.split())


def _clean(name: str) -> str:
    """Return a name without the double and trailing slashes, which ROS removes."""
    private, rest = ("~", name[1:]) if name.startswith("~") else ("", name)
    body = "/".join(part for part in rest.split("/") if part)
    return f"{private}{'/' if rest.startswith('/') and body and not private else ''}{body}"
