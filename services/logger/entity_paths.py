"""Entity paths and timelines of a recording, which other programs need to read it."""

from __future__ import annotations

from rerun import escape_entity_path_part

TIMELINE = "sim_time"
"""Simulation time. After a reset the next timeline begins, see ``timeline``."""

LOG = "/log"
SPEED = "/plots/speed"
COMMANDED = "/plots/commanded"
CROSS_TRACK = "/plots/cross_track"
ODOMETRY_ERROR = "/plots/odometry_error"
DISTANCE = "/plots/distance"


def angle(robot: str) -> str:
    """Set point and angle of an arm's joint [deg], as two series."""
    return f"/plots/angle/{robot}"


def error(robot: str) -> str:
    """Set point minus angle [deg]."""
    return f"/plots/error/{robot}"


def effort(robot: str) -> str:
    """Effort of an arm's controller [N m]."""
    return f"/plots/effort/{robot}"


def timeline(resets: int) -> str:
    """``sim_time``, ``sim_time_2`` after the first reset, and so on: each reset starts a timeline of its own."""
    return f"{TIMELINE}_{resets + 1}" if resets else TIMELINE


def transforms(robot: str) -> str:
    """True transforms of a robot: from the world to its base, and of its joints."""
    return f"/{robot}/tf"


def marker(robot: str) -> str:
    """The disc and name that make a small robot visible in a large world."""
    return f"/{robot}/marker"


def collisions(robot: str, model: str) -> str:
    """Collision shapes of a robot, as rerun's URDF reader places them."""
    return f"/{robot}/{model}/collision_geometries"


def trail(robot: str) -> str:
    """A robot's true path so far."""
    return f"/trails/{robot}"


def odometry_trail(robot: str) -> str:
    """A robot's path so far by its odometry."""
    return f"/odometry/{robot}"


def goal(robot: str) -> str:
    """The goal that a robot heads for; none after its last."""
    return f"/goal/{robot}"


def goals(robot: str) -> str:
    """All goals of a robot."""
    return f"/reference/{robot}/goals"


def scan(robot: str) -> str:
    """The echoes of a robot's laser."""
    return f"/scan/{robot}"


def reference(robot: str) -> str:
    """A robot's reference path."""
    return f"/reference/{robot}"


WORLD_TF = "/world/tf"
"""Transforms of the bodies of the world that move."""

WORLD_BODIES = "/world/bodies"
"""The bodies of the world, each under its name."""

DISPLAYS = "/displays"
"""What nodes publish to be drawn, by topic."""


def display(topic: str, ns: str, number: int) -> str:
    """A marker of a topic."""
    return f"{DISPLAYS}{topic}/{escape_entity_path_part(ns or 'marker')}/{number}"


def turtle(name: str) -> str:
    """A turtle of turtlesim."""
    return f"/turtles/{name}"


def image(topic: str) -> str:
    """The pictures of a topic."""
    return f"/images{topic}"
