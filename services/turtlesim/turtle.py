"""The motion of one turtle on a square plane: only kinematics, without network and drawing."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, replace
from typing import NamedTuple

from messages.se2 import wrap
from messages.turtlesim import Pose

PIXELS_PER_METRE = 45
"""A turtle in ROS's window is 45 pixels and one metre long."""
WINDOW_PIXELS = 500
PLANE_M = (WINDOW_PIXELS - 1) / PIXELS_PER_METRE
"""Side length of the plane [m], 11.0889: the window's pixels count from 0 to 499."""
COMMAND_TIMEOUT_NS = 1_000_000_000
"""Time [ns] for which a turtle obeys its last command."""
TURN_RATE = 1.0
"""Turn rate of a turtle that turns to a heading [rad/s]."""
HEADING_TOLERANCE = 0.02
"""Heading error that counts as reached [rad]."""


class Velocity(NamedTuple):
    """Velocity ahead and to the left [m/s], and turn rate to the left [rad/s]."""

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0


AT_REST = Velocity()


@dataclass(frozen=True)
class Turtle:
    """Position [m] from the lower left corner, heading [rad] in [-pi, pi], and the commanded velocity.

    ``commanded_at`` is the simulation time of its last command [ns]. ``at_wall`` means that a wall stopped it.
    """

    x: float
    y: float
    theta: float
    velocity: Velocity = AT_REST
    commanded_at: int = 0
    at_wall: bool = False

    def command(self, velocity: Velocity, now: int) -> Turtle:
        """Return the turtle under a new command."""
        return replace(self, velocity=velocity, commanded_at=now)

    def step(self, now: int, dt: float) -> Turtle:
        """Return the turtle ``dt`` [s] later, at ``now`` [ns]: as in ROS, it turns, then moves on its new heading."""
        velocity = self.velocity if now - self.commanded_at <= COMMAND_TIMEOUT_NS else AT_REST
        theta = wrap(self.theta + velocity.turn * dt)
        ahead, left = velocity.ahead * dt, velocity.left * dt
        moved = replace(
            self,
            x=self.x + math.cos(theta) * ahead - math.sin(theta) * left,
            y=self.y + math.sin(theta) * ahead + math.cos(theta) * left,
            theta=theta,
            velocity=velocity,
        )
        return moved.held_on_plane()

    def placed(self, x: float, y: float, theta: float) -> Turtle:
        """Return the turtle at another pose, with the same command."""
        return replace(self, x=x, y=y, theta=wrap(theta)).held_on_plane()

    def displaced(self, linear: float, angular: float) -> Turtle:
        """Return the turtle turned by ``angular`` [rad] and then moved ahead by ``linear`` [m]."""
        theta = self.theta + angular
        return self.placed(self.x + math.cos(theta) * linear, self.y + math.sin(theta) * linear, theta)

    def held_on_plane(self) -> Turtle:
        """Return the turtle clamped to the plane, if it is beyond a wall."""
        x, y = min(max(self.x, 0.0), PLANE_M), min(max(self.y, 0.0), PLANE_M)
        return replace(self, x=x, y=y, at_wall=(x, y) != (self.x, self.y))

    def remaining_turn(self, theta: float) -> float:
        """Return the angle to a heading, in [-pi, pi] [rad]."""
        return wrap(theta - self.theta)

    def pose(self) -> Pose:
        """Return the pose message, with the precision of ROS's ``float32``."""
        v = self.velocity
        speed = math.copysign(math.hypot(v.ahead, v.left), v.ahead) if v.left else v.ahead
        x, y, theta, linear, angular = array("f", (self.x, self.y, self.theta, speed, v.turn))
        return Pose(x=x, y=y, theta=theta, linear_velocity=linear, angular_velocity=angular)
