"""The robots that a launch file spawns into Gazebo, as tables of a fleet file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deploy.launch.launch_file import Launch, LaunchNode, join_names
from deploy.launch.launch_values import Description, description_of, read_text
from deploy.rosparam_tree import Tree, get_parameter
from models import MODELS, urdf_path
from models.angles import angle_fault
from models.gazebo_tags import parse_gazebo_tags
from models.model import WheelConfig, read_model
from models.robot_source import resolve_robot, resolve_urdf_text
from models.urdf import read_joint_limits
from services.runtime.errors import BadInput, did_you_mean
from services.runtime.parameters.validation import build
from services.script.inspect_script import legal_node_name
from services.sim.joints.config import check_positions
from services.sim.parameters import MAX_RATE, BaseParameters
from services.sim.robot_names import robot_links

_ALIASES = (
    (r"turtlebot3_?(burger|waffle_pi|waffle)", ""),
    (r"(pioneer_?3dx|pioneer-3dx|p3dx)", "p3dx"),
    (r"^ppend\b", "arm"),
)
_VALUES = {
    *("-param", "-file", "-database", "-model", "-x", "-y", "-z", "-R", "-P", "-Y", "-robot_namespace", "-namespace"),
    *("-reference_frame", "-gazebo_namespace", "-ros_namespace", "-wait"),
}
"""Options of ``spawn_model`` that are followed by a value."""
_DIFF_DRIVE = "diff_drive_controller"
_SAME_WHEELS = 0.15
"""Relative tolerance within which wheel dimensions count as those of our model; those of Pioneers differ by 8 %."""
_LIMITS = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class Spawn:
    """A call of ``spawn_model``: model, name, pose [m, rad], and the ``namespace`` of its topics."""

    node: LaunchNode
    source: Description | str
    """A file, or the text of a description, or the name of a model."""
    kind: str
    name: str
    namespace: str
    parameter: str
    pose: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, float] = field(default_factory=dict)
    """Start positions of joints [rad or m]."""


def is_spawn(node: LaunchNode) -> bool:
    """Return whether a node spawns a model in Gazebo."""
    return node.package == "gazebo_ros" and node.type.removesuffix(".py") in (
        "spawn_model",
        "spawn_urdf",
        "spawn_entity",
    )


def known_model(text: str) -> str:
    """Return the name of our robot for a file or model name; "" if it is another robot."""
    for pattern, name in _ALIASES:
        if found := re.search(pattern, Path(text).name, re.IGNORECASE):
            return name or found[1].lower()
    return ""


def read_spawn(node: LaunchNode, launch: Launch) -> Spawn:
    """Parse the arguments of a node that spawns; raises BadInput."""
    words = node.words
    values: dict[str, str] = {}
    joints: dict[str, float] = {}
    flags = set()
    while words:
        word = words.pop(0)
        option = word.replace("--", "-")
        if option in _VALUES and words:
            values[option] = words.pop(0)
        elif option == "-J":
            joint, position = [*words[:2], "", ""][:2]
            words = words[2:]
            joints[joint] = _number(node, f"-J {joint}", position)
        elif word.startswith("-"):
            flags.add(option)
    axes = {"-x": "x", "-y": "y", "-z": "z", "-Y": "yaw"}
    pose = {axis: _number(node, option, values.get(option, "0")) for option, axis in axes.items()}
    if angle_fault(pose["yaw"]):
        turned = math.remainder(pose["yaw"], math.tau)
        launch.note(
            f"{node.where}: spawn_model -Y {pose['yaw']:g} is in rad, as in Gazebo: a heading of "
            f"{turned:.4f} rad; {pose['yaw']:g} degrees would be {math.radians(pose['yaw']):.4f} rad"
        )
        pose["yaw"] = turned
    for option in ("-R", "-P"):
        if values.get(option, "0").strip("0.-"):
            launch.note(f"{node.where}: spawn_model {option} {values[option]}: robots of a fleet start level")
    frame = values.get("-reference_frame", "").strip("/")
    if frame not in ("", "world", "map"):
        launch.note(f"{node.where}: spawn_model -reference_frame {frame}: robots of a fleet start in the world frame")
    kind = "sdf" if "-sdf" in flags else "urdf"
    source, parameter = _source(node, launch, values)
    namespace = values.get("-robot_namespace", values.get("-namespace", "")) or node.namespace
    name = legal_node_name(values.get("-model", "").replace("/", " ").strip().replace(" ", "_"))
    return Spawn(node, source, kind, name, join_names("/", namespace), parameter, pose, joints)


def _number(node: LaunchNode, option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"{node.where}: spawn_model {option} {text!r} is not a number") from None


def _source(node: LaunchNode, launch: Launch, values: Mapping[str, str]) -> tuple[Description | str, str]:
    if "-param" in values:
        key = join_names(node.namespace, values["-param"])
        if key in launch.descriptions:
            return launch.descriptions[key], key
        try:
            return str(get_parameter(launch.parameters, key)), key
        except KeyError:
            near = did_you_mean(key, launch.descriptions)
            raise BadInput(f"{node.where}: spawn_model -param: there is no parameter {key}{near}") from None
    if "-file" in values:
        return Description(Path(values["-file"])), ""
    if "-database" in values:
        return values["-database"], ""
    raise BadInput(f"{node.where}: spawn_model needs -param, -file or -database: {node.args[:120]!r}")


def is_robot(spawn: Spawn) -> bool:
    """Return whether a robot is spawned, rather than an object described by an SDF."""
    return spawn.kind == "urdf" or bool(_known(spawn))


def robot_table(spawn: Spawn, launch: Launch, single: bool, packages: tuple[Path, ...]) -> tuple[dict[str, Any], bool]:
    """Return the table of a robot, and whether it can move: a table or a box, which also has a URDF, cannot.

    A ``single`` robot has frames without a prefix. Raises BadInput.
    """
    node, name = spawn.node, spawn.name
    model, arguments, display = _model(spawn, launch, packages)
    name = name or legal_node_name(display) or "robot"
    table: dict[str, Any] = {"name": name, "model": model}
    if arguments:
        table["xacro_args"] = arguments
    namespace = spawn.namespace
    parameters: dict[str, Any] = {}
    faults: list[str] = []
    try:
        made = resolve_robot(model, node_folder(node), packages, arguments, faults=faults).model
        wheels = read_model(made).wheels
    except BadInput as error:
        raise BadInput(f"{node.where}: the robot {name}: {error}") from None
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        launch.note(f"{node.where}: parts of the robot {name} cannot be read and are omitted: {faults[0]}{more}")
        table["model"] = made
        table.pop("xacro_args", None)
    has_base = read_model(made).has_base
    if has_base:
        parameters["cmd_vel_timeout"] = 0.0
        if model in MODELS and read_model(made).drifts:
            parameters["odometry"] = "world"  # as stated by its Gazebo plugin
        for key, controller in diff_drive_controllers(launch.parameters, spawn.namespace):
            own = wheels if model in MODELS else None
            parameters.pop("odometry", None)
            frames = {} if "base_link" not in robot_links(made) else {"base_frame_id": "base_link"}
            inside = key.removeprefix(namespace.rstrip("/")).strip("/")
            parameters |= {"cmd_vel_timeout": 0.5, **frames, **_base_parameters(controller, key, launch, own)}
            parameters["controller"] = inside
            launch.note(f"{node.where}: {name} listens to {key}/cmd_vel, the topic of its diff_drive_controller")
            break
        else:
            if model in MODELS and (commands := _command_namespace(spawn, packages)) != namespace:
                namespace = commands
                launch.note(f"{node.where}: {name} listens to {namespace}/cmd_vel, the topic of its drive plugin")
    elif model not in MODELS and namespace == "/" and (inner := _controllers_namespace(made)):
        namespace = f"/{inner}"
        launch.note(f"{node.where}: the topics of {name} are in {namespace}, the namespace of its gazebo_ros_control")
    table["namespace"] = namespace
    prefix = str(launch.search_parameter(spawn.namespace, "tf_prefix") or "").strip("/")
    if prefix or single:
        table["frame_prefix"] = f"{prefix}/" if prefix else ""
    pose = {axis: value for axis, value in spawn.pose.items() if value}
    joints = _start_positions(spawn, made, launch)
    table |= ({"pose": pose} if pose else {}) | ({"joints": joints} if joints else {})
    moves = has_base or bool(read_joint_limits(made))
    return {**table, **({"parameters": parameters} if parameters else {})}, moves


def _controllers_namespace(model: str) -> str:
    """Return the namespace of gazebo_ros_control in a model's description; "" if it has none."""
    path = urdf_path(model)
    plugin = parse_gazebo_tags(read_text(path), path.name).ros_control
    return plugin.namespace if plugin is not None else ""


