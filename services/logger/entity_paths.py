"""Entity paths and timelines of a recording, which other programs need to read it."""

from __future__ import annotations

from rerun import escape_entity_path_part

TIMELINE = "sim_time"
"""Timeline of simulation time. After a reset the next timeline begins, see ``timeline``."""

LOG = "/log"
SPEED = "/plots/speed"
COMMANDED = "/plots/commanded"
CROSS_TRACK = "/plots/cross_track"
ODOMETRY_ERROR = "/plots/odometry_error"
DISTANCE = "/plots/distance"


def angle(robot: str) -> str:
    """Return the entity of an arm's set-point and joint angle [deg], two series."""
    return f"/plots/angle/{robot}"


def error(robot: str) -> str:
    """Return the entity of set-point minus angle [deg]."""
    return f"/plots/error/{robot}"


def effort(robot: str) -> str:
    """Return the entity of the effort of an arm's controller [N m]."""
    return f"/plots/effort/{robot}"


def timeline(resets: int) -> str:
    """Return ``sim_time``, ``sim_time_2`` after the first reset, and so on: each reset starts a new timeline."""
    return f"{TIMELINE}_{resets + 1}" if resets else TIMELINE


def transforms(robot: str) -> str:
    """Return the entity of a robot's true transforms: from the world to its base, and of its joints."""
    return f"/{robot}/tf"


def marker(robot: str) -> str:
    """Return the entity of the disc and name that make a small robot visible in a large world."""
    return f"/{robot}/marker"


def collisions(robot: str, model: str) -> str:
    """Return the entity of a robot's collision shapes, as placed by rerun's URDF reader."""
    return f"/{robot}/{model}/collision_geometries"


def trail(robot: str) -> str:
    """Return the entity of a robot's true path so far."""
    return f"/trails/{robot}"


def odometry_trail(robot: str) -> str:
    """Return the entity of a robot's path so far by its odometry."""
    return f"/odometry/{robot}"


def goal(robot: str) -> str:
    """Return the entity of a robot's current goal; none after its last."""
    return f"/goal/{robot}"


def goals(robot: str) -> str:
    """Return the entity of all goals of a robot."""
    return f"/reference/{robot}/goals"


def scan(robot: str) -> str:
    """Return the entity of the echoes of a robot's laser."""
    return f"/scan/{robot}"


def reference(robot: str) -> str:
    """Return the entity of a robot's reference path."""
    return f"/reference/{robot}"


WORLD_TF = "/world/tf"
"""Entity of the transforms of the moving bodies of the world."""

WORLD_BODIES = "/world/bodies"
"""Entity of the bodies of the world, each under its name."""

DISPLAYS = "/displays"
"""Entity of displayed messages, by topic."""


def display(topic: str, ns: str, number: int) -> str:
    """Return the entity of a marker of a topic."""
    return f"{DISPLAYS}{topic}/{escape_entity_path_part(ns or 'marker')}/{number}"


def turtle(name: str) -> str:
    """Return the entity of a turtle of turtlesim."""
    return f"/turtles/{name}"


def image(topic: str) -> str:
    """Return the entity of a topic's images."""
    return f"/images{topic}"
