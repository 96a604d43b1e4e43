"""Converts messages to markers: how the viewer and the panel display paths, poses, maps and scans."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from messages.base import Message
from messages.geometry import Point, PointStamped, Pose, PoseArray, PoseStamped, Vector3
from messages.nav import OccupancyGrid, Path
from messages.sensor import LaserScan
from messages.std import ColorRGBA, Header
from messages.visualization import Marker, MarkerArray
from models.floor_plan import rectangles

ARROW_LENGTH_M, ARROW_WIDTH_M = 0.4, 0.05
LINE_WIDTH_M = 0.03
POINT_SIZE_M, ECHO_SIZE_M = 0.15, 0.04
MAP_RISE_M = -0.02
"""Height of a map [m], below everything displayed on it."""
OCCUPIED, FREE = 65, 25
"""Occupancies [%] from which on a cell is occupied, and up to which it is free, as in trinary maps."""
UNSET = 1e-9
"""Norm of a quaternion below which it is unset."""
MAX_ELEMENTS = 20_000
"""Maximum number of poses or points displayed per message."""

GREEN = ColorRGBA(r=0.1, g=0.75, b=0.2, a=1.0)
RED = ColorRGBA(r=0.9, g=0.2, b=0.15, a=1.0)
PURPLE = ColorRGBA(r=0.75, g=0.3, b=0.9, a=1.0)
ORANGE = ColorRGBA(r=1.0, g=0.55, b=0.1, a=1.0)
WALL = ColorRGBA(r=0.12, g=0.12, b=0.14, a=1.0)
FLOOR = ColorRGBA(r=0.78, g=0.78, b=0.76, a=1.0)


def _path(message: Path) -> list[Marker]:
    points = tuple(each.pose.position for each in message.poses[:MAX_ELEMENTS])
    return [_marker(message.header, Marker.LINE_STRIP, GREEN, Vector3(x=LINE_WIDTH_M), points=points)]


def _pose(message: PoseStamped) -> list[Marker]:
    return [_arrow(message.header, message.pose, 0, RED)]


def _poses(message: PoseArray) -> list[Marker]:
    arrows = [_arrow(message.header, pose, number, RED) for number, pose in enumerate(message.poses[:MAX_ELEMENTS])]
    return [Marker(header=message.header, action=Marker.DELETEALL), *arrows]


def _point(message: PointStamped) -> list[Marker]:
    size = Vector3(x=POINT_SIZE_M, y=POINT_SIZE_M, z=POINT_SIZE_M)
    return [_marker(message.header, Marker.SPHERE, PURPLE, size, pose=Pose(position=message.point))]


def _scan(message: LaserScan) -> list[Marker]:
    points = scan_points(message)
    size = Vector3(x=ECHO_SIZE_M, y=ECHO_SIZE_M)
    return [_marker(message.header, Marker.POINTS, ORANGE, size, points=_points(points[:MAX_ELEMENTS]))]


def _map(message: OccupancyGrid) -> list[Marker]:
    """Return walls and floor as triangles; nothing for a map with a wrong number of cells."""
    info = message.info
    if not info.width or info.width * info.height != len(message.data):
        return []
    cells = np.array(message.data, np.int8).reshape(info.height, info.width)
    pose = Pose(
        position=Point(x=info.origin.position.x, y=info.origin.position.y, z=info.origin.position.z + MAP_RISE_M),
        orientation=info.origin.orientation,
    )
    found = []
    for number, (filled, colour) in enumerate((((cells >= 0) & (cells <= FREE), FLOOR), (cells >= OCCUPIED, WALL))):
        corners = _triangles(filled, info.resolution)
        if len(corners):
            one = Vector3(x=1.0, y=1.0, z=1.0)
            shape = _marker(message.header, Marker.TRIANGLE_LIST, colour, one, number, pose, _points(corners))
            found.append(shape)
    return [Marker(header=message.header, action=Marker.DELETEALL), *found]


def _triangles(filled: NDArray[np.bool_], edge: float) -> NDArray[np.float64]:
    """Cover cells of edge length ``edge`` [m] with rectangles, each as two triangles; shape (6 n, 3)."""
    parts = [
        ((left, top), (right, top), (right, bottom), (left, top), (right, bottom), (left, bottom))
        for top, left, bottom, right in rectangles(filled)
    ]
    flat = np.array(parts, np.float64).reshape(-1, 2) * edge
    return np.column_stack((flat, np.zeros(len(flat))))


def _arrow(header: Header, pose: Pose, number: int, colour: ColorRGBA) -> Marker:
    size = Vector3(x=ARROW_LENGTH_M, y=ARROW_WIDTH_M, z=ARROW_WIDTH_M)
    return _marker(header, Marker.ARROW, colour, size, number, pose)


def _marker(
    header: Header,
    kind: int,
    colour: ColorRGBA,
    scale: Vector3,
    number: int = 0,
    pose: Pose | None = None,
    points: tuple[Point, ...] = (),
) -> Marker:
    return Marker(header=header, id=number, type=kind, pose=pose or Pose(), scale=scale, color=colour, points=points)


def _points(rows: NDArray[np.float64]) -> tuple[Point, ...]:
    return tuple(Point(x=x, y=y, z=z) for x, y, z in rows.tolist())


_DISPLAYS: dict[str, Callable[[Any], list[Marker]]] = {
    Marker.ROS_TYPE: lambda message: [message],
    MarkerArray.ROS_TYPE: lambda message: list(message.markers),
    Path.ROS_TYPE: _path,
    PoseStamped.ROS_TYPE: _pose,
    PoseArray.ROS_TYPE: _poses,
    PointStamped.ROS_TYPE: _point,
    LaserScan.ROS_TYPE: _scan,
    OccupancyGrid.ROS_TYPE: _map,
}

DISPLAYED = tuple(_DISPLAYS)
"""The message types that can be converted to markers."""


def markers_of(message: Message) -> list[Marker]:
    """Convert a message of one of the types DISPLAYED to markers.

    An unset orientation, the default in ROS 1 messages, counts as the identity, as in RViz. Raises BadInput for a map
    whose cells form too many rectangles.
    """
    return [_oriented(each) for each in _DISPLAYS[message.ROS_TYPE](message)]


def _oriented(marker: Marker) -> Marker:
    q = marker.pose.orientation
    if math.hypot(q.x, q.y, q.z, q.w) > UNSET:
        return marker
    return replace(marker, pose=Pose(position=marker.pose.position))


def scan_points(scan: LaserScan) -> NDArray[np.float64]:
    """Return the echoes of a scan, (n, 3) [m] in the laser's frame; rays without an echo are left out."""
    ranges = scan.ranges.numpy().astype(np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    seen = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    near, turn = ranges[seen], angles[seen]
    return np.column_stack((near * np.cos(turn), near * np.sin(turn), np.zeros(len(near))))


class MarkerSet:
    """The current markers of one topic, by namespace and ID, each with the version at which it was added."""

    def __init__(self) -> None:
        self.shown: dict[tuple[str, int], tuple[int, Marker]] = {}
        self.gone: dict[tuple[str, int], int] = {}
        """Removed markers, with the version at which they were removed."""
        self._ends: dict[tuple[str, int], int] = {}
        """Simulation time [ns] at which markers with a lifetime expire."""

    def add(self, markers: Iterable[Marker], version: int, now: int) -> None:
        """Process markers received at ``now`` [ns]: added, deleted, or all deleted."""
        for each in markers:
            place = each.ns, each.id
            self._ends.pop(place, None)
            if each.action == Marker.DELETEALL:
                self.gone.update(dict.fromkeys(self.shown, version))
                self.shown, self._ends = {}, {}
            elif each.action == Marker.DELETE:
                if self.shown.pop(place, None) is not None:
                    self.gone[place] = version
            else:
                self.shown.pop(place, None)
                self.shown[place] = version, each
                self.gone.pop(place, None)
                if each.lifetime.ns > 0:
                    self._ends[place] = now + each.lifetime.ns

    def expire(self, now: int) -> dict[tuple[str, int], int]:
        """Remove the markers whose lifetime has expired at ``now`` [ns]; return them with their expiry times [ns]."""
        over = {place: end for place, end in self._ends.items() if end <= now}
        for place in over:
            del self._ends[place]
        return {place: end for place, end in over.items() if self.shown.pop(place, None) is not None}

    def restart(self) -> None:
        """Restart lifetimes from 0 after a reset of time."""
        self._ends = {place: self.shown[place][1].lifetime.ns for place in self._ends if place in self.shown}
