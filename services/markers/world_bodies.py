"""The bodies of the world from ``/world/markers``, and their footprints on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from messages.errors import BadInput
from messages.se3 import Pose3
from messages.visualization import Marker, MarkerArray
from models.mesh import Mesh, hull_points, read_mesh
from services.markers.footprint import (
    Footprint,
    box_footprint,
    cylinder_footprint,
    points_footprint,
    sphere_footprint,
    triangle_footprints,
)

GROUND = "ground"
"""Namespace of markers of surfaces that robots drive on, e.g. ramps; also the name of the ground plane's marker."""
FIXED = "fixed"
"""Namespace of fixed bodies."""

MAX_TRIANGLES = 20_000
"""Maximum number of triangles of a fixed body that are used singly; a larger one is replaced by its convex hull."""

SPHERE_RINGS, SPHERE_MERIDIANS = 24, 48
"""Number of rings and meridians of the points that approximate an ellipsoid."""

Floats = NDArray[np.float64]
Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class WorldBody:
    """A body of the world: its name, its kind (``fixed``, ``movable``, ``moving`` or ``ground``) and its markers.

    A movable or moving body has a single marker.
    """

    name: str
    kind: str
    markers: tuple[Marker, ...]

    @property
    def colour(self) -> Colour:
        """Red, green, blue and opacity, 0 to 1."""
        c = self.markers[0].color
        return c.r, c.g, c.b, c.a

    @property
    def pose(self) -> Pose3:
        """Pose of the body at the start."""
        return Pose3.from_msg(self.markers[0].pose)

    def footprints(self, pose: Pose3 | None = None) -> list[Footprint]:
        """Return the footprints at ``pose``, by default at the start.

        A fixed mesh or triangle list has one per triangle, up to MAX_TRIANGLES, any other one that of its convex hull,
        which is how they collide.

        Raises:
            BadInput: It has no triangles, its mesh cannot be read, or its type is not supported.
        """
        return [each for marker in self.markers for each in self._marker(marker, pose or Pose3.from_msg(marker.pose))]

    def _marker(self, m: Marker, pose: Pose3) -> list[Footprint]:
        size = m.scale.x, m.scale.y, m.scale.z
        match m.type:
            case Marker.CUBE:
                return [box_footprint(pose, size)]
            case Marker.SPHERE if size[0] == size[1] == size[2]:
                return [sphere_footprint(pose, size[0])]
            case Marker.CYLINDER if size[0] == size[1]:
                return [cylinder_footprint(pose, size[0], size[2])]
            case Marker.SPHERE:
                return [points_footprint(pose, _unit_ball() * size)]
            case Marker.CYLINDER:
                return [points_footprint(pose, _unit_cylinder() * size)]
        if self.kind == FIXED and len(triangles := marker_triangles(m)) <= MAX_TRIANGLES:
            return triangle_footprints(pose, triangles)
        return [points_footprint(pose, self._hulls[m.id])]

    @cached_property
    def _hulls(self) -> dict[int, Floats]:
        """Points that span the convex hull of each marker with triangles, by its ID, shape (n, 3) [m] in its frame."""
        found = {}
        for marker in self.markers:
            if marker.type not in (Marker.CUBE, Marker.SPHERE, Marker.CYLINDER):
                corners = marker_triangles(marker).reshape(-1, 3)
                found[marker.id] = hull_points(Mesh(corners, np.empty((0, 3), np.int32)))
        return found


def marker_triangles(marker: Marker) -> Floats:
    """Return the triangles of a TRIANGLE_LIST or of the file of a MESH_RESOURCE, shape (n, 3, 3) [m] in the marker's
    frame.

    Raises:
        BadInput: It has none, its file cannot be read, or its type is not supported.
    """
    name = marker.text or f"{marker.ns}_{marker.id}"
    if marker.type == Marker.MESH_RESOURCE:
        mesh = read_mesh(_mesh_path(marker.mesh_resource))
        triangles = mesh.vertices[mesh.triangles]
    elif marker.type != Marker.TRIANGLE_LIST:
        raise BadInput(f"the marker {name!r} has type {marker.type}, which is not supported here")
    elif not marker.points or len(marker.points) % 3:
        raise BadInput(f"the marker {name!r} has {len(marker.points)} points, not three for each triangle")
    else:
        triangles = np.array([(each.x, each.y, each.z) for each in marker.points]).reshape(-1, 3, 3)
    scaled: Floats = triangles * (marker.scale.x, marker.scale.y, marker.scale.z)
    return scaled


def _mesh_path(resource: str) -> Path:
    """Return the file of a marker's mesh; raises BadInput unless it is a file on this machine."""
    url = urlsplit(resource)
    if url.scheme not in ("", "file") or url.netloc not in ("", "localhost"):
        raise BadInput(f"the mesh {resource[:200]!r} is not a file of this machine")
    return Path(unquote(url.path))


World = Sequence[tuple[WorldBody, list[Footprint]]]
"""Bodies, each with its footprints at the start."""


def world_bodies(array: MarkerArray) -> tuple[WorldBody, ...]:
    """Return the bodies of the markers, in their order; deletions, labels and the ground plane are left out."""
    found: dict[tuple[str, str], list[Marker]] = {}
    for each in array.markers:
        name = each.text or f"{each.ns}_{each.id}"
        if each.action == Marker.ADD and each.type != Marker.TEXT_VIEW_FACING and (each.ns, name) != (GROUND, GROUND):
            found.setdefault((name, each.ns), []).append(each)
    return tuple(WorldBody(name, kind, tuple(markers)) for (name, kind), markers in found.items())


def _unit_ball() -> Floats:
    height, turn = np.meshgrid(
        np.linspace(-np.pi / 2, np.pi / 2, SPHERE_RINGS), np.linspace(0, 2 * np.pi, SPHERE_MERIDIANS, endpoint=False)
    )
    ball = np.stack((np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height)), axis=-1)
    halved: Floats = ball.reshape(-1, 3) / 2
    return halved


def _unit_cylinder() -> Floats:
    turn = np.linspace(0, 2 * np.pi, SPHERE_MERIDIANS, endpoint=False)
    rim = np.column_stack((np.cos(turn), np.sin(turn), np.ones(len(turn)))) / 2
    both: Floats = np.concatenate((rim, rim * (1, 1, -1)))
    return both
