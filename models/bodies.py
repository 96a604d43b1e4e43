"""Records of the bodies of a world and of its ground; ``models.world`` reads them."""

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
"""Minimum extent [m]; thinner shapes exceed the engine's numerical precision."""
LEAST_MASS = 1e-6
"""Minimum mass [kg]."""
Extent = Annotated[float, Meta(ge=LEAST_EXTENT, le=1e4, extra={"unit": "m"})]
Shade = Annotated[float, Meta(ge=0, le=1)]
Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, each from 0 to 1."""

GREY: Colour = (0.6, 0.6, 0.6, 1.0)
GROUND_NAME = "ground"
"""Name reserved for the ground."""
MAX_PARTS = 5000
"""Maximum number of shapes in a world: with as many boxes, PyBullet takes 0.7 ms per step and 0.4 s to load them."""
MAX_MOVABLE = 300
"""Maximum number of movable and moving bodies in a world."""


class BadWorld(BadInput):
    """A world's file, or one that it refers to, cannot be read; the text says where and why."""


@dataclass(frozen=True)
class BoxShape:
    """A box of full ``size`` [m] about its centre."""

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
    """A wedge that rises along x from 0 to the height of ``size`` [m]; its origin is its bounding box's centre."""

    size: Vector


@dataclass(frozen=True, eq=False)
class MeshShape:
    """A triangle mesh, already scaled; ``file`` and ``scale`` are its source, None for a generated one.

    A fixed one collides as it is; a movable, moving or ``convex`` one as its convex hull.
    """

    mesh: Mesh
    file: Path | None = None
    scale: Vector = (1.0, 1.0, 1.0)
    convex: bool = False


@dataclass(frozen=True, eq=False)
class HeightMapShape:
    """Heights [m] on a grid, shape (rows along y, columns along x), that covers ``size`` [m] about its centre."""

    heights: NDArray[np.float64]
    size: tuple[float, float]


Shape = BoxShape | CylinderShape | SphereShape | RampShape | MeshShape | HeightMapShape


@dataclass(frozen=True)
class BodyPart:
    """A shape at ``pose`` in the frame of its body. If not ``solid``, it is only displayed; if not ``visible``, it only
    collides. Wheels roll on ``ground``, and contact with it is not a collision."""

    shape: Shape
    pose: Pose3 = IDENTITY
    colour: Colour = GREY
    solid: bool = True
    visible: bool = True
    ground: bool = False


Repeat = Literal["loop", "there_and_back", "once"]


@dataclass(frozen=True)
class BodyPath:
    """Points [m] that a body's origin visits in straight lines at ``speed`` [m/s], starting at the first.

    It rests for ``pause`` [s] at each, and starts ``start`` [s] after the simulation. ``loop`` continues from the last
    point to the first, ``there_and_back`` returns the same way, ``once`` stays at the end.
    """

    points: tuple[Vector, ...]
    speed: float
    repeat: Repeat = "there_and_back"
    pause: float = 0.0
    start: float = 0.0

    def position_at(self, seconds: float) -> Vector:
        """Return the position [m] of the body at a time [s] since the start of the simulation."""
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
        """The straight legs of a round, each with its duration [s], and the duration of a round with pauses [s]."""
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
    """A body of the world, with its frame at ``pose`` at the start.

    It is fixed without a ``mass`` [kg], movable with one, and moving with a ``path``: it then pushes what is in its way
    and is not stopped. ``friction`` is multiplied by that of the other body. The ``centre`` of mass and the principal
    ``moments`` [kg m2] about the frame's axes are computed from the shapes unless stated.
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
        """Whether it is fixed, can be pushed, or follows a path."""
        if self.path is not None:
            return "moving"
        return "movable" if self.mass > 0 else "fixed"


@dataclass(frozen=True)
class Light:
    """A light that shines along ``direction``; camera images use the first one of a world."""

    name: str = ""
    direction: Vector = (0.0, 0.0, -1.0)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)


class Box(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Short form of a fixed box: full ``size`` and centre ``position`` [m], rotated by ``yaw`` [rad]."""

    name: str
    size: tuple[Extent, Extent, Extent]
    position: tuple[Coordinate, Coordinate, Coordinate]
    yaw: Angle = 0.0
    colour: tuple[Shade, Shade, Shade, Shade] = GREY

    def body(self) -> WorldBody:
        """Return the box as a body."""
        pose = Pose3(self.position, Pose3.planar(0.0, 0.0, self.yaw).orientation)
        return WorldBody(self.name, (BodyPart(BoxShape(self.size), colour=self.colour),), pose)


class Start(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A start pose for a robot, clear of everything: m, m, rad."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw: Angle = 0.0


@dataclass(frozen=True, kw_only=True)
class WorldDescription:
    """A level ground at z = 0 and the bodies on it: ``boxes`` in short form, ``bodies`` of every kind.

    ``friction`` is the ground's coefficient; that of a contact is its product with the wheel's. ``start`` is for robots
    of a fleet with ``pose = "world"``. ``notes`` list what was not understood in the world's file and ignored;
    ``missing``, a part of them, what was omitted because its files are not on this machine.
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
        """Boxes as bodies, then bodies."""
        return (*(box.body() for box in self.boxes), *self.bodies)
