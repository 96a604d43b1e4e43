"""``elea sim``: models, joints, efforts and wrenches of the running simulation."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from deploy.commands.options import own_robot_options
from deploy.commands.sim import SimulationClient, parse_joint_positions, simulation_command
from deploy.live.output import format_table

if TYPE_CHECKING:
    from messages.elea import ModelState
    from messages.geometry import Pose, Twist
    from messages.joints import JointProperties

F = TypeVar("F", bound=Callable[..., Any])
POSE_OPTIONS = (
    ("-x", "x", "m"),
    ("-y", "y", "m"),
    ("-z", "z", "m"),
    ("-R", "roll", "rad"),
    ("-P", "pitch", "rad"),
    ("-Y", "yaw", "rad"),
)
"""The names of ROS's ``spawn_model``."""


def pose_options(command: F) -> F:
    """Add options for the six numbers of a pose; None if not given."""
    for short, name, unit in reversed(POSE_OPTIONS):
        names = [short, name] if len(name) == 1 else [short, f"--{name}", name]
        checked = _check_angle if unit == "rad" else None
        command = click.option(*names, type=float, help=f"{name.capitalize()}, {unit}.", callback=checked)(command)
    return command


def _check_angle(_: click.Context, __: click.Parameter, value: float | None) -> float | None:
    from models.angles import angle_fault

    if fault := angle_fault(value):
        raise click.BadParameter(fault)
    return value


@click.command("list")
@simulation_command
def list_(client: SimulationClient) -> None:
    """List the models with their poses."""
    from messages.requests import LIST
    from messages.std import Empty

    reply = client.call(LIST, Empty())
    rows = [("name", "model", "x m", "y m", "z m", "yaw rad")]
    rows += [(each.name, each.model, *_planar_pose(each)) for each in reply.models]
    client.print_reply(reply, format_table(rows) if reply.models else "there are no models")


@click.command("spawn")
@click.argument("model")
@click.argument("name")
@pose_options
@click.option("--frame", default="", help="Frame of the pose: world (default), a model, or model::link.")
@click.option("--namespace", default="", help="Namespace of its topics, / for the root; its name by default.")
@click.option("--frame-prefix", help="Prefix of its frames, '' for none; its name and a slash by default.")
@click.option(
    "-J", "--joint", "joints", multiple=True, metavar="JOINT=POSITION", help="Initial position of a joint, in rad or m."
)
@click.option("--param", "pairs", multiple=True, metavar="NAME=VALUE", help="Parameter of its base or joints.")
@own_robot_options
@simulation_command
def spawn(
    client: SimulationClient,
    model: str,
    name: str,
    frame: str,
    namespace: str,
    frame_prefix: str | None,
    joints: tuple[str, ...],
    pairs: tuple[str, ...],
    xacro_args: dict[str, str],
    packages: tuple[Path, ...],
    **place: float | None,
) -> None:
    """Spawn a MODEL as NAME.

    MODEL is one that comes with Elea, or the path of a URDF, a xacro or a folder; - reads a URDF from the standard
    input. A xacro is expanded here: the simulation gets the URDF.
    """
    from messages.parameters import Assignment
    from messages.requests import SPAWN
    from messages.simulation import SpawnModel
    from services.runtime.parameters.validation import read_assignments

    at = parse_joint_positions(joints)
    named, urdf = _own_robot(model, packages, xacro_args)
    reply = client.call(
        SPAWN,
        SpawnModel(
            name=name,
            model=named,
            urdf=urdf,
            pose=_pose({axis: value or 0.0 for axis, value in place.items()}),
            namespace=namespace,
            frame_prefix=frame_prefix,
            reference_frame=frame,
            joint_names=tuple(at),
            joint_positions=tuple(at.values()),
            parameters=tuple(Assignment(name=each, value=value) for each, value in read_assignments(pairs).items()),
        ),
    )
    client.print_reply(reply, f"spawned {name}: {', '.join(_pose_words(reply))}")


