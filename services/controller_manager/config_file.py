"""Reads the YAML files of ros_control and ros2_control; errors name file and line."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from models.yaml_reader import YamlSource, read_yaml
from services.controller_manager.config import (
    DEFAULT_RATE,
    FORWARD_COMMAND,
    REPLACED_BY_SIMULATION,
    ROS_2_TRAJECTORY,
    TYPES,
    ControllerConfig,
    ControllerType,
    Gains,
    JointName,
    JointNames,
    ManagerConfig,
    NonNegative,
    Rate,
    Table,
    Tolerance,
    TrajectoryConfig,
)
from services.runtime.errors import BadInput, did_you_mean, unknown_name

MAX_BYTES = 1 << 18
"""Maximum file size [bytes]; handwritten files have a few thousand bytes."""
MAX_DEPTH = 12
"""Maximum nesting of tables."""
MAX_VALUES = 20_000
"""Maximum number of values in all tables; only YAML aliases produce more values or deeper tables."""
MAX_CONTROLLERS = 100

_ROS_2 = "ros__parameters"
_MANAGER = "controller_manager"
_GAZEBO = "gazebo_ros_control"
_ANYWHERE = ("**", "*")
"""ROS 2's wildcards for namespaces."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

Path_ = tuple[str | int, ...]
T = TypeVar("T")


class _JointTable(Table, frozen=True, kw_only=True):
    type: str
    joint: JointName
    pid: Gains | None = None


class _GroupTable(Table, frozen=True, kw_only=True):
    type: str
    joints: JointNames
    interface_name: str = ""


class _TrajectoryTable(Table, frozen=True, kw_only=True):
    type: str
    joints: JointNames
    constraints: dict[str, Any] = msgspec.field(default_factory=dict)
    gains: dict[str, Gains] = msgspec.field(default_factory=dict)
    velocity_ff: dict[str, float] = msgspec.field(default_factory=dict)
    state_publish_rate: Rate = 50.0
    action_monitor_rate: Rate = 20.0
    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = True
    command_interfaces: tuple[str, ...] = ()
    state_interfaces: tuple[str, ...] = ()
    interpolation_method: str = "splines"


class _StateTable(Table, frozen=True, kw_only=True):
    type: str
    publish_rate: Rate = 0.0


_UNUSED = frozenset({"update_rate", "use_sim_time", "joint_group", "action_ns"})
"""Common keys that have no effect here and deserve no note."""


class _Found(NamedTuple):
    """A table of the file: the namespace and name of its node, its keys, and its path in the file."""

    namespace: str
    name: str
    table: dict[str, Any]
    path: Path_


class _Head(NamedTuple):
    """The common part of every controller: its name, its type, and the place of the type in the file."""

    name: str
    type: str
    where: str


def is_text(config: str) -> bool:
    """Whether ``config`` is the content itself, as a table in braces, rather than a path."""
    return config.lstrip().startswith("{")


def load_config(config: str, namespace: str, chosen: Collection[str] = ()) -> ManagerConfig:
    """Read the controllers of ``config``, the path of a file or its content; raises BadInput."""
    if is_text(config):
        return parse_config(Path("config"), config, namespace, chosen)
    return read_config(Path(config).absolute(), namespace, chosen)


