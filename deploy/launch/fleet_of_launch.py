"""Converts a launch file to a fleet file: spawned models to robots, nodes to services, parameters to a tree."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import tomli_w

from deploy.launch import known_nodes
from deploy.launch.launch_file import Launch, LaunchNode, find_parameter, join_names
from deploy.launch.packages import STAND_INS, LaunchPackages
from deploy.launch.robots import (
    Spawn,
    diff_drive_controllers,
    is_robot,
    is_spawn,
    known_model,
    node_folder,
    read_spawn,
    robot_table,
)
from deploy.rosparam import DESCRIPTION
from deploy.rosparam_tree import set_parameter
from deploy.service_parameters import BUILTIN_SERVICES
from models import WORLDS
from models.robot_source import resolve_robot
from models.world import read_world
from services.catalog import script_api
from services.runtime.errors import BadInput, did_you_mean
from services.script.inspect_script import imported_modules, read_script

WORLD_NAMES = (("turtlebot3_house", "house"), ("turtlebot3_stage", "arena"), ("turtlebot3_world", "arena"))
"""Worlds of ours that replace well-known ones whose files are missing."""

RESERVED = (*BUILTIN_SERVICES, "supervisor", "logger", "panel", "recorder")
"""Names of nodes in the root namespace that fleets have: every fleet, or those with a viewer, a panel or a bag."""
TERMINAL_MODULES = frozenset(
    ["termios", "tty", "curses", "pynput", "keyboard", "msvcrt", "readchar", "getch", "getkey"]
)
"""Modules that read keys: a program that imports one needs its own terminal."""

INTERPRETERS = ("xterm", "gnome-terminal", "konsole", "gdb", "valgrind", "bash", "sh")


@dataclass
class FleetOfLaunch:
    """A fleet file as a table, with ``notes`` for the user and ``by_hand``, commands to type.

    ``has_gazebo``: the launch file starts a world; one without may join a running fleet.
    """

    table: dict[str, Any]
    has_gazebo: bool
    notes: list[str] = field(default_factory=list)
    by_hand: list[str] = field(default_factory=list)

    def show_programs(self) -> None:
        """Show the output of all programs."""
        for service in self.table.get("service", ()):
            if "/" in service["kind"]:
                service["output"] = "screen"

    def toml(self) -> str:
        """Return the fleet file as text, with the notes above it."""
        notes = [f"# {line}\n" for note in (*self.notes, *self.by_hand) for line in note.splitlines()]
        return "".join(notes) + ("\n" if notes else "") + _toml(self.table)


def fleet_of_launch(launch: Launch, packages: LaunchPackages, test: LaunchNode | None = None) -> FleetOfLaunch:
    """Convert a launch file, with one of its tests, to a fleet; raises BadInput, with file and line."""
    builder = _FleetBuilder(launch, packages)
    return builder.fleet() if test is None else builder.with_test(test)


def model_folders(packages: LaunchPackages) -> tuple[Path, ...]:
    """Return the folders for ``package://`` and ``model://``, including those that packages export to Gazebo."""
    folders = [*packages.workspace.packages().values(), *packages.workspace.roots]
    for folder in packages.workspace.packages().values():
        folders += _exported(folder, "gazebo_model_path")
        folders += [folder / "models"] if (folder / "models").is_dir() else []
    return tuple(dict.fromkeys(folders))


def _exported(folder: Path, attribute: str) -> list[Path]:
    """Return the folders that a package.xml exports to Gazebo: of models, or, with ``gazebo_media_path``, of worlds."""
    try:
        root = ElementTree.fromstring((folder / "package.xml").read_bytes())
    except (OSError, ElementTree.ParseError):
        return []
    exported = [each.get(attribute, "") for each in root.iter("gazebo_ros")]
    paths = [Path(part.replace("${prefix}", str(folder))) for text in exported for part in text.split(":") if part]
    return [each for each in paths if each.is_dir()]


