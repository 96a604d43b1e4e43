"""The bodies of a world and the ground they are on, as records; ``models.world`` reads them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from messages.errors import BadInput
from messages.se3 import IDENTITY, Pose3, Vector
from models.angles import Angle

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from models.mesh import Mesh

Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4, extra={"unit": "m"})]
LEAST_EXTENT = 1e-4
"""m; thinner shapes leave the numbers that the engine computes with."""
LEAST_MASS = 1e-6
"""kg."""
Extent = Annotated[float, Meta(ge=LEAST_EXTENT, le=1e4, extra={"unit": "m"})]
Shade = Annotated[float, Meta(ge=0, le=1)]
Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""

GREY: Colour = (0.6, 0.6, 0.6, 1.0)
GROUND_NAME = "ground"
"""The name that the ground has, and no body."""
MAX_PARTS = 5000
"""Shapes of a world: with as many boxes, PyBullet takes 0.7 ms for a step and 0.4 s to load them."""
MAX_MOVABLE = 300
"""Movable and moving bodies of a world."""


class BadWorld(BadInput):
    """A world's file, or one that it names, cannot be read; the text says where and why."""


@dataclass(frozen=True)
class BoxShape:
    """A box of the full ``size`` [m] about its centre."""

    size: Vector


@dataclass(frozen=True)
class CylinderShape:
    """A cylinder of ``radius`` and ``length`` [m] along z about its centre."""

    radius: float
    length: float


@dataclass(frozen=True)
class SphereShape:
    """A sphere of ``radius`` [m]."""

    radius: float


@dataclass(frozen=True)
class RampShape:
    """A wedge that rises along x from nothing to the full height of ``size`` [m]; its origin is in the middle of the
    box around it."""

    size: Vector


@dataclass(frozen=True, eq=False)
class MeshShape:
    """A triangle mesh, scaled already; ``file`` and ``scale`` are where it is from, None for one made here.

    A fixed one collides as it is, a movable or moving one, or a ``convex`` one, as its convex hull.
    """

    mesh: Mesh
    file: Path | None = None
    scale: Vector = (1.0, 1.0, 1.0)
    convex: bool = False


@dataclass(frozen=True, eq=False)
class HeightMapShape:
    """Heights [m] over a grid, shape (rows along y, columns along x), that covers ``size`` [m] about its centre."""

    heights: NDArray[np.float64]
    size: tuple[float, float]


Shape = BoxShape | CylinderShape | SphereShape | RampShape | MeshShape | HeightMapShape


@dataclass(frozen=True)
class BodyPart:
    """A shape at ``pose`` in the frame of its body. What is not ``solid`` is only shown, what is not ``visible`` is
    only felt. On a ``ground`` wheels roll, and standing on it is not a collision."""

    shape: Shape
    pose: Pose3 = IDENTITY
    colour: Colour = GREY
    solid: bool = True
    visible: bool = True
    ground: bool = False


Repeat = Literal["loop", "there_and_back", "once"]


@dataclass(frozen=True)
class BodyPath:
    """Points [m] that a body's origin passes at ``speed`` [m/s] on straight lines, from the first one on.

    It rests for ``pause`` [s] at each, and sets out ``start`` [s] after the simulation began. ``loop`` goes from the
    last point to the first, ``there_and_back`` returns on its way, ``once`` stays at the end.
    """

    points: tuple[Vector, ...]
    speed: float
    repeat: Repeat = "there_and_back"
    pause: float = 0.0
    start: float = 0.0

    def position_at(self, seconds: float) -> Vector:
        """Where the body is at a time [s] after the simulation began."""
        legs, period = self._legs
        elapsed = seconds - self.start - self.pause
        if elapsed <= 0 or not legs:
            return self.points[0]
        if self.repeat != "once":
            elapsed = math.fmod(elapsed, period)
        for duration, origin, target in legs:
            if elapsed < duration:
                share = elapsed / duration
                return (
                    origin[0] + share * (target[0] - origin[0]),
                    origin[1] + share * (target[1] - origin[1]),
                    origin[2] + share * (target[2] - origin[2]),
                )
            elapsed -= duration
            if elapsed < self.pause:
                return target
            elapsed -= self.pause
        return legs[-1][2]

    @cached_property
    def _legs(self) -> tuple[list[tuple[float, Vector, Vector]], float]:
        """The straight parts of one round, each with its duration [s], and the time of a round with its pauses."""
        stops = list(self.points)
        if self.repeat == "loop":
            stops.append(stops[0])
        elif self.repeat == "there_and_back":
            stops += stops[-2::-1]
        legs = [(math.dist(one, other) / self.speed, one, other) for one, other in pairwise(stops) if one != other]
        return legs, sum(leg[0] + self.pause for leg in legs)


Kind = Literal["fixed", "movable", "moving"]


@dataclass(frozen=True)
class WorldBody:
    """Something in the world, its frame at ``pose`` at the start.

    It is fixed without a ``mass`` [kg], movable with one, and moving with a ``path``: then it pushes what is in its way
    and nothing holds it up. ``friction`` is multiplied by that of what touches it. ``centre`` of mass and principal
    ``moments`` [kg m2] about the frame's axes follow from the shapes unless stated.
    """

    name: str
    parts: tuple[BodyPart, ...]
    pose: Pose3 = IDENTITY
    mass: float = 0.0
    friction: float = 0.5
    centre: Vector | None = None
    moments: Vector | None = None
    path: BodyPath | None = None

    @property
    def kind(self) -> Kind:
        """Whether it stays, can be pushed, or moves by itself."""
        if self.path is not None:
            return "moving"
        return "movable" if self.mass > 0 else "fixed"


@dataclass(frozen=True)
class Light:
    """A light that shines along ``direction``; the camera's pictures have the first one of a world."""

    name: str = ""
    direction: Vector = (0.0, 0.0, -1.0)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)


class Box(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A fixed box in short: full ``size`` and centre ``position`` in m, turned by ``yaw`` [rad]."""

    name: str
    size: tuple[Extent, Extent, Extent]
    position: tuple[Coordinate, Coordinate, Coordinate]
    yaw: Angle = 0.0
    colour: tuple[Shade, Shade, Shade, Shade] = GREY

    def body(self) -> WorldBody:
        """The same as a body."""
        pose = Pose3(self.position, Pose3.planar(0.0, 0.0, self.yaw).orientation)
        return WorldBody(self.name, (BodyPart(BoxShape(self.size), colour=self.colour),), pose)


class Start(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a robot starts in a world, clear of everything: m, m, rad."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw: Angle = 0.0


@dataclass(frozen=True, kw_only=True)
class WorldDescription:
    """A level ground at z = 0, and what stands on it: ``boxes`` in short, and ``bodies`` of every kind.

    ``friction`` is the ground's coefficient; the one of a contact is its product with the wheel's. ``start`` is for the
    robots of a fleet that asks for it, ``pose = "world"``. ``notes`` name what of the world's file was not understood,
    and ignored; ``missing`` of them what was left out since its files are not on this machine.
    """

    about: str = ""
    start: Start | None = None
    friction: float = 1.0
    boxes: tuple[Box, ...] = ()
    bodies: tuple[WorldBody, ...] = ()
    lights: tuple[Light, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False)
    missing: tuple[str, ...] = field(default=(), compare=False)

    @cached_property
    def all_bodies(self) -> tuple[WorldBody, ...]:
        """Boxes and bodies, in this order."""
        return (*(box.body() for box in self.boxes), *self.bodies)
