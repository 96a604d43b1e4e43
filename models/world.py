"""A world without robots: the ground and the boxes that stand on it, from ``models/worlds/<name>.toml``."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from models import world_path

Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4, extra={"unit": "m"})]
Extent = Annotated[float, Meta(gt=0, le=1e4, extra={"unit": "m"})]
Shade = Annotated[float, Meta(ge=0, le=1)]


class Box(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An obstacle that does not move: full ``size`` and centre ``position`` in m, turned by ``yaw`` [rad]."""

    name: str
    size: tuple[Extent, Extent, Extent]
    position: tuple[Coordinate, Coordinate, Coordinate]
    yaw: float = 0.0
    colour: tuple[Shade, Shade, Shade, Shade] = (0.6, 0.6, 0.6, 1.0)


class Start(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a robot starts in a world, clear of everything: m, m, rad."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw: float = 0.0


class WorldDescription(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A level ground at z = 0 and obstacles on it.

    ``friction`` is the ground's coefficient; the one of a contact is its product with the wheel's. ``start`` is for the
    robots of a fleet that asks for it, ``pose = "world"``.
    """

    about: str = ""
    start: Start | None = None
    friction: Annotated[float, Meta(ge=0, le=10)] = 1.0
    boxes: tuple[Box, ...] = ()


def read_world(name: str) -> WorldDescription:
    """The world ``name``; raises ``models.UnknownModel``."""
    return msgspec.toml.decode(world_path(name).read_bytes(), type=WorldDescription)
