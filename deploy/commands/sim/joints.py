"""``elea sim effort`` and its like: joints, efforts on them, and wrenches on links."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from deploy.commands.sim.ask import Asker, asks, assignments, table

if TYPE_CHECKING:
    from messages.joints import JointProperties

Three = tuple[float, float, float]
NOTHING = (0.0, 0.0, 0.0)
NUMBERS = {"ignore_unknown_options": True}
"""So that a negative number is no option."""

start_option = click.option(
    "--start", type=click.FloatRange(0, 1e9), default=0.0, help="Time at which it begins, s; now."
)
duration_option = click.option(
    "--duration", type=float, default=1.0, help="How long it acts, s; 1. Negative: until it is cleared."
)


@click.command("joints")
@click.argument("name", default="")
@asks
def joints(asker: Asker, name: str) -> None:
    """Tell what joints are and do: all, those of a model, or one (model::joint)."""
    from messages.gazebo import JointName
    from messages.requests import JOINT_PROPERTIES, LIST, MODEL_PROPERTIES, Name
    from messages.std import Empty

    models = [each.name for each in asker.ask(LIST, Empty()).models]
    if name and name not in models:
        found = [asker.ask(JOINT_PROPERTIES, JointName(joint_name=name))]
    else:
        found = []
        for model in [name] if name else models:
            for joint in asker.ask(MODEL_PROPERTIES, Name(name=model)).joints:
                found.append(asker.ask(JOINT_PROPERTIES, JointName(model=model, joint_name=joint)))
    asker.show(found, _table(found) if found else "no joint moves")


@click.command("effort", context_settings=NUMBERS)
@click.argument("joint")
@click.argument("effort", type=float)
@start_option
@duration_option
@asks
def effort(asker: Asker, joint: str, effort: float, start: float, duration: float) -> None:
    """Put EFFORT, in N m or N, on a JOINT for a time."""
    from messages.gazebo import ApplyEffort
    from messages.joints import JointEffort
    from messages.requests import APPLY_EFFORT
    from messages.std import Time

    job = JointEffort(
        joint_name=joint, effort=effort, start_time=Time.of(round(start * 1e9)), duration=_until(duration)
    )
    reply = asker.ask(APPLY_EFFORT, ApplyEffort(job=job))
    asker.show(reply, reply.text)


@click.command("wrench")
@click.argument("link")
@click.option("--force", type=float, nargs=3, default=NOTHING, help="N.")
@click.option("--torque", type=float, nargs=3, default=NOTHING, help="N m.")
@click.option("--point", type=float, nargs=3, default=NOTHING, help="Of the link, where the force acts, m; its origin.")
@click.option("--frame", default="", help="Whose axes these are: the world (default), a model, or model::link.")
@start_option
@duration_option
@asks
def wrench(
    asker: Asker, link: str, force: Three, torque: Three, point: Three, frame: str, start: float, duration: float
) -> None:
    """Push and twist a LINK (model::link), or a model at its root."""
    from messages.gazebo import ApplyWrench
    from messages.geometry import Point, Vector3, Wrench
    from messages.requests import APPLY_WRENCH
    from messages.std import Time

    (fx, fy, fz), (tx, ty, tz), (x, y, z) = force, torque, point
    reply = asker.ask(
        APPLY_WRENCH,
        ApplyWrench(
            body_name=link,
            reference_frame=frame,
            reference_point=Point(x=x, y=y, z=z),
            wrench=Wrench(force=Vector3(x=fx, y=fy, z=fz), torque=Vector3(x=tx, y=ty, z=tz)),
            start_time=Time.of(round(start * 1e9)),
            duration=_until(duration),
        ),
    )
    asker.show(reply, reply.text)


@click.command("clear")
@click.argument("name")
@click.option("--wrench", "of_link", is_flag=True, help="NAME is a link: drop the wrenches on it.")
@asks
def clear(asker: Asker, name: str, of_link: bool) -> None:
    """Drop the efforts on the joint NAME, those that wait included."""
    from messages.gazebo import JointName, LinkName
    from messages.requests import CLEAR_EFFORT, CLEAR_WRENCH

    if of_link:
        reply = asker.ask(CLEAR_WRENCH, LinkName(link_name=name))
    else:
        reply = asker.ask(CLEAR_EFFORT, JointName(joint_name=name))
    asker.show(reply, reply.text)


@click.command("configure")
@click.argument("model")
@click.argument("positions", nargs=-1, required=True, metavar="JOINT=POSITION...")
@asks
def configure(asker: Asker, model: str, positions: tuple[str, ...]) -> None:
    """Put joints of a MODEL at positions, in rad or m, at rest; the others stay as they are."""
    from messages.gazebo import SetConfiguration
    from messages.requests import SET_CONFIGURATION

    wanted = assignments(positions)
    reply = asker.ask(
        SET_CONFIGURATION,
        SetConfiguration(model=model, joint_names=tuple(wanted), joint_positions=tuple(wanted.values())),
    )
    stand = (f"{name} {position:g}" for name, position in zip(reply.name, reply.position, strict=True))
    asker.show(reply, f"{model}: {', '.join(stand)}")


def _until(duration: float) -> float:
    """Any negative duration is "until cleared", which travels as -1."""
    return duration if duration >= 0 else -1.0


def _table(found: list[JointProperties]) -> str:
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
                _limit(each.effort_limit),
                _limit(each.velocity_limit),
                f"{each.damping:g}",
            )
        )
    return table(rows)


def _limit(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"
