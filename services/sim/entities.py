"""Entities by name, as Gazebo scopes them: a model, or a link of one, or the world; and what one sees of another."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from messages.geometry import Point, Pose, Quaternion, Twist, Vector3
from services.runtime.errors import BadInput, unknown
from services.runtime.frames.rigid import product
from services.sim.physics.rotation import into_body, into_world
from services.sim.physics.world import ORIGIN, BodyState, Placement, World

WORLD_FRAMES = ("", "world", "map", "/map", "/world")
"""The names of the world as a frame."""

AT_REST = BodyState(ORIGIN.position, ORIGIN.orientation, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""The world, seen from itself."""


class Part(NamedTuple):
    """A link or joint of a body."""

    body: str
    name: str

    def __str__(self) -> str:
        return f"{self.body}::{self.name}"


def link_named(world: World, name: str) -> Part:
    """The link that ``name`` means: ``model::link``, ``model/link``, a model's root, or a link that one model only has.

    Raises BadInput with the alternatives.
    """
    if name in world.names:
        return Part(name, world.links(name)[0])
    return _part("link", name, world.names, world.links)


def joint_named(world: World, model: str, name: str) -> Part:
    """The movable joint ``name`` of ``model``; with an empty model as ``link_named``, of which this is the twin."""
    if model:
        if model not in world.names:
            raise unknown("model", model, world.names)
        for prefix in (f"{model}::", f"{model}/"):
            name = name.removeprefix(prefix)
        if name not in world.joints(model):
            raise unknown("joint", name, world.joints(model), model)
        return Part(model, name)
    return _part("joint", name, world.names, world.joints)


def frame_state(world: World, name: str) -> BodyState:
    """Where the frame ``name`` is in the world and how it moves; raises BadInput."""
    return AT_REST if name in WORLD_FRAMES else world.link_state(*link_named(world, name))


def seen_from(frame: BodyState, state: BodyState) -> BodyState:
    """A state in the axes of a frame; its velocities are the differences, as Gazebo has them."""
    turn = frame.orientation
    i, j, k, w = turn
    return BodyState(
        into_body(turn, _less(state.position, frame.position)),
        product((-i, -j, -k, w), state.orientation),
        into_body(turn, _less(state.linear, frame.linear)),
        into_body(turn, _less(state.angular, frame.angular)),
    )


def placed_in(frame: BodyState, place: Placement) -> Placement:
    """Where in the world something is that has ``place`` in a frame."""
    x, y, z = into_world(frame.orientation, place.position)
    a, b, c = frame.position
    return Placement((a + x, b + y, c + z), product(frame.orientation, place.orientation))


def pose_and_twist(state: BodyState) -> tuple[Pose, Twist]:
    """A state as messages have it, axes unchanged."""
    (x, y, z), (i, j, k, w) = state.position, state.orientation
    (vx, vy, vz), (wx, wy, wz) = state.linear, state.angular
    return (
        Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w)),
        Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz)),
    )


def _part(kind: str, name: str, bodies: Iterable[str], parts: Callable[[str], tuple[str, ...]]) -> Part:
    for scope in ("::", "/"):
        body, found, part = name.rpartition(scope)
        if found and body in bodies:
            if part not in parts(body):
                raise unknown(kind, part, parts(body), body)
            return Part(body, part)
        if found and scope == "::":
            raise unknown("model", body, bodies)
    owners = [Part(body, name) for body in bodies if name in parts(body)]
    if len(owners) == 1:
        return owners[0]
    if owners:
        raise BadInput(f"{len(owners)} models have a {kind} {name!r}: say which, {' or '.join(map(str, owners))}")
    raise unknown(kind, name, [f"{body}::{part}" for body in bodies for part in parts(body)])


def _less(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]