class _FleetBuilder:
    """Builds the fleet of one launch file."""

    def __init__(self, launch: Launch, packages: LaunchPackages) -> None:
        self._launch, self._packages = launch, packages
        self._folders = model_folders(packages)
        self._services: list[dict[str, Any]] = []
        self._by_hand: list[str] = []
        self._tables: list[dict[str, Any]] = []
        self._loaded_controllers: dict[str, list[str]] = {}
        """The absolute names of the controllers that spawners load or start, by namespace."""
        self._spawns = [read_spawn(each, launch) for each in launch.nodes if is_spawn(each)]
        self._robots = [each for each in self._spawns if is_robot(each)]
        self._gazebo = [each for each in launch.nodes if known_nodes.is_gazebo(each)]

    def fleet(self) -> FleetOfLaunch:
        launch = self._launch
        if launch.missing and not launch.nodes:
            raise BadInput(launch.missing[0])
        table: dict[str, Any] = {"name": _fleet_name(launch.path), "description": f"Made of {launch.path}"}
        if world := self._world():
            table["world"] = world
        table["run"] = {"mode": "real", "ends": "never"}
        if self._folders:
            table["run"]["packages"] = [str(each) for each in self._folders]
        robots = self._tables = self._robot_tables()
        for node in launch.nodes:
            self._node(node)
        for namespace in self._loaded_controllers:
            if self._manager(namespace) is None:
                launch.note(f"there is no controller manager in {namespace}, since its spawners start no controller")
        if robots:
            table["robot"] = robots
        if self._services:
            table["service"] = self._services
        self._descriptions()
        if launch.parameters:
            table["rosparam"] = launch.parameters
        return FleetOfLaunch(table, bool(self._gazebo), launch.notes, self._by_hand)

    def with_test(self, test: LaunchNode) -> FleetOfLaunch:
        """Return the fleet with a test program whose end is that of the run."""
        path = self._packages.script(test.package, test.type)
        if path is None:
            raise BadInput(
                f"{test.where}: the test {test.what} cannot be run: it is not a Python program of a known package"
            )
        self._script(replace(test, required=True), path)
        made = self.fleet()
        made.table["run"] |= {"ends": "duration", "duration": test.time_limit}
        return made

    def _robot_tables(self) -> list[dict[str, Any]]:
        single = len(self._robots) == 1
        made = [(spawn, *robot_table(spawn, self._launch, single, self._folders)) for spawn in self._robots]
        tables = [table for _, table, _ in made]
        moving = [table for _, table, moves in made if moves]
        if not single and len(moving) == 1:
            moving[0].setdefault("frame_prefix", "")  # the others are objects
            made.sort(key=lambda each: not each[2])
        taken: set[str] = set()
        for spawn, table, _ in made:
            if table["namespace"] in taken:
                self._launch.note(
                    f"{spawn.node.where}: {table['name']} would share the topics in {table['namespace']} with "
                    f"another robot, so they are in /{table['name']} instead"
                )
                table["namespace"] = f"/{table['name']}"
            taken.add(table["namespace"])
        if not single and len(moving) != 1 and any("frame_prefix" not in each for each in tables):
            self._launch.note(
                "with several robots, each frame is prefixed with its robot's name, e.g. tb3_0/odom, to be unique"
            )
        return tables

    def _world(self) -> str:
        if not self._gazebo:
            return ""
        node = self._gazebo[0]
        given = known_nodes.world_argument(node)
        name = Path(given).name.removesuffix(".world").removesuffix(".sdf")
        if not given or name.startswith("empty") or name in WORLDS:
            return name if name in WORLDS else "empty"
        path = self._world_file(node, given)
        ours = next((world for text, world in WORLD_NAMES if text in name), "")
        if path.is_file():
            try:
                missing = read_world(str(path), packages=self._folders).missing
            except BadInput as error:
                if not ours:
                    raise BadInput(f"{node.where}: {error}") from None
                missing = (str(error),)
            if missing and ours:
                self._launch.note(f"the world {name} cannot be read ({missing[0]}); Elea's world {ours} replaces it")
                return ours
            for each in missing:
                self._launch.note(each)
            return str(path)
        if ours:
            self._launch.note(f"the world {name} is replaced by Elea's world {ours}")
            return ours
        package = self._package_of(path)
        if package is not None:
            near = did_you_mean(path.name, [each.name for each in path.parent.glob("*")])
            raise BadInput(f"{node.where}: there is no world {path}{near}")
        self._launch.note(f"the world {given} was not found; an empty ground replaces it")
        return "empty"

    def _world_file(self, node: LaunchNode, given: str) -> Path:
        """Return the path where Gazebo finds a world: a relative one in its resource path and in folders exported by
        packages.
        """
        set_by = dict(node.environment).get("GAZEBO_RESOURCE_PATH", os.environ.get("GAZEBO_RESOURCE_PATH", ""))
        folders = [node_folder(node), *map(Path, filter(None, set_by.split(os.pathsep)))]
        for package in self._packages.workspace.packages().values():
            folders += _exported(package, "gazebo_media_path")
        return next((each / given for each in folders if (each / given).is_file()), Path(given))

    def _package_of(self, path: Path) -> Path | None:
        own = self._packages.workspace.packages().values()
        return next((each for each in own if path.is_absolute() and path.is_relative_to(each)), None)

    def _node(self, node: LaunchNode) -> None:
        if node.prefix and node.prefix.split()[0].rpartition("/")[2] not in INTERPRETERS:
            self._launch.note(f"{node.where}: launch-prefix={node.prefix!r} is left out")
        if known_nodes.is_gazebo(node):
            if node.type == "gazebo":
                self._once({"kind": "logger"})
        elif is_spawn(node):
            self._spawn_object(next(each for each in self._spawns if each.node is node))
        elif known_nodes.is_viewer(node):
            self._once({"kind": "logger"})
            if node.package == "gazebo_ros":
                self._once({"kind": "panel"})
        elif known_nodes.is_panel(node):
            self._once({"kind": "panel"})
        elif (reason := known_nodes.lookup(known_nodes.NOTHING_TO_DO, node)) is not None:
            if reason:
                self._launch.note(f"{node.where}: {node.what} is left out: {reason}")
        elif (path := self._packages.script(node.package, node.type)) is not None:
            self._script(node, path)
        elif (command := known_nodes.lookup(known_nodes.KEYBOARDS, node)) is not None:
            self._keyboard(node, command)
        elif (make := self._service_of(node)) is not None:
            make(node)
        else:
            self._left_out(node)

    def _service_of(self, node: LaunchNode) -> Callable[[LaunchNode], None] | None:
        """Return the method that adds the service for a well-known node; None if there is none."""
        if known_nodes.is_static_transform(node):
            return self._static_transform
        if known_nodes.is_controller_spawner(node):
            return self._controllers
        if node.package == "robot_state_publisher":
            return self._state_publisher
        if node.package in ("joint_state_publisher", "joint_state_publisher_gui"):
            return self._joint_state_publisher
        if (node.package, node.type) == ("map_server", "map_server"):
            return self._map
        if (node.package, node.type) == ("turtlesim", "turtlesim_node"):
            return self._turtlesim
        return None

    def _script(self, node: LaunchNode, path: Path) -> None:
        if script_api(str(path)) == "ros2":
            self._skip(node, f"{path.name} is written for ROS 2, whose programs are not run yet")
            return
        if {each.partition(".")[0] for each in imported_modules(read_script(path))} & TERMINAL_MODULES:
            self._keyboard(node, f"./elea rosrun {node.package} {node.type} {node.args}".strip())
            return
        arguments = node.words
        service: dict[str, Any] = {"kind": str(path), "name": self._free_name(node)}
        if node.namespace != "/":
            service["namespace"] = node.namespace
        service |= {"args": arguments} if arguments else {}
        service |= {"remap": dict(node.remaps)} if node.remaps else {}
        service |= {"environment": dict(node.environment)} if node.environment else {}
        if node.cwd == "node":
            service["cwd"] = str(path.parent)
        service |= {"output": "screen"} if node.screen else {}
        self._services.append(service | self._supervision(node))

    def _supervision(self, node: LaunchNode) -> dict[str, Any]:
        """Return a node's supervision: roslaunch restarts one only with ``respawn``."""
        restart: Any = "never"
        if node.respawn:
            first = min(max(node.respawn_delay, 0.1), 60.0)
            restart = {"when": "always", "first": first, "longest": max(first, 5.0), "limit": 1000, "window": 60.0}
        return {"restart": restart, **({"required": True} if node.required else {})}

    def _add(self, node: LaunchNode, kind: str, parameters: dict[str, Any]) -> None:
        """Add one of Elea's services under the node's name."""
        service: dict[str, Any] = {"kind": kind, "name": self._free_name(node)}
        if node.namespace != "/":
            service["namespace"] = node.namespace
        service |= {"parameters": parameters} if parameters else {}
        service |= {"remap": dict(node.remaps)} if node.remaps else {}
        self._services.append(service)

    def _free_name(self, node: LaunchNode) -> str:
        """Return a node's name; if fleets have a node of this name, another one, to which private parameters are
        copied.
        """
        if node.namespace != "/" or node.name not in RESERVED:
            return node.name
        name, tree = f"{node.name}_node", self._launch.parameters
        if node.name in tree:
            tree.setdefault(name, tree[node.name])
        self._launch.note(f"{node.where}: fleets have a node /{node.name} of their own, so this one is /{name}")
        return name

    def _once(self, service: dict[str, Any]) -> None:
        if not any(each["kind"] == service["kind"] for each in self._services):
            self._services.append(service)

    def _keyboard(self, node: LaunchNode, command: str) -> None:
        if node.required:
            raise BadInput(f"{node.where}: {node.what} is required, and reads keys: it needs a terminal of its own")
        if command:
            self._by_hand.append(f"{node.what} reads keys and needs a terminal of its own: {command}")

    def _left_out(self, node: LaunchNode) -> None:
        if self._packages.on_disk(node.package) is None:
            near = did_you_mean(node.package, self._packages.names())
            why = known_nodes.NOT_HERE.get(node.package, f"there is no package {node.package!r}{near}")
        else:
            near = did_you_mean(node.type, self._packages.scripts(node.package))
            why = f"{node.package} has no Python program of this name{near}, and C++ is not run"
        self._skip(node, why)

    def _skip(self, node: LaunchNode, why: str) -> None:
        if node.required:
            raise BadInput(f"{node.where}: {node.what} is required, and cannot be run: {why}")
        self._launch.note(f"{node.where}: {node.what} is left out: {why}")

    def _spawn_object(self, spawn: Spawn) -> None:
        """Add a program that spawns a model that is not a robot."""
        if spawn in self._robots:
            return
        service: dict[str, Any] = {"kind": str(STAND_INS / "gazebo_ros/scripts/spawn_model"), "name": spawn.node.name}
        if spawn.node.namespace != "/":
            service["namespace"] = spawn.node.namespace
        self._services.append({**service, "args": spawn.node.words, "restart": "never"})

    def _static_transform(self, node: LaunchNode) -> None:
        self._add(node, "static_transform", known_nodes.static_transform(node))

    def _controllers(self, node: LaunchNode) -> None:
        """Add a spawner's controllers to the controller manager of their namespace; those that it only loads can be
        switched on there.
        """
        words = node.words
        stopped = "--stopped" in words or words[:1] == ["load"]
        names: list[str] = []
        namespace = node.namespace
        while words:
            word = words.pop(0)
            option, equals, value = word.partition("=")
            if option in ("--namespace", "-n"):
                namespace = join_names("/", value if equals else words.pop(0) if words else "")
            elif option in ("--shutdown-timeout", "--timeout", "--wait-for") and not equals:
                words = words[1:]
            elif (
                not word.startswith("-")
                and ":=" not in word
                and "=" not in word
                and word not in ("spawn", "load", "start")
            ):
                names.append(word)
        driven = {key.rpartition("/")[2] for key, _ in diff_drive_controllers(self._launch.parameters, namespace)}
        chosen = [
            each
            for each in names
            if each.rpartition("/")[2] not in driven and not self._is_broadcaster(namespace, each)
        ]
        if not chosen:
            return
        owner = self._owner(namespace)
        if owner is None and (self._robots or self._gazebo):
            self._skip(node, "no robot is spawned")
            return
        loaded = [*self._loaded_controllers.get(namespace, ()), *(join_names(namespace, each) for each in chosen)]
        config = self._controller_config(namespace, loaded)
        if not config:
            self._skip(node, f"no <rosparam> configures {', '.join(chosen)}")
            return
        self._loaded_controllers[namespace] = loaded
        manager = self._manager(namespace)
        if manager is not None:
            manager["config"] = config
        if stopped:
            self._launch.note(f"{node.where}: {', '.join(chosen)}: not started, as stated; switch_controller can do it")
        elif manager is not None:
            manager["controllers"] += [each for each in chosen if each not in manager["controllers"]]
        else:
            self._add_manager(node, namespace, owner, config, chosen)

    def _manager(self, namespace: str) -> dict[str, Any] | None:
        """Return the parameters of the controller manager in a namespace; None if there is none."""
        managers = [each for each in self._services if each["kind"] == "controller_manager"]
        return next((each["parameters"] for each in managers if each["namespace"] == namespace), None)

    def _owner(self, namespace: str) -> dict[str, Any] | None:
        """Return the robot whose controllers are in a namespace: that with its topics there, else one of the root."""
        own = next((each for each in self._tables if each["namespace"] == namespace), None)
        spawned = zip(self._robots, self._tables, strict=True)
        return own or next((table for each, table in spawned if "/" in (namespace, each.namespace)), None)

    def _add_manager(
        self, node: LaunchNode, namespace: str, owner: dict[str, Any] | None, config: str, controllers: list[str]
    ) -> None:
        """Add a controller manager, under its name in ROS, for a robot of this fleet or of the running one that it
        joins.
        """
        if owner is not None and owner["namespace"] != namespace:
            self._launch.note(f"{node.where}: the topics of {owner['name']} are in {namespace}, as its controllers are")
            owner["namespace"] = namespace
        robot = owner["name"] if owner is not None else namespace.strip("/").replace("/", "_") or "robot"
        parameters = {"config": config, "robot": robot, "controllers": controllers}
        self._services.append({"kind": "controller_manager", "namespace": namespace, "parameters": parameters})

    def _controller_config(self, namespace: str, names: list[str]) -> str:
        """Return the file that configures these controllers, if nothing else changes them, or else its content."""
        compared = [*names, join_names(namespace, "gazebo_ros_control")]
        for each in self._launch.loaded:
            if all(map(each.sets, names)) and each.agrees(self._launch.parameters, compared):
                return str(each.file)
        return self._inline_controllers(namespace, names)

    def _inline_controllers(self, namespace: str, names: list[str]) -> str:
        """Return the parameters of these controllers as the content of a file; "" if one has no type there."""
        tree: dict[str, Any] = {}
        for name in (*names, *self._joint_state_controllers(namespace), join_names(namespace, "gazebo_ros_control")):
            found = find_parameter(self._launch.parameters, name)
            if isinstance(found, dict):
                set_parameter(tree, name, found)
            if name in names and not (isinstance(found, dict) and "type" in found):
                return ""
        return json.dumps(tree)

    def _joint_state_controllers(self, namespace: str) -> list[str]:
        """Return those configured in a namespace, whose rate is that of the joint states."""
        here = find_parameter(self._launch.parameters, namespace)
        tables = {name: each for name, each in here.items() if isinstance(each, dict)} if isinstance(here, dict) else {}
        return [
            join_names(namespace, name) for name, each in tables.items() if "joint_state" in str(each.get("type", ""))
        ]

    def _is_broadcaster(self, namespace: str, name: str) -> bool:
        found = self._launch.search_parameter(namespace, name)
        kind = str(found.get("type", "")) if isinstance(found, dict) else ""
        return "joint_state" in kind.lower() or "joint_state" in name or "imu_sensor" in kind

    def _state_publisher(self, node: LaunchNode) -> None:
        if self._robots or self._gazebo:
            return
        if found := self._described(node):
            self._add(node, "state", {"model": found, "frame_prefix": ""})

    def _joint_state_publisher(self, node: LaunchNode) -> None:
        if self._robots or self._gazebo:
            return
        found = self._described(node)
        own = {"publish_transforms": False, "publish_default_positions": True}
        self._add(node, "state", {**own, "model": found} if found else own)

    def _described(self, node: LaunchNode) -> str:
        """Return the model named by the nearest ``robot_description`` above a node; "" if there is none."""
        parts = [each for each in node.namespace.split("/") if each]
        for count in range(len(parts), -1, -1):
            key = join_names("/" + "/".join(parts[:count]), "robot_description")
            if (found := self._launch.descriptions.get(key)) is not None:
                if known := known_model(found.file.name):
                    return known
                try:
                    return resolve_robot(str(found.file), found.file.parent, self._folders, dict(found.arguments)).model
                except BadInput as error:
                    self._launch.note(f"{node.where}: {node.what} is left out: {error}")
        return ""

    def _map(self, node: LaunchNode) -> None:
        file = known_nodes.map_file(node)
        if file is None or not file.is_file():
            self._skip(node, f"there is no file {file}" if file else "no map file is given")
            return
        self._add(node, "map_server", {"map": str(file)})

    def _turtlesim(self, node: LaunchNode) -> None:
        self._add(node, "turtlesim", {})
        self._once({"kind": "logger", "parameters": {"extent": [0.0, 0.0, 11.1, 11.1]}})
        self._once({"kind": "panel"})

    def _descriptions(self) -> None:
        """Add the robot descriptions that the fleet does not set itself to the tree, if they can be expanded."""
        own = {join_names(each["namespace"], DESCRIPTION) for each in self._tables}
        own |= {f"/{DESCRIPTION}"} if len(self._tables) == 1 else set()
        spawned = {each.parameter for each in self._robots}
        scripts = any("/" in each["kind"] for each in self._services)
        for key, description in self._launch.descriptions.items():
            if key in own or not (scripts or key in spawned) or not description.file.is_file():
                continue
            try:
                set_parameter(self._launch.parameters, key, description.text(self._folders))
            except BadInput as error:
                self._launch.note(f"{key} is left out: {error}")


def _fleet_name(path: Path) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]", "_", path.name.split(".")[0])[:64].lstrip(".-") or "launch"


def _toml(table: dict[str, Any]) -> str:
    """Format a fleet file as by hand: a table for each robot and service, with nested tables inline."""
    parts = ["".join(f"{name} = {_inline(each)}\n" for name, each in table.items() if isinstance(each, str))]
    parts += [f"[run]\n{_lines(table['run'])}"]
    for name in ("robot", "service"):
        parts += [f"[[{name}]]\n{_lines(each)}" for each in table.get(name, ())]
    if "rosparam" in table:
        parts.append(tomli_w.dumps({"rosparam": table["rosparam"]}, multiline_strings=True))
    return "\n".join(parts)


def _lines(table: dict[str, Any]) -> str:
    return "".join(f"{_key(name)} = {_inline(value)}\n" for name, value in table.items())


def _inline(value: Any) -> str:
    match value:
        case dict():
            return f"{{ {', '.join(f'{_key(name)} = {_inline(each)}' for name, each in value.items())} }}"
        case list() | tuple():
            return f"[{', '.join(map(_inline, value))}]"
        case _:
            return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _inline(name)
