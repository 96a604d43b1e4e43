"""Facts about a robot from outside, found when its folder was made."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.base import DECODE_ERRORS
from models import UnknownModel
from models.robot_cache import is_made


class Skid(msgspec.Struct, frozen=True, kw_only=True):
    """The driven wheels of a base that skids: the middle of where they touch the ground, in the root's frame [m], the
    mean of their friction, and the axles in the frames of their links."""

    middle: tuple[float, float, float]
    friction: float
    axles: dict[str, tuple[float, float, float]]


class BuiltWheels(msgspec.Struct, frozen=True, kw_only=True):
    """The driven wheels as the shapes have them: the distance between left and right and the radii, m."""

    track: float
    left_radius: float
    right_radius: float


class RobotFacts(msgspec.Struct, frozen=True, kw_only=True):
    """What was found out about a robot from outside.

    ``title`` is what the URDF calls it; ``reach`` [m] is how far it extends from the root's z axis, ``lowest`` and
    ``highest`` [m] are its ends above the root's frame, all joints at zero. ``origin`` is the user's file, empty for a
    text. ``height`` [m] is how high the root stands when the robot touches the ground, ``starts`` [rad or m] where
    joints start that may not stand at zero.
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
    """What was found out about a robot that was made; raises UnknownModel."""
    try:
        return msgspec.json.decode((Path(model) / "facts.json").read_bytes(), type=RobotFacts)
    except (OSError, *DECODE_ERRORS):
        raise UnknownModel(f"there is no robot {model} any more: spawn it, or start the fleet, by its file") from None


def read_notes(model: str) -> tuple[str, ...]:
    """What was assumed of a robot; nothing of one of this folder."""
    return read_facts(model).notes if is_made(model) else ()