def _command_namespace(spawn: Spawn, packages: tuple[Path, ...]) -> str:
    """Return the namespace of the drive's commands in the description: ``/p3dx`` for ``p3dx/cmd_vel``.

    If the description is one of our models, or cannot be read, return the namespace of the spawn.
    """
    source = spawn.source
    if not isinstance(source, Description) or not source.file.is_file():
        return spawn.namespace
    try:
        topic = parse_gazebo_tags(source.text(packages), source.file.name).topics.get("cmd_vel", "")
    except BadInput:
        return spawn.namespace
    inner, _, last = topic.rpartition("/")
    if last != "cmd_vel" or not inner or f"/{inner}" == spawn.namespace:
        return spawn.namespace
    return join_names(spawn.namespace, inner)


def _start_positions(spawn: Spawn, model: str, launch: Launch) -> dict[str, float]:
    """Return the positions of ``-J`` that the robot can take; Gazebo also ignores the others."""
    kept = {}
    for joint, position in spawn.joints.items():
        try:
            check_positions(model, {joint: position})
        except BadInput as error:
            launch.note(f"{spawn.node.where}: spawn_model -J {joint} {position:g} is left out: {error}")
        else:
            kept[joint] = position
    return kept


def node_folder(node: LaunchNode) -> Path:
    """Return the folder of a node's launch file."""
    return Path(node.where.rpartition(":")[0]).parent


