"""From wheel angles, or from commands, back to where a base is."""

from __future__ import annotations

import math
from typing import NamedTuple

from services.sim.diffdrive.geometry import Geometry

SHORTEST_S = 1e-4
"""An interval below this tells a way but no speed."""

Motion = tuple[float, float]
"""Speed [m/s] and turn rate [rad/s]."""


class Pose2(NamedTuple):
    """A pose on the ground: m, m, rad; the heading is not wrapped."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def then(self, other: Pose2) -> Pose2:
        """The pose ``other`` of this pose's own frame."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Pose2(
            self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, self.heading + other.heading
        )

    def inverse(self) -> Pose2:
        """The pose of the origin, seen from this one."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.heading)


class Track(NamedTuple):
    """A pose found by counting: x, y [m], heading [rad] without bounds; the speeds v [m/s] and w [rad/s], the mean over
    ``recent``; and the wheel angles [rad] where the last interval ended."""

    x: float
    y: float
    heading: float
    v: float
    w: float
    left: float
    right: float
    recent: tuple[Motion, ...] = ()

    @property
    def pose(self) -> Pose2:
        """Where it is."""
        return Pose2(self.x, self.y, self.heading)


def start(left: float, right: float, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Track:
    """A track that begins at rest at the given pose, with the wheels at the angles ``left`` and ``right`` [rad]."""
    return Track(x, y, heading, 0.0, 0.0, left, right)


def roll(track: Track, left: float, right: float, dt: float, geometry: Geometry, window: int = 1) -> Track:
    """The track after the wheels turned on to the angles ``left`` and ``right`` [rad] in ``dt`` > 0 [s].

    Its speeds are the mean over the last ``window`` intervals. Angles that are not finite change nothing.
    """
    if not (math.isfinite(left) and math.isfinite(right)):
        return track
    went_left, went_right = (left - track.left) * geometry.left_radius, (right - track.right) * geometry.right_radius
    length, turn = (went_left + went_right) / 2, (went_right - went_left) / geometry.separation
    x, y, heading = arc(track.x, track.y, track.heading, length, turn)
    if dt < SHORTEST_S:
        return Track(x, y, heading, track.v, track.w, left, right, track.recent)
    recent = (*track.recent[max(0, len(track.recent) + 1 - window) :], (length / dt, turn / dt))
    count = len(recent)
    v, w = sum(each[0] for each in recent) / count, sum(each[1] for each in recent) / count
    return Track(x, y, heading, v, w, left, right, recent)


def coast(track: Track, v: float, w: float, dt: float) -> Track:
    """The track after the limited command ``v`` [m/s], ``w`` [rad/s] was carried out for ``dt`` [s]: open loop."""
    x, y, heading = arc(track.x, track.y, track.heading, v * dt, w * dt)
    return track._replace(x=x, y=y, heading=heading, v=v, w=w)


def arc(x: float, y: float, heading: float, length: float, turn: float) -> Pose2:
    """The pose after an arc of ``length`` [m] that turns by ``turn`` [rad]; exact for constant speeds.

    Its chord is length sin(turn/2) / (turn/2) long and points along heading + turn/2. ROS integrates the same arc, but
    takes a mid-heading step below 1e-6 rad; the chord needs no such case.
    """
    half = turn / 2
    chord = length * math.sin(half) / half if half else length
    course = heading + half
    return Pose2(x + chord * math.cos(course), y + chord * math.sin(course), heading + turn)
