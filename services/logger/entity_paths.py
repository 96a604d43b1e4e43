"""Where each thing lies in a recording: what other programs need to read it."""

from __future__ import annotations

TIMELINE = "sim_time"
"""Simulation time. After a reset the next timeline begins, see ``timeline``."""

LOG = "/log"
SPEED = "/plots/speed"
COMMANDED = "/plots/commanded"
CROSS_TRACK = "/plots/cross_track"
ODOMETRY_ERROR = "/plots/odometry_error"
DISTANCE = "/plots/distance"


def angle(robot: str) -> str:
    """What the controller of an arm wants and what is: two series, deg."""
    return f"/plots/angle/{robot}"


def error(robot: str) -> str:
    """Wanted angle less true one, deg."""
    return f"/plots/error/{robot}"


def effort(robot: str) -> str:
    """What the controller of an arm does, N m."""
    return f"/plots/effort/{robot}"


def timeline(resets: int) -> str:
    """``sim_time``, and ``sim_time_2`` after the first reset: time starts anew, so the two are never mixed."""
    return f"{TIMELINE}_{resets + 1}" if resets else TIMELINE


def transforms(robot: str) -> str:
    """Ground truth of a robot and its joints: transforms to its base from the world, and along its body."""
    return f"/{robot}/tf"


def marker(robot: str) -> str:
    """The disc and the name that make a small robot visible in a large world."""
    return f"/{robot}/marker"


def collisions(robot: str, model: str) -> str:
    """Collision shapes of a robot, as rerun's URDF reader places them."""
    return f"/{robot}/{model}/collision_geometries"


def trail(robot: str) -> str:
    """Where a robot has been."""
    return f"/trails/{robot}"


def odometry_trail(robot: str) -> str:
    """Where a robot has been by its odometry."""
    return f"/odometry/{robot}"


def goal(robot: str) -> str:
    """The goal that a robot heads for; none after its last."""
    return f"/goal/{robot}"


def goals(robot: str) -> str:
    """All goals of a robot."""
    return f"/reference/{robot}/goals"


def scan(robot: str) -> str:
    """What a robot's laser sees."""
    return f"/scan/{robot}"


def reference(robot: str) -> str:
    """Where a robot is to go."""
    return f"/reference/{robot}"