def read_config(path: Path, namespace: str, chosen: Collection[str] = ()) -> ManagerConfig:
    """Read the controllers of the robot in ``namespace`` from a file; raises BadInput.

    If controllers are ``chosen`` by name, others with unknown types are ignored.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise BadInput(f"{path}: more than {MAX_BYTES} bytes: is it a file of controllers?")
        text = data.decode("utf-8")
    except FileNotFoundError:
        near = did_you_mean(path.name, (each.name for each in path.parent.glob("*.y*ml")))
        raise BadInput(f"there is no controller file {path}{near}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"the controller file {path} cannot be read: {error}") from None
    return parse_config(path, text, namespace, chosen)


def parse_config(path: Path, text: str, namespace: str, chosen: Collection[str] = ()) -> ManagerConfig:
    """Parse the controllers in ``text`` as ``read_config`` does; ``path`` is used in errors."""
    tree = read_yaml(text, str(path))
    if not isinstance(tree, dict):
        raise BadInput(f"{path}:1: expected a table of controllers, by their names")
    _check_size(tree, path)
    return _Reader(YamlSource(path, text), namespace.strip("/"), chosen).read(tree)


class _Reader:
    """Reads one file for one robot; ``notes`` collects what is ignored."""

    def __init__(self, source: YamlSource, namespace: str, chosen: Collection[str]) -> None:
        self._source, self._namespace, self._chosen = source, namespace, chosen
        self._notes: list[str] = []
        self._joint_state_rate = 0.0

    def read(self, tree: dict[Any, Any]) -> ManagerConfig:
        """Return the controllers of the file."""
        found = list(self._walk(tree, ()))
        controllers = self._own([each for each in found if each.name not in (_MANAGER, _GAZEBO)])
        managers = [each for each in found if each.name == _MANAGER and self._is_own(each)]
        types = self._types(managers, controllers)
        rate = DEFAULT_RATE
        for manager in managers:
            if "update_rate" in manager.table:
                rate = self._convert(manager.table["update_rate"], Rate, (*manager.path, "update_rate")) or rate
        configs = [made for each in controllers if (made := self._controller(each, types)) is not None]
        if not configs:
            raise BadInput(f"{self._source.location()}: there is no controller in this file: none has a type")
        if len(configs) > MAX_CONTROLLERS:
            raise BadInput(f"{self._source.path}: {len(configs)} controllers, the limit is {MAX_CONTROLLERS}")
        gains: dict[str, Gains] = {}
        for each in found:
            if each.name == _GAZEBO and self._is_own(each):
                gains |= self._gains(each.table.get("pid_gains", {}), (*each.path, "pid_gains"))
        return ManagerConfig(tuple(configs), rate, gains, self._joint_state_rate, tuple(self._notes))

    def _walk(self, table: dict[Any, Any], path: Path_) -> Iterator[_Found]:
        """Yield the tables of controllers, controller managers and hardware gains, at any depth."""
        for key, value in table.items():
            if not isinstance(value, dict):
                continue
            here = (*path, key)
            parts = [part for each in here for part in str(each).split("/") if part]
            name, above = (parts[-1] if parts else ""), "/".join(parts[:-1])
            if isinstance(inner := value.get(_ROS_2), dict):
                yield _Found(above, name, _nest(inner), (*here, _ROS_2))
            elif name in (_MANAGER, _GAZEBO) or isinstance(value.get("type"), str):
                yield _Found(above, name, value, here)
            else:
                yield from self._walk(value, here)

    def _is_own(self, found: _Found) -> bool:
        return found.namespace in ("", *_ANYWHERE, self._namespace)

    def _own(self, found: list[_Found]) -> list[_Found]:
        """Return the controllers of the robot's namespace, or of the only namespace in the file."""
        others = {each.namespace for each in found if not self._is_own(each)}
        if not others:
            return found
        own = [each for each in found if self._is_own(each)]
        if own:
            self._notes.append(
                f"{self._source.path}: the controllers of {_names(others)} are ignored: they belong to other robots"
            )
            return own
        if len(others) > 1:
            raise BadInput(
                f"{self._source.path}: there are only controllers of {_names(others)}, none of the robot "
                f"/{self._namespace}"
            )
        self._notes.append(
            f"{self._source.path}: the namespace /{others.pop()} of its controllers is ignored: they run in the "
            f"robot's, /{self._namespace}"
        )
        self._namespace = found[0].namespace
        return found

    def _types(self, managers: list[_Found], controllers: list[_Found]) -> dict[str, tuple[str, Path_]]:
        """Return the controller types that ROS 2's controller manager declares, by controller name."""
        types: dict[str, tuple[str, Path_]] = {}
        known = {each.name for each in controllers}
        for manager in managers:
            for name, value in manager.table.items():
                if not isinstance(value, dict) or "type" not in value:
                    continue
                path = (*manager.path, name, "type")
                types[name] = self._convert(value["type"], str, path), path
                if name not in known:
                    controllers.append(_Found("", name, {}, (*manager.path, name)))
        return types

    def _controller(self, found: _Found, types: Mapping[str, tuple[str, Path_]]) -> ControllerConfig | None:
        """Return the controller of a table; None if the simulation replaces it or it is not a controller."""
        table, path = found.table, found.path
        if "type" in table:
            type_name, type_path = self._convert(table["type"], str, (*path, "type")), (*path, "type")
        elif found.name in types:
            type_name, type_path = types[found.name]
        else:
            near = did_you_mean(found.name, types)
            self._notes.append(f"{self._source.location(*path)}: {found.name} is not a controller with a type{near}")
            return None
        where = self._source.location(*type_path)
        if type_name in REPLACED_BY_SIMULATION:
            self._notes.append(f"{where}: {found.name} is skipped: {REPLACED_BY_SIMULATION[type_name]}")
            return None
        if type_name not in TYPES:
            if self._chosen and found.name not in self._chosen:
                self._notes.append(f"{where}: {found.name} is skipped: unknown type {type_name}")
                return None
            error = unknown_name("type of controller", type_name, TYPES, f"{where}: {found.name}")
            raise BadInput(f'{error}; to leave it out, name those to run: controllers = ["NAME"]')
        if not _NAME.fullmatch(found.name):
            raise BadInput(f"{where}: {found.name[:80]!r} is not a valid controller name: letters, digits and _")
        each = TYPES[type_name]
        table = {**table, "type": type_name}
        head = _Head(found.name, type_name, where)
        match each.kind:
            case "joint":
                return self._joint_controller(each, table, path, head)
            case "group":
                return self._group_controller(each, table, path, head)
            case "trajectory":
                return self._trajectory_controller(each, table, path, head)
        parsed = self._table(table, _StateTable, path, ("joints", "interfaces", "extra_joints"))
        self._joint_state_rate = parsed.publish_rate or self._joint_state_rate
        return ControllerConfig(**head._asdict(), kind="state", interface=each.interface, commanded=each.commanded)

    def _joint_controller(
        self, each: ControllerType, table: dict[str, Any], path: Path_, head: _Head
    ) -> ControllerConfig:
        parsed = self._table(table, _JointTable, path)
        gains = {}
        if each.pid:
            if parsed.pid is None:
                raise BadInput(f"{head.where}: {head.name}: a {head.type} needs gains: pid: {{p: …}}")
            gains[parsed.joint] = self._checked(parsed.pid, (*path, "pid"))
        return ControllerConfig(
            **head._asdict(),
            kind="joint",
            interface=each.interface,
            commanded=each.commanded,
            joints=(parsed.joint,),
            gains=gains,
        )

    def _group_controller(
        self, each: ControllerType, table: dict[str, Any], path: Path_, head: _Head
    ) -> ControllerConfig:
        joints = table.get("joints")
        of_joints = [joint for joint in joints if isinstance(joint, str)] if isinstance(joints, list) else []
        parsed = self._table(table, _GroupTable, path, of_joints)
        self._check_joints(parsed.joints, path)
        interface, commanded = each.interface, each.commanded
        if head.type == FORWARD_COMMAND:
            interface = commanded = self._interface(parsed.interface_name, (*path, "interface_name"))
        gains: dict[str, Gains] = {}
        if each.pid:
            for joint in parsed.joints:
                pid = table.get(joint, {}).get("pid") if isinstance(table.get(joint), dict) else None
                if pid is None:
                    raise BadInput(
                        f"{head.where}: {head.name}: a {head.type} needs gains for each joint: "
                        f"{joint}: {{pid: {{p: …}}}}"
                    )
                gains |= self._gains({joint: pid}, path, ("pid",))
        return ControllerConfig(
            **head._asdict(), kind="group", interface=interface, commanded=commanded, joints=parsed.joints, gains=gains
        )

    def _trajectory_controller(
        self, each: ControllerType, table: dict[str, Any], path: Path_, head: _Head
    ) -> ControllerConfig:
        parsed = self._table(table, _TrajectoryTable, path)
        self._check_joints(parsed.joints, path)
        ros_2, interface = head.type == ROS_2_TRAJECTORY, each.interface
        if ros_2:
            if not parsed.command_interfaces:
                raise BadInput(f"{head.where}: {head.name}: command_interfaces is missing, for example [position]")
            names = [self._interface(name, (*path, "command_interfaces")) for name in parsed.command_interfaces]
            interface = "position" if "position" in names else names[0]
        gains = {}
        if interface != "position":
            for joint in parsed.joints:
                if joint not in parsed.gains:
                    raise BadInput(
                        f"{head.where}: {head.name}: {interface} needs gains for each joint: "
                        f"gains: {{{joint}: {{p: …}}}}"
                    )
                stated = self._checked(parsed.gains[joint], (*path, "gains", joint))
                ff = parsed.velocity_ff.get(joint, stated.ff_velocity_scale)
                gains[joint] = msgspec.structs.replace(stated, ff_velocity_scale=ff)
        return ControllerConfig(
            **head._asdict(),
            kind="trajectory",
            interface=interface,
            commanded="position",
            joints=parsed.joints,
            gains=gains,
            trajectory=self._trajectory(parsed, path, ros_2),
        )

    def _trajectory(self, parsed: _TrajectoryTable, path: Path_, ros_2: bool) -> TrajectoryConfig:
        here = (*path, "constraints")
        times, joints = {}, {}
        for name, value in parsed.constraints.items():
            if name in ("goal_time", "stopped_velocity_tolerance"):
                times[name] = self._convert(value, NonNegative, (*here, name))
            elif name in parsed.joints:
                joints[name] = self._table(value, Tolerance, (*here, name))
            else:
                known = (*parsed.joints, "goal_time", "stopped_velocity_tolerance")
                raise unknown_name("constraint", name, known, self._source.location(*here, name))
        if parsed.interpolation_method not in ("splines", "none"):
            known = ("splines", "none")
            where = self._source.location(*path, "interpolation_method")
            raise unknown_name("interpolation", parsed.interpolation_method, known, where)
        return TrajectoryConfig(
            constraints=joints,
            state_publish_rate=parsed.state_publish_rate,
            action_monitor_rate=parsed.action_monitor_rate,
            allow_partial_joints_goal=parsed.allow_partial_joints_goal,
            allow_nonzero_velocity_at_trajectory_end=parsed.allow_nonzero_velocity_at_trajectory_end,
            splines=parsed.interpolation_method == "splines",
            waits_for_goal=ros_2,
            **times,
        )

    def _interface(self, name: str, path: Path_) -> Any:
        known = ("position", "velocity", "effort")
        if name not in known:
            raise unknown_name("interface", name, known, self._source.location(*path))
        return name

    def _check_joints(self, joints: tuple[str, ...], path: Path_) -> None:
        for index, joint in enumerate(joints):
            if joint in joints[:index]:
                raise BadInput(f"{self._source.location(*path, 'joints')}: the joint {joint!r} occurs twice")

    def _gains(self, table: Any, path: Path_, below: Path_ = ()) -> dict[str, Gains]:
        """Return gains by joint."""
        gains = {}
        for joint, each in self._convert(table, dict[str, Any], path).items():
            here = (*path, joint, *below)
            gains[joint] = self._checked(self._table(each, Gains, here), here)
        return gains

    def _checked(self, gains: Gains, path: Path_) -> Gains:
        if not (gains.p or gains.i or gains.d):
            raise BadInput(f"{self._source.location(*path)}: none of the gains p, i and d is set")
        if gains.i and gains.bounds == (0.0, 0.0):
            self._notes.append(
                f"{self._source.location(*path)}: i = {gains.i:g} has no effect, as i_clamp = 0 clamps the integral "
                "term to 0"
            )
        return gains

    def _table(self, table: Any, record: type[T], path: Path_, more: Collection[str] = ()) -> T:
        """Convert a table to a record; unknown keys are noted."""
        if isinstance(table, dict):
            fields = {each.name for each in msgspec.structs.fields(record)}  # type: ignore[arg-type]
            known = fields | set(more) | _UNUSED
            for key in table:
                if key not in known:
                    near = did_you_mean(str(key), sorted(fields))
                    self._notes.append(f"{self._source.location(*path, key)}: unknown key {key} is ignored{near}")
        result: T = self._convert(table, record, path)
        return result

    def _convert(self, value: Any, kind: Any, path: Path_) -> Any:
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError as error:
            text, _, inner = str(error).partition(" - at `$")
            steps = re.findall(r"\.(\w+)|\[(\d+)\]", inner)
            below = tuple(name or int(index) for name, index in steps)
            missing = re.search(r"missing required field `(.*?)`", text)
            names = [str(each) for each in (*path, *below) if each != _ROS_2]
            what = f"{missing[1]} is missing" if missing else text
            raise BadInput(f"{self._source.location(*path, *below)}: {'.'.join(names)}: {what}") from None


def _check_size(tree: Any, path: Path) -> None:
    """Raise BadInput for content that aliases expand too far or make recursive."""
    pending, count = [(tree, 0)], 0
    while pending:
        each, depth = pending.pop()
        if not isinstance(each, dict | list):
            continue
        count += len(each)
        if count > MAX_VALUES or depth > MAX_DEPTH:
            raise BadInput(f"{path}: more than {MAX_VALUES} values, or tables more than {MAX_DEPTH} deep")
        pending += [(inner, depth + 1) for inner in (each.values() if isinstance(each, dict) else each)]


def _nest(table: dict[Any, Any]) -> dict[str, Any]:
    """Convert ROS 2's dotted names (``gains.joint1.p``) to nested tables."""
    made: dict[str, Any] = {}
    for key, value in table.items():
        *above, last = str(key).split(".")
        inner = made
        for name in above:
            below = inner.setdefault(name, {})
            inner = below if isinstance(below, dict) else inner
        value = _nest(value) if isinstance(value, dict) else value
        there = inner.get(last)
        inner[last] = {**there, **value} if isinstance(there, dict) and isinstance(value, dict) else value
    return made


def _names(namespaces: Collection[str]) -> str:
    return ", ".join(f"/{each}" for each in sorted(namespaces))