@click.command("delete")
@click.argument("name")
@simulation_command
def delete(client: SimulationClient, name: str) -> None:
    """Delete the model NAME."""
    from messages.requests import DELETE, Name

    reply = client.call(DELETE, Name(name=name))
    client.print_reply(reply, reply.text)


@click.command("state")
@click.argument("name")
@click.option("--relative", default="", help="Frame of pose and twist: world, a model, or model::link.")
@simulation_command
def state(client: SimulationClient, name: str, relative: str) -> None:
    """Show the pose and twist of model NAME, or of a link (model::link).

    Without --relative, a model's pose is in the world frame and its twist in its own axes.
    """
    from messages.gazebo import LinkName
    from messages.requests import GET_STATE, LINK_STATE
    from messages.simulation import GetModelState

    if "::" in name:
        link = client.call(LINK_STATE, LinkName(link_name=name, reference_frame=relative))
        client.print_reply(link, _format_state(link.pose, link.twist))
        return
    model = client.call(GET_STATE, GetModelState(name=name, relative_entity=relative))
    client.print_reply(model, _format_state(model.pose, model.twist))


@click.command("set-state")
@click.argument("name")
@pose_options
@click.option("--linear", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="Velocity, m/s.")
@click.option("--angular", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="Turn rate, rad/s.")
@click.option("--frame", default="", help="Frame of pose and twist: world, a model, or model::link.")
@simulation_command
def set_state(
    client: SimulationClient,
    name: str,
    linear: tuple[float, float, float],
    angular: tuple[float, float, float],
    frame: str,
    **place: float | None,
) -> None:
    """Move the model NAME; parts of the pose that are not given stay, and so do its joint angles."""
    from messages.geometry import Twist, Vector3
    from messages.requests import GET_STATE, SET_STATE
    from messages.se3 import Pose3
    from messages.simulation import GetModelState, SetModelState

    now = client.call(GET_STATE, GetModelState(name=name, relative_entity=frame)).pose
    roll, pitch, yaw = Pose3.from_msg(now).rpy
    kept = {"x": now.position.x, "y": now.position.y, "z": now.position.z, "roll": roll, "pitch": pitch, "yaw": yaw}
    stated = {axis: value for axis, value in place.items() if value is not None}
    (vx, vy, vz), (wx, wy, wz) = linear, angular
    twist = Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))
    reply = client.call(
        SET_STATE, SetModelState(name=name, pose=_pose(kept | stated), twist=twist, reference_frame=frame)
    )
    client.print_reply(reply, f"{name}: {', '.join(_pose_words(reply))}")


@click.command("properties")
@click.argument("name", default="")
@simulation_command
def properties(client: SimulationClient, name: str) -> None:
    """Show properties of the world, a model (NAME) or a link (model::link)."""
    from messages.gazebo import LinkName
    from messages.requests import LINK_PROPERTIES, MODEL_PROPERTIES, WORLD_PROPERTIES, Name
    from messages.std import Empty

    reply: Any
    if not name:
        reply = client.call(WORLD_PROPERTIES, Empty())
    elif "::" in name:
        reply = client.call(LINK_PROPERTIES, LinkName(link_name=name))
    else:
        reply = client.call(MODEL_PROPERTIES, Name(name=name))
    client.print_reply(
        reply, format_table((field, _format_property(getattr(reply, field))) for field in reply.__struct_fields__)
    )


def _own_robot(model: str, packages: tuple[Path, ...], xacro_args: dict[str, str]) -> tuple[str, str]:
    """Return the robot's name for a request, and its URDF if that suffices; imports a robot file.

    A simulation of the same user finds an imported robot by its name; others can get a URDF without meshes.
    """
    from models import MODELS
    from models.robot_source import names_file, resolve_robot, resolve_urdf_text
    from models.urdf import MAX_CHARACTERS
    from services.runtime.errors import BadInput

    if model == "-":
        text = sys.stdin.read(MAX_CHARACTERS + 1)
        found = resolve_urdf_text(text, packages, base=Path.cwd())
    elif names_file(model) or xacro_args or packages:
        if model in MODELS:
            raise BadInput(f"--arg and --package are for a robot of your own, and {model} comes with Elea")
        found = resolve_robot(model, Path.cwd(), packages, xacro_args)
    else:
        return model, ""
    urdf = found.urdf.read_text(encoding="utf-8")
    return Path(found.model).name, "" if "<mesh" in urdf else urdf


