"""``elea sim spawn`` and its like: the models in the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from deploy.commands.sim.ask import Asker, asks, assignments, table

if TYPE_CHECKING:
    from messages.elea import ModelState
    from messages.geometry import Pose, Quaternion, Twist

F = TypeVar("F", bound=Callable[..., Any])
PLACE = (
    ("-x", "x", "m"),
    ("-y", "y", "m"),
    ("-z", "z", "m"),
    ("-R", "roll", "rad"),
    ("-P", "pitch", "rad"),
    ("-Y", "yaw", "rad"),
)
"""As ROS's ``spawn_model`` has them."""


def placed(command: F) -> F:
    """Gives a command the six numbers of a pose, None where one is not stated."""
    for short, name, unit in reversed(PLACE):
        names = [short, name] if len(name) == 1 else [short, f"--{name}", name]
        command = click.option(*names, type=float, help=f"{name.capitalize()}, {unit}.")(command)
    return command


@click.command("list")
@asks
def list_(asker: Asker) -> None:
    """List the models with their poses."""
    from messages.requests import LIST
    from messages.std import Empty

    reply = asker.ask(LIST, Empty())
    rows = [("name", "model", "x m", "y m", "z m", "yaw rad")]
    rows += [(each.name, each.model, *_shown(each)) for each in reply.models]
    asker.show(reply, table(rows) if reply.models else "no model is there")


@click.command("spawn")
@click.argument("model")
@click.argument("name")
@placed
@click.option("--frame", default="", help="Frame of the pose: world (default), a model, or model::link.")
@click.option("--namespace", default="", help="Of its topics; its name by default.")
@click.option("-J", "--joint", "joints", multiple=True, metavar="JOINT=POSITION", help="Start of a joint, rad or m.")
@click.option("--param", "pairs", multiple=True, metavar="NAME=VALUE", help="A parameter of its base or joints.")
@asks
def spawn(
    asker: Asker,
    model: str,
    name: str,
    frame: str,
    namespace: str,
    joints: tuple[str, ...],
    pairs: tuple[str, ...],
    **place: float | None,
) -> None:
    """Put a MODEL into the world as NAME."""
    from messages.parameters import Assignment
    from messages.requests import SPAWN
    from messages.simulation import SpawnModel
    from services.runtime.parameters.record import read_assignments

    at = assignments(joints)
    reply = asker.ask(
        SPAWN,
        SpawnModel(
            name=name,
            model=model,
            pose=_pose({axis: value or 0.0 for axis, value in place.items()}),
            namespace=namespace,
            reference_frame=frame,
            joint_names=tuple(at),
            joint_positions=tuple(at.values()),
            parameters=tuple(Assignment(name=each, value=value) for each, value in read_assignments(pairs).items()),
        ),
    )
    asker.show(reply, f"{name} is there: {', '.join(_words(reply))}")


@click.command("delete")
@click.argument("name")
@asks
def delete(asker: Asker, name: str) -> None:
    """Take the model NAME out of the world."""
    from messages.requests import DELETE, Name

    reply = asker.ask(DELETE, Name(name=name))
    asker.show(reply, reply.text)


@click.command("state")
@click.argument("name")
@click.option("--relative", default="", help="As seen from this model or model::link, or from the world, in its axes.")
@asks
def state(asker: Asker, name: str, relative: str) -> None:
    """Tell pose and twist of a model, or of a link: NAME is model::link.

    Without --relative, a model's pose is in the world and its twist in its own axes.
    """
    from messages.gazebo import LinkName
    from messages.requests import GET_STATE, LINK_STATE
    from messages.simulation import GetModelState

    if "::" in name:
        link = asker.ask(LINK_STATE, LinkName(link_name=name, reference_frame=relative))
        asker.show(link, _told(link.pose, link.twist))
        return
    model = asker.ask(GET_STATE, GetModelState(name=name, relative_entity=relative))
    asker.show(model, _told(model.pose, model.twist))


