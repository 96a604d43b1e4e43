"""Facts about an imported robot, determined when its folder was created."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.base import DECODE_ERRORS
from models import not_in_cache
from models.robot_cache import is_imported


class Skid(msgspec.Struct, frozen=True, kw_only=True):
    """The driven wheels of a skid-steered base: the centre of their contact points in the root's frame [m], their mean
    friction, and the axles in the frames of their links."""

    middle: tuple[float, float, float]
    friction: float
    axles: dict[str, tuple[float, float, float]]


class BuiltWheels(msgspec.Struct, frozen=True, kw_only=True):
    """The driven wheels' dimensions by their shapes: distance between left and right, and the radii [m]."""

    track: float
    left_radius: float
    right_radius: float


class RobotFacts(msgspec.Struct, frozen=True, kw_only=True):
    """Facts about an imported robot.

    ``title`` is the name in the URDF; ``reach`` [m] is its extent from the root's z axis, ``lowest`` and ``highest``
    [m] are its vertical limits in the root's frame, with all joints at zero. ``origin`` is the user's file, empty for a
    text. ``height`` [m] is that of the root when the robot stands on the ground, ``starts`` [rad or m] are the start
    positions of joints whose range excludes zero.
    """

    name: str
    title: str = ""
    origin: str = ""
    reach: float = 0.0
    lowest: float = 0.0
    highest: float = 0.0
    notes: tuple[str, ...] = ()
    height: float = 0.0
    starts: dict[str, float] = {}
    skid: Skid | None = None
    wheels: BuiltWheels | None = None
    ignored: tuple[str, ...] = ()


def read_facts(model: str) -> RobotFacts:
    """Read the facts of an imported robot; raises UnknownModel."""
    try:
        return msgspec.json.decode((Path(model) / "facts.json").read_bytes(), type=RobotFacts)
    except (OSError, *DECODE_ERRORS):
        raise not_in_cache(model) from None


def read_notes(model: str) -> tuple[str, ...]:
    """Return the assumptions made about a robot; empty for a built-in one."""
    return read_facts(model).notes if is_imported(model) else ()
