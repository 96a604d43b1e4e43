"""The motion of one turtle on a square plane: kinematics alone, without network and drawing."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, replace
from typing import NamedTuple

from messages.se2 import wrap
from messages.turtlesim import Pose

PIXELS_PER_METRE = 45
"""A turtle of ROS's window is 45 pixels and one metre long."""
WINDOW_PIXELS = 500
PLANE_M = (WINDOW_PIXELS - 1) / PIXELS_PER_METRE
"""Length of the plane's sides [m], 11.0889: the window's pixels count from 0 to 499."""
COMMAND_TIMEOUT_NS = 1_000_000_000
"""For so long a turtle obeys its last command."""
TURN_RATE = 1.0
"""Of a turtle that turns to a heading [rad/s]."""
HEADING_TOLERANCE = 0.02
"""Distance to a heading that counts as reached [rad]."""


class Velocity(NamedTuple):
    """Velocity ahead and to the left [m/s], and turn rate to the left [rad/s]."""

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0


AT_REST = Velocity()


@dataclass(frozen=True)
class Turtle:
    """Position [m] from the lower left corner, heading [rad] in [-pi, pi], and the velocity that it obeys.

    ``commanded_at`` is the simulation time of its last command [ns]. ``at_wall`` says that it was held on the plane.
    """

    x: float
    y: float
    theta: float
    velocity: Velocity = AT_REST
    commanded_at: int = 0
    at_wall: bool = False

    def command(self, velocity: Velocity, now: int) -> Turtle:
        """The turtle under another command."""
        return replace(self, velocity=velocity, commanded_at=now)

    def step(self, now: int, dt: float) -> Turtle:
        """The turtle ``dt`` [s] later, at ``now`` [ns]: it turns, then moves along its new heading, as ROS's does."""
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
        """The turtle at another place, where it goes on under its command."""
        return replace(self, x=x, y=y, theta=wrap(theta)).held_on_plane()

    def displaced(self, linear: float, angular: float) -> Turtle:
        """The turtle turned by ``angular`` [rad] and then moved ahead by ``linear`` [m]."""
        theta = self.theta + angular
        return self.placed(self.x + math.cos(theta) * linear, self.y + math.sin(theta) * linear, theta)

    def held_on_plane(self) -> Turtle:
        """The turtle at the nearest point of the plane, if it is beyond a wall."""
        x, y = min(max(self.x, 0.0), PLANE_M), min(max(self.y, 0.0), PLANE_M)
        return replace(self, x=x, y=y, at_wall=(x, y) != (self.x, self.y))

    def remaining_turn(self, theta: float) -> float:
        """The angle to a heading, in [-pi, pi]."""
        return wrap(theta - self.theta)

    def pose(self) -> Pose:
        """The message, with the precision of ROS's ``float32``."""
        v = self.velocity
        speed = math.copysign(math.hypot(v.ahead, v.left), v.ahead) if v.left else v.ahead
        x, y, theta, linear, angular = array("f", (self.x, self.y, self.theta, speed, v.turn))
        return Pose(x=x, y=y, theta=theta, linear_velocity=linear, angular_velocity=angular)