@click.command("set-state")
@click.argument("name")
@placed
@click.option("--linear", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="Velocity, m/s.")
@click.option("--angular", type=float, nargs=3, default=(0.0, 0.0, 0.0), help="Turn rate, rad/s.")
@click.option("--frame", default="", help="Frame of pose and twist: world, a model, or model::link.")
@asks
def set_state(
    asker: Asker,
    name: str,
    linear: tuple[float, float, float],
    angular: tuple[float, float, float],
    frame: str,
    **place: float | None,
) -> None:
    """Move the model NAME; what is not stated of its pose stays. Its joints keep their angles."""
    from messages.geometry import Twist, Vector3
    from messages.requests import GET_STATE, SET_STATE
    from messages.simulation import GetModelState, SetModelState

    now = asker.ask(GET_STATE, GetModelState(name=name, relative_entity=frame)).pose
    roll, pitch, yaw = _angles(now.orientation)
    kept = {"x": now.position.x, "y": now.position.y, "z": now.position.z, "roll": roll, "pitch": pitch, "yaw": yaw}
    stated = {axis: value for axis, value in place.items() if value is not None}
    (vx, vy, vz), (wx, wy, wz) = linear, angular
    twist = Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))
    reply = asker.ask(
        SET_STATE, SetModelState(name=name, pose=_pose(kept | stated), twist=twist, reference_frame=frame)
    )
    asker.show(reply, f"{name}: {', '.join(_words(reply))}")


@click.command("properties")
@click.argument("name", default="")
@asks
def properties(asker: Asker, name: str) -> None:
    """Tell what the world is made of, or a model (NAME), or a link (model::link)."""
    from messages.gazebo import LinkName
    from messages.requests import LINK_PROPERTIES, MODEL_PROPERTIES, WORLD_PROPERTIES, Name
    from messages.std import Empty

    reply: Any
    if not name:
        reply = asker.ask(WORLD_PROPERTIES, Empty())
    elif "::" in name:
        reply = asker.ask(LINK_PROPERTIES, LinkName(link_name=name))
    else:
        reply = asker.ask(MODEL_PROPERTIES, Name(name=name))
    asker.show(reply, table((field, _plain(getattr(reply, field))) for field in reply.__struct_fields__))


def _pose(place: dict[str, float]) -> Pose:
    """A pose of x, y, z [m] and roll, pitch, yaw [rad] about fixed axes."""
    from messages.geometry import Point, Pose, Quaternion

    roll, pitch, yaw = (place[axis] / 2 for axis in ("roll", "pitch", "yaw"))
    cr, sr, cp, sp, cy, sy = (turn(half) for half in (roll, pitch, yaw) for turn in (math.cos, math.sin))
    return Pose(
        position=Point(x=place["x"], y=place["y"], z=place["z"]),
        orientation=Quaternion(
            x=sr * cp * cy - cr * sp * sy,
            y=cr * sp * cy + sr * cp * sy,
            z=cr * cp * sy - sr * sp * cy,
            w=cr * cp * cy + sr * sp * sy,
        ),
    )


def _angles(q: Quaternion) -> tuple[float, float, float]:
    """Roll, pitch and yaw, rad."""
    roll = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x * q.x + q.y * q.y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x))))
    return roll, pitch, q.yaw


def _shown(model: ModelState) -> tuple[str, str, str, str]:
    place = model.pose.position
    x, y, z, yaw = (f"{value:z.3f}" for value in (place.x, place.y, place.z, model.pose.orientation.yaw))
    return x, y, z, yaw


def _words(model: ModelState) -> list[str]:
    return [f"{name} {value}" for name, value in zip(("x", "y", "z", "yaw"), _shown(model), strict=True)]


def _told(pose: Pose, twist: Twist) -> str:
    place, turn = pose.position, _angles(pose.orientation)
    rows = [("", "x", "y", "z")]
    for name, (a, b, c) in (
        ("position m", (place.x, place.y, place.z)),
        ("roll, pitch, yaw rad", turn),
        ("velocity m/s", (twist.linear.x, twist.linear.y, twist.linear.z)),
        ("turn rate rad/s", (twist.angular.x, twist.angular.y, twist.angular.z)),
    ):
        rows.append((name, f"{a:z.4f}", f"{b:z.4f}", f"{c:z.4f}"))
    return table(rows)


def _plain(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if hasattr(value, "__struct_fields__"):
        parts = ((field, getattr(value, field)) for field in value.__struct_fields__)
        return ", ".join(f"{field} {_plain(part)}" for field, part in parts)
    return f"{value:g}" if isinstance(value, float) else str(value)