def _pose(place: dict[str, float]) -> Pose:
    """Return a pose from x, y, z [m] and roll, pitch, yaw [rad] about fixed axes."""
    from messages.se3 import Pose3, quaternion_from_rpy

    rotation = quaternion_from_rpy(place["roll"], place["pitch"], place["yaw"])
    return Pose3((place["x"], place["y"], place["z"]), rotation).to_msg()


def _planar_pose(model: ModelState) -> tuple[str, str, str, str]:
    place = model.pose.position
    x, y, z, yaw = (f"{value:z.3f}" for value in (place.x, place.y, place.z, model.pose.orientation.yaw))
    return x, y, z, yaw


def _pose_words(model: ModelState) -> list[str]:
    return [f"{name} {value}" for name, value in zip(("x", "y", "z", "yaw"), _planar_pose(model), strict=True)]


def _format_state(pose: Pose, twist: Twist) -> str:
    from messages.se3 import Pose3

    place, turn = pose.position, Pose3.from_msg(pose).rpy
    rows = [("", "x", "y", "z")]
    for name, (a, b, c) in (
        ("position m", (place.x, place.y, place.z)),
        ("roll, pitch, yaw rad", turn),
        ("velocity m/s", (twist.linear.x, twist.linear.y, twist.linear.z)),
        ("turn rate rad/s", (twist.angular.x, twist.angular.y, twist.angular.z)),
    ):
        rows.append((name, f"{a:z.4f}", f"{b:z.4f}", f"{c:z.4f}"))
    return format_table(rows)


