"""The plane and the turtles' trails as markers: all of them for a new viewer, then changes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal

from messages.geometry import Point, Pose, Quaternion, Vector3
from messages.std import ColorRGBA, Header, Time
from messages.turtlesim import Color
from messages.visualization import Marker, MarkerArray
from services.turtlesim.drawing import Line
from services.turtlesim.plane import Plane
from services.turtlesim.turtle import PIXELS_PER_METRE, PLANE_M

FRAME = "world"
BACKGROUND, TRAIL = "background", "trail"
"""Namespaces of the markers; a trail's is ``trail/turtle1``."""
DELETEALL: Literal[3] = 3
"""``Marker.DELETEALL``."""
THICKNESS_M = 0.02
RISE_M = 1e-5
"""Height [m] of each line above the previous one, so that viewers draw it on top."""
MAX_POINTS = 2000
"""Maximum number of points in one message, about 80 kB."""


class PlaneMarkers:
    """The markers of a plane, and which of them viewers have received."""

    def __init__(self, plane: Plane) -> None:
        self._plane = plane
        self._sent = 0

    def messages(self, now: int, everything: bool = False) -> Iterator[MarkerArray]:
        """Yield the markers that viewers have not received yet, or ``everything``; ``now`` in ns."""
        plane, header = self._plane, Header(stamp=Time.of(now), frame_id=FRAME)
        wiped = self._sent != plane.generation
        part: list[Marker] = []
        if wiped or everything:
            self._sent = plane.generation
            part = [Marker(header=header, action=DELETEALL), _background(header, plane.background)]
        yield from _split(part, (line for line in plane.trails.lines.values() if line.changed or part), header)


def _split(first: list[Marker], lines: Iterable[Line], header: Header) -> Iterator[MarkerArray]:
    part, points = first, 0
    for line in list(lines):
        line.changed = False
        part.append(_line(line, header))
        points += len(line.points)
        if points > MAX_POINTS:
            yield MarkerArray(markers=tuple(part))
            part, points = [], 0
    if part:
        yield MarkerArray(markers=tuple(part))


def _background(header: Header, colour: Color) -> Marker:
    return Marker(
        header=header,
        ns=BACKGROUND,
        type=Marker.CUBE,
        pose=Pose(position=Point(x=PLANE_M / 2, y=PLANE_M / 2, z=-THICKNESS_M / 2), orientation=Quaternion()),
        scale=Vector3(x=PLANE_M, y=PLANE_M, z=THICKNESS_M),
        color=_rgba(colour),
    )


def _line(line: Line, header: Header) -> Marker:
    return Marker(
        header=header,
        ns=f"{TRAIL}/{line.turtle}",
        id=line.number,
        type=Marker.LINE_STRIP,
        scale=Vector3(x=line.width / PIXELS_PER_METRE),
        color=_rgba(line.colour),
        points=tuple(Point(x=x, y=y, z=line.number * RISE_M) for x, y in line.points),
    )


def _rgba(colour: Color) -> ColorRGBA:
    return ColorRGBA(r=colour.r / 255, g=colour.g / 255, b=colour.b / 255, a=1.0)