def _known(spawn: Spawn) -> str:
    match spawn.source:
        case Description(file=file):
            named = known_model(file.name)
            if named or not file.name.endswith((".sdf", ".urdf")):
                return named
            return known_model(file.parent.name) if file.name in ("model.sdf", "robot.urdf") else ""
        case text if "<" in text:
            return known_model(description_of(text))
        case name:
            return known_model(name)


def _model(spawn: Spawn, launch: Launch, packages: tuple[Path, ...]) -> tuple[str, dict[str, str], str]:
    """Return the model of a robot, the arguments of its xacro, and its display name."""
    where = spawn.node.where
    if known := _known(spawn):
        if isinstance(spawn.source, Description):
            launch.note(f"{where}: {spawn.source.file.name} is Elea's model {known}")
        return known, {}, known
    match spawn.source:
        case Description(file=file, arguments=arguments):
            if not file.is_file():
                raise BadInput(f"{where}: the robot's file {file} does not exist")
            if file.suffix == ".xacro":
                return str(file), dict(arguments), file.name.split(".")[0]
            if known := known_model(description_of(read_text(file))):
                launch.note(f"{where}: the robot in {file.name} is Elea's model {known}")
                return known, {}, known
            return str(file), dict(arguments) if "<xacro:" in read_text(file) else {}, file.name.split(".")[0]
        case text if "<" in text:
            try:
                made = resolve_urdf_text(text, packages, name=description_of(text), base=launch.path.parent)
            except BadInput as error:
                raise BadInput(f"{where}: {error}") from None
            return made.model, {}, made.name
        case name:
            raise BadInput(f"{where}: spawn_model -database {name}: there is no such model here")


def diff_drive_controllers(tree: Tree, namespace: str) -> Iterator[tuple[str, Tree]]:
    """Yield the diff_drive_controllers configured at or below a namespace, by absolute name."""
    try:
        here = get_parameter(tree, namespace)
    except KeyError:
        return
    pending = [(namespace.rstrip("/"), here)]
    while pending:
        key, branch = pending.pop(0)
        if not isinstance(branch, dict):
            continue
        if _DIFF_DRIVE in str(branch.get("type", "")):
            yield key, branch
        pending += [(f"{key}/{name}", each) for name, each in branch.items()]


def _base_parameters(controller: Tree, key: str, launch: Launch, wheels: WheelConfig | None) -> dict[str, Any]:
    """Return the parameters of a controller that our base has under the same names.

    If one of our models, with other ``wheels``, replaces the description, dimensions close to ours were correct for
    that description and are dropped; only those that deviate, as deliberate errors, are kept.
    """
    plain = (
        *("cmd_vel_timeout", "publish_rate", "wheel_separation", "wheel_radius", "wheel_separation_multiplier"),
        *("wheel_radius_multiplier", "left_wheel_radius_multiplier", "right_wheel_radius_multiplier"),
        *("pose_covariance_diagonal", "twist_covariance_diagonal", "velocity_rolling_window_size", "open_loop"),
        *("enable_odom_tf", "odom_frame_id", "base_frame_id", "publish_cmd", "allow_multiple_cmd_vel_publishers"),
    )
    found: dict[str, Any] = {name: controller[name] for name in plain if name in controller}
    for name, ours in (("wheel_radius", wheels.radius), ("wheel_separation", wheels.separation)) if wheels else ():
        if isinstance(stated := found.get(name), int | float) and abs(stated - ours) < _SAME_WHEELS * ours:
            del found[name]
    if isinstance(rate := found.get("publish_rate"), int | float):
        found["publish_rate"] = min(rate, MAX_RATE)
    for axis, inner in (("linear", "x"), ("angular", "z")):
        limits = controller.get(axis)
        limits = limits.get(inner) if isinstance(limits, dict) else None
        if not isinstance(limits, dict):
            continue
        stated = {
            f"{end}_{limit}": limits[f"{end}_{limit}"]
            for limit in _LIMITS
            if limits.get(f"has_{limit}_limits")
            for end in ("min", "max")
            if f"{end}_{limit}" in limits
        }
        if stated:
            found[axis] = stated
    kept: dict[str, Any] = {}
    for name, value in found.items():
        try:
            build(BaseParameters, {name: value})
        except BadInput as error:
            launch.note(f"{key}: {name} is left out: {error}")
        else:
            kept[name] = value
    return kept
