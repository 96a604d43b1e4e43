"""``elea model``: list the robot models, and check a robot's file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from deploy.commands.lazy_group import LazyCommand, LazyGroup
from deploy.commands.options import json_option, own_robot_options

if TYPE_CHECKING:
    from services.sim.model_check import ModelCheck

COMMANDS = {
    "list": LazyCommand("model:list_", "List the models that come with Elea."),
    "check": LazyCommand("model:check", "Check a robot's file: what is understood, what looks wrong, how it drives."),
}


@click.command("model", cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """List the robots that come with Elea, or check one of your own. Needs no network."""


@click.command("list")
@json_option
def list_(as_json: bool) -> None:
    """List the models that come with Elea."""
    from deploy.live.output import write_listing
    from models import MODELS
    from models.model import read_model

    write_listing({name: read_model(name).about for name in MODELS}, as_json)


@click.command("check")
@click.argument("model")
@click.option("--no-drive", is_flag=True, help="Only read the files; do not drive the robot.")
@own_robot_options
@json_option
def check(model: str, no_drive: bool, packages: tuple[Path, ...], xacro_args: dict[str, str], as_json: bool) -> None:
    """Check MODEL: a URDF, a xacro or a folder with one, or the name of a model that comes with Elea.

    Lists what is understood of its drive, sensors, joints, masses and friction, what looks wrong, and what is ignored.
    Then drives it in an empty world, without a network: 1 m straight, 360 degrees on the spot, 1 m sideways if it can,
    and moves each joint. The exit status is 1 if something is broken or a trial fails.
    """
    from deploy.live.output import write_json, write_text
    from services.sim.model_check import check_model

    found = check_model(model, Path.cwd(), not no_drive, packages, xacro_args)
    if as_json:
        import msgspec

        write_json(msgspec.to_builtins(found) | {"ok": found.ok})
    else:
        write_text(format_check(found))
    if not found.ok:
        raise SystemExit(1)


def format_check(found: ModelCheck) -> str:
    """Format the findings of a check."""
    lines = [f"{found.name}  {found.file}", f"  {found.about}", ""]
    facts: list[tuple[str, ...]] = [
        ("root", f"{found.root}, {1000 * found.height:.1f} mm above the ground{', fixed' * found.fixed_base}"),
        ("mass", f"{found.mass:.4g} kg in {found.links} links"),
        ("radius", f"{found.radius:.3f} m, of the circle around it"),
        *_base_rows(found),
    ]
    for each in found.sensors:
        frame = f" (frame {each.frame})" if each.frame != each.link else ""
        facts.append((each.kind, f"{each.topic} on {each.link}{frame}: {each.figures}"))
    if found.friction:
        facts.append(("friction", ", ".join(f"{link} {value:g}" for link, value in found.friction.items())))
    facts += [("topic", f"{ours}, also as {theirs}") for ours, theirs in found.topics.items()]
    lines += _rows(facts)
    if found.joints:
        lines += ["", "joints"]
        lines += _rows([("name", "type", "role", "limits", "effort", "velocity"), *map(_joint_row, found.joints)])
    for title, texts in (
        ("chosen", found.notes),
        ("ignored", found.ignored),
        ("doubtful", found.doubts),
        ("broken", found.broken),
    ):
        lines += ["", title, *(f"  {each}" for each in texts)] if texts else []
    if found.trials:
        lines += ["", "driven"]
        head = ("", "commanded", "actual", "error", "by the wheels", "")
        lines += _rows([head, *map(_trial_row, found.trials)])
        lines += [f"  {each}" for each in found.advice]
    failed = [each.name for each in found.trials if not each.ok]
    verdict = "ok" if found.ok else f"{len(found.broken)} broken" * bool(found.broken)
    if failed:
        verdict = f"{verdict}{', ' if verdict else ''}failed: {', '.join(failed)}"
    return "\n".join((*lines, "", verdict, ""))


def _base_rows(found: ModelCheck) -> list[tuple[str, str]]:
    base = found.base
    if base is None:
        return [("base", "none: its joints take efforts")]
    limits = f"{base.max_linear:.3g} m/s and {base.max_angular:.3g} rad/s, {base.acceleration:.3g} m/s2"
    source = "the wheels" if base.odometry == "encoder" else "the true pose"
    rows = [("base", f"{base.kind}, up to {limits}, odometry from {source}")]
    if base.radius is None:
        return rows
    left, right = ", ".join(base.left_joints), ", ".join(base.right_joints)
    rows.append(("wheels", f"left {left}; right {right}; {base.torque:.3g} N m each"))
    rows.append(("wheel radius", f"{base.radius:.4g} m, by the shapes {base.shape_radius:.4g} m"))
    more = f", times {base.separation_multiplier:.4g} because it skids" if base.separation_multiplier != 1 else ""
    rows.append(("separation", f"{base.separation:.4g} m, by the wheels {base.track:.4g} m{more}"))
    return rows


def _joint_row(joint: object) -> tuple[str, ...]:
    from services.sim.model_check import JointFacts

    assert isinstance(joint, JointFacts)
    limits = "" if joint.lower is None or joint.upper is None else f"{joint.lower:.3g} to {joint.upper:.3g}"
    role = joint.role + (f" ({', '.join(joint.interfaces)})" if joint.interfaces else "")
    return joint.name, joint.type, role, limits, _figure(joint.effort), _figure(joint.velocity)


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _trial_row(trial: object) -> tuple[str, ...]:
    from services.sim.model_check import TrialFacts

    assert isinstance(trial, TrialFacts)
    counted = "" if trial.counted is None else f"{trial.counted:.4f} {trial.unit}"
    verdict = "" if trial.ok else "FAILED: "
    return (
        trial.name,
        f"{trial.commanded:.4f} {trial.unit}",
        f"{trial.actual:.4f} {trial.unit}",
        f"{100 * trial.error:+.2f} %",
        counted,
        verdict + trial.remark,
    )


def _rows(rows: Sequence[tuple[str, ...]]) -> list[str]:
    from deploy.live.output import format_table

    return [f"  {line}" for line in format_table(rows).splitlines()]
