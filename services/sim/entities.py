"""Entities by name, scoped as in Gazebo (models, links, joints and the world), and states relative to one of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from messages.geometry import Pose, Twist, Vector3
from messages.se3 import IDENTITY, Pose3, quaternion_conjugate, quaternion_multiply, rotate_inverse
from services.runtime.errors import BadInput, unknown_name
from services.sim.physics.world import BodyState, World

WORLD_FRAMES = ("", "world", "map", "/map", "/world")
"""Names of the world as a frame."""

WORLD_STATE = BodyState(IDENTITY.position, IDENTITY.orientation, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""The world's own state: at the origin, at rest."""


class ScopedName(NamedTuple):
    """A link or joint of a body."""

    body: str
    name: str

    def __str__(self) -> str:
        return f"{self.body}::{self.name}"


def world_body(world: World, name: str) -> str:
    """Return the body of the world that is named, alone or with its only link as ``body::link``; empty if none is."""
    return next((each for each in (name, name.removesuffix("::link")) if each in world.world_bodies), "")


def find_link(world: World, name: str) -> ScopedName:
    """Resolve a link: ``model::link``, ``model/link``, a model (its root), or a link name that only one model has.

    Raises BadInput with the alternatives.
    """
    if body := world_body(world, name):
        raise BadInput(
            f"{body} is a body of the world: wrenches act on the links of spawned models only, and only these have "
            "link properties"
        )
    if name in world.names:
        return ScopedName(name, world.body(name).links[0])
    return _find("link", name, world.names, lambda body: world.body(body).links)


def find_joint(world: World, model: str, name: str) -> ScopedName:
    """Resolve the movable joint ``name`` of ``model``; with an empty model, like ``find_link``. Raises BadInput."""
    if model:
        if model not in world.names:
            raise unknown_name("model", model, world.names)
        for prefix in (f"{model}::", f"{model}/"):
            name = name.removeprefix(prefix)
        joints = world.body(model).joints
        if name not in joints:
            raise unknown_name("joint", name, joints, model)
        return ScopedName(model, name)
    return _find("joint", name, world.names, lambda body: world.body(body).joints)


def frame_state(world: World, name: str) -> BodyState:
    """Return the pose and velocity of the frame ``name`` in the world; raises BadInput."""
    if name in WORLD_FRAMES:
        return WORLD_STATE
    if body := world_body(world, name):
        return world.world_body_state(body)
    link = find_link(world, name)
    return world.body(link.body).link_state(link.name)


def relative_state(frame: BodyState, state: BodyState) -> BodyState:
    """Return a state in the axes of a frame; its velocities are differences, as in Gazebo."""
    orientation = frame.orientation
    return BodyState(
        rotate_inverse(orientation, _difference(state.position, frame.position)),
        quaternion_multiply(quaternion_conjugate(orientation), state.orientation),
        rotate_inverse(orientation, _difference(state.linear, frame.linear)),
        rotate_inverse(orientation, _difference(state.angular, frame.angular)),
    )


def to_world_pose(frame: BodyState, place: Pose3) -> Pose3:
    """Convert the pose ``place`` in a frame to a pose in the world."""
    return Pose3(frame.position, frame.orientation) @ place


def pose_and_twist(state: BodyState) -> tuple[Pose, Twist]:
    """Convert a state to messages, axes unchanged."""
    (vx, vy, vz), (wx, wy, wz) = state.linear, state.angular
    return (
        Pose3(state.position, state.orientation).to_msg(),
        Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz)),
    )


def _find(kind: str, name: str, bodies: Iterable[str], parts: Callable[[str], tuple[str, ...]]) -> ScopedName:
    for scope in ("::", "/"):
        body, found, part = name.rpartition(scope)
        if found and body in bodies:
            if part not in parts(body):
                raise unknown_name(kind, part, parts(body), body)
            return ScopedName(body, part)
        if found and scope == "::":
            raise unknown_name("model", body, bodies)
    owners = [ScopedName(body, name) for body in bodies if name in parts(body)]
    if len(owners) == 1:
        return owners[0]
    if owners:
        raise BadInput(f"{len(owners)} models have a {kind} {name!r}: say which, {' or '.join(map(str, owners))}")
    raise unknown_name(kind, name, [f"{body}::{part}" for body in bodies for part in parts(body)])


def _difference(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]