def _format_property(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if hasattr(value, "__struct_fields__"):
        parts = ((field, getattr(value, field)) for field in value.__struct_fields__)
        return ", ".join(f"{field} {_format_property(part)}" for field, part in parts)
    return f"{value:g}" if isinstance(value, float) else str(value)


Vector = tuple[float, float, float]
ZERO = (0.0, 0.0, 0.0)
ALLOW_NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Makes negative numbers arguments instead of options."""

start_option = click.option(
    "--start",
    type=click.FloatRange(0, 1e9),
    default=0.0,
    help="Simulation time at which it starts, in seconds; now by default.",
)
duration_option = click.option(
    "--duration", type=float, default=1.0, help="How long it acts, in seconds; 1 by default; negative: until cleared."
)


@click.command("joints")
@click.argument("name", default="")
@simulation_command
def joints(client: SimulationClient, name: str) -> None:
    """Show type, limits, state and effort of all joints, those of a model, or one (model::joint)."""
    from messages.gazebo import JointName
    from messages.requests import JOINT_PROPERTIES, LIST, MODEL_PROPERTIES, Name
    from messages.std import Empty

    models = [each.name for each in client.call(LIST, Empty()).models]
    if name and name not in models:
        found = [client.call(JOINT_PROPERTIES, JointName(joint_name=name))]
    else:
        found = []
        for model in [name] if name else models:
            for joint in client.call(MODEL_PROPERTIES, Name(name=model)).joints:
                found.append(client.call(JOINT_PROPERTIES, JointName(model=model, joint_name=joint)))
    client.print_reply(found, _joint_table(found) if found else "there are no movable joints")


@click.command("effort", context_settings=ALLOW_NEGATIVE_NUMBERS)
@click.argument("joint")
@click.argument("effort", type=float)
@start_option
@duration_option
@simulation_command
def effort(client: SimulationClient, joint: str, effort: float, start: float, duration: float) -> None:
    """Apply EFFORT, in N m or N, to a JOINT for some time."""
    from messages.gazebo import ApplyEffort
    from messages.joints import JointEffort
    from messages.requests import APPLY_EFFORT
    from messages.std import Time

    job = JointEffort(
        joint_name=joint, effort=effort, start_time=Time.of(round(start * 1e9)), duration=_clamp_duration(duration)
    )
    reply = client.call(APPLY_EFFORT, ApplyEffort(job=job))
    client.print_reply(reply, reply.text)


@click.command("wrench")
@click.argument("link")
@click.option("--force", type=float, nargs=3, default=ZERO, help="Force, in N.")
@click.option("--torque", type=float, nargs=3, default=ZERO, help="Torque, in N m.")
@click.option(
    "--point",
    type=float,
    nargs=3,
    default=ZERO,
    help="Point of the link where the force acts, in m; its origin by default.",
)
@click.option("--frame", default="", help="Axes of force and torque: world (default), a model, or model::link.")
@start_option
@duration_option
@simulation_command
def wrench(
    client: SimulationClient,
    link: str,
    force: Vector,
    torque: Vector,
    point: Vector,
    frame: str,
    start: float,
    duration: float,
) -> None:
    """Apply a force and torque to a LINK (model::link), or to a model at its root link."""
    from messages.gazebo import ApplyWrench
    from messages.geometry import Point, Vector3, Wrench
    from messages.requests import APPLY_WRENCH
    from messages.std import Time

    (fx, fy, fz), (tx, ty, tz), (x, y, z) = force, torque, point
    reply = client.call(
        APPLY_WRENCH,
        ApplyWrench(
            body_name=link,
            reference_frame=frame,
            reference_point=Point(x=x, y=y, z=z),
            wrench=Wrench(force=Vector3(x=fx, y=fy, z=fz), torque=Vector3(x=tx, y=ty, z=tz)),
            start_time=Time.of(round(start * 1e9)),
            duration=_clamp_duration(duration),
        ),
    )
    client.print_reply(reply, reply.text)


@click.command("clear")
@click.argument("name")
@click.option("--wrench", "of_link", is_flag=True, help="Clear the wrenches on the link NAME instead.")
@simulation_command
def clear(client: SimulationClient, name: str, of_link: bool) -> None:
    """Clear the efforts on the joint NAME, including those yet to start."""
    from messages.gazebo import JointName, LinkName
    from messages.requests import CLEAR_EFFORT, CLEAR_WRENCH

    if of_link:
        reply = client.call(CLEAR_WRENCH, LinkName(link_name=name))
    else:
        reply = client.call(CLEAR_EFFORT, JointName(joint_name=name))
    client.print_reply(reply, reply.text)


@click.command("configure")
@click.argument("model")
@click.argument("positions", nargs=-1, required=True, metavar="JOINT=POSITION...")
@simulation_command
def configure(client: SimulationClient, model: str, positions: tuple[str, ...]) -> None:
    """Set joint positions of a MODEL, in rad or m, at zero velocity; other joints keep their state."""
    from messages.gazebo import SetConfiguration
    from messages.requests import SET_CONFIGURATION

    wanted = parse_joint_positions(positions)
    reply = client.call(
        SET_CONFIGURATION,
        SetConfiguration(model=model, joint_names=tuple(wanted), joint_positions=tuple(wanted.values())),
    )
    stand = (f"{name} {position:g}" for name, position in zip(reply.name, reply.position, strict=True))
    client.print_reply(reply, f"{model}: {', '.join(stand)}")


def _clamp_duration(duration: float) -> float:
    """Map any negative duration, which means until cleared, to -1."""
    return duration if duration >= 0 else -1.0


def _joint_table(found: list[JointProperties]) -> str:
    rows = [("joint", "type", "position", "rate", "effort", "jobs", "limits", "effort max", "rate max", "damping")]
    for each in found:
        ends = "none" if each.lower is None else f"{each.lower:g} to {each.upper:g}"
        rows.append(
            (
                f"{each.model}::{each.joint_name}",
                each.type,
                f"{each.position:z.4f}",
                f"{each.rate:z.4f}",
                f"{each.applied_effort:z.3f}",
                str(each.jobs),
                ends,
                _format_limit(each.effort_limit),
                _format_limit(each.velocity_limit),
                f"{each.damping:g}",
            )
        )
    return format_table(rows)


def _format_limit(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"
