"""The loop of the state service: descriptions and joint states in; transforms, and merged joint states, out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import models
from messages.names import BadName, absolute_namespace
from messages.tf import TFMessage, split
from messages.topics import TF, TF_STATIC
from models.description import LARGEST, BadDescription
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.state import StateParameters
from services.state.neighbours import Neighbours
from services.state.robot import Robot


def run(ctx: Context[StateParameters]) -> None:
    """Tell where the links are until told to stop."""
    robots = crew(ctx)
    moving, fixed = ctx.writer(TF), ctx.writer(TF_STATIC)
    others, neighbours = ctx.kernel.read(TF_STATIC), Neighbours(fixed.publisher)
    stale = any(robot.links for robot in robots)
    for tick in ctx.ticks():
        for robot in robots:
            if tick.reset:
                robot.restart()
            stale = robot.renew() or stale
        if stale or tick.reset:
            fixed.publish(
                TFMessage(
                    transforms=tuple(each for robot in robots if robot.links for each in robot.links.fixed(tick.time))
                )
            )
            stale = False
        transforms = [each for robot in robots for each in robot.moved(tick.time)]
        for message in split(transforms):
            moving.publish(message)
        neighbours.hear(others.batch)
        for robot in robots:
            if twice := neighbours.twice(robot.links.frames if robot.links else frozenset()):
                ctx.log.error(
                    f"{robot.who}: frames {_some(twice)} are published by another node, too; a frame has one "
                    "publisher: for a robot of the simulation, set enable_link_tf = false among its parameters, "
                    "or end this service"
                )
        ctx.kernel.heart.note = note(robots)


def crew(ctx: Context[StateParameters]) -> list[Robot]:
    """The robots that the parameters name; raises BadInput for a name, a model or a URDF that is wrong."""
    p = ctx.params
    if p.model and p.urdf:
        raise BadInput(f"state: both model {p.model!r} and urdf {p.urdf!r} are given: one of them describes the robot")
    try:
        namespaces = [absolute_namespace(each) for each in p.robots or (ctx.namespace,)]
        if len(set(namespaces)) < len(namespaces):
            raise BadInput(f"state: robots {', '.join(p.robots)}: a name comes twice")
        if p.frame_prefix is not None and len(namespaces) > 1:
            raise BadInput("state: frame_prefix is for one robot; several have their namespaces for prefixes")
        urdf = description(p.model, p.urdf)
        return [Robot(ctx, each, urdf) for each in namespaces]
    except (BadName, BadDescription) as error:
        where = p.urdf or p.model
        raise BadInput(f"state{f', {where}' if where else ''}: {error}") from None


def description(model: str, urdf: str) -> str:
    """The text of the URDF of a model or in a file; empty when none is named. Raises BadInput."""
    if not model and not urdf:
        return ""
    try:
        path = models.model_path(model) if model else Path(urdf)
        if path.stat().st_size > 4 * LARGEST:
            raise BadInput(f"state: {path} has {path.stat().st_size} bytes: it is no URDF")
        return path.read_text(encoding="utf-8")
    except models.UnknownModel as error:
        raise BadInput(f"state: {error}; for a URDF of your own, give urdf its path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"state: the URDF {urdf} cannot be read: {getattr(error, 'strerror', None) or error}") from None


def note(robots: Sequence[Robot]) -> str:
    """What a heartbeat says."""
    waiting = [robot.who for robot in robots if robot.links is None]
    refused = sum(robot.refused for robot in robots)
    parts = [f"no description of {', '.join(waiting)}"] if waiting else []
    parts += [f"{refused} messages refused"] if refused else []
    return "; ".join(parts)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
