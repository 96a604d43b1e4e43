"""What the movable joints of a robot may do, read from its URDF: kind, range, effort, speed, damping and friction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from xml.etree import ElementTree

from models import model_path


@dataclass(frozen=True)
class Limits:
    """A movable joint. rad or m, N m or N, rad/s or m/s; None where the URDF states no limit.

    ``velocity`` may be 0, which Gazebo takes for a limit and most URDFs mean as "unknown".
    """

    kind: str
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0


@cache
def read_limits(name: str) -> dict[str, Limits]:
    """The movable joints of the robot ``name`` by their names, in the URDF's order; raises ``models.UnknownModel``."""
    joints = ElementTree.parse(model_path(name)).getroot().findall("joint")
    return {each.attrib["name"]: _limits(each) for each in joints if each.attrib["type"] != "fixed"}


def _limits(joint: ElementTree.Element) -> Limits:
    kind, limit, dynamics = joint.attrib["type"], joint.find("limit"), joint.find("dynamics")
    given = {} if limit is None else limit.attrib
    told = {} if dynamics is None else dynamics.attrib
    ends = kind in ("revolute", "prismatic")
    return Limits(
        kind=kind,
        lower=float(given.get("lower", 0.0)) if ends else None,
        upper=float(given.get("upper", 0.0)) if ends else None,
        effort=_number(given, "effort"),
        velocity=_number(given, "velocity"),
        damping=float(told.get("damping", 0.0)),
        friction=float(told.get("friction", 0.0)),
    )


def _number(table: dict[str, str], name: str) -> float | None:
    return float(table[name]) if name in table else None
