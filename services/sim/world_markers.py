"""A world as markers: one for its ground, and those of its bodies."""

from __future__ import annotations

import msgspec
import numpy as np

from messages.geometry import Point, Pose, Vector3
from messages.se3 import IDENTITY, Pose3
from messages.std import ColorRGBA, Header
from messages.visualization import Marker, MarkerArray
from models.bodies import GROUND_NAME, BodyPart, BoxShape, CylinderShape, HeightMapShape, MeshShape, SphereShape
from models.mesh import Mesh
from models.shape_mesh import joined, placed, shape_mesh
from models.world import WorldBody, WorldDescription

GROUND_MARGIN = 1.0
"""m; margin of the drawn ground around the outermost bodies."""
MIN_GROUND = 20.0
"""m; minimum side of the drawn ground, around the origin or the bodies."""
MAP_ROWS = 50
"""Rows and columns that a height map is drawn with."""
MAX_TRIANGLES = 5000
"""Per marker; a larger mesh is drawn from its file, or as its bounding box."""
MAX_POINTS = 150_000
"""For all markers together: further bodies are drawn as boxes, to keep the message below the topic's maximum size."""

_GROUND_THICKNESS = 0.01
_GROUND_COLOUR = ColorRGBA(r=0.85, g=0.85, b=0.85, a=1.0)
_HEADER = Header(frame_id="world")
_UNIT = Vector3(x=1.0, y=1.0, z=1.0)


def world_markers(world: WorldDescription) -> MarkerArray:
    """Return the ground, in the namespace ``ground``, as a flat cube whose top is z = 0; then the bodies, in order.

    A body's namespace is its kind (``fixed``, ``movable`` or ``moving``), or ``ground`` for a fixed part that robots
    drive on, such as a ramp; its ``text`` is its name, ``id`` counts the markers. A fixed body has a marker for each
    part; one that moves has a single marker with the body's pose, so that it can be redrawn at the pose from
    ``/world/states``.
    """
    markers: list[Marker] = []
    points = 0
    for body in world.all_bodies:
        for marker in _body_markers(body, points < MAX_POINTS):
            points += len(marker.points)
            number = len(markers) + 1
            markers.append(_with_id(marker, number))
    return MarkerArray(markers=(_ground(world), *markers))


def _with_id(marker: Marker, number: int) -> Marker:
    return msgspec.structs.replace(marker, id=number)


def _body_markers(body: WorldBody, triangles: bool) -> list[Marker]:
    parts = [part for part in body.parts if part.visible]
    if body.kind == "fixed":
        markers = [_part_marker(body, part, body.pose @ part.pose, triangles) for part in parts]
        kinds = [GROUND_NAME if part.ground else "fixed" for part in parts]
        return [msgspec.structs.replace(marker, ns=kind) for marker, kind in zip(markers, kinds, strict=True)]
    if len(parts) == 1 and parts[0].pose == IDENTITY:
        return [_part_marker(body, parts[0], body.pose, triangles)]
    return [_compound_marker(body, parts, triangles)] if parts else []


def _part_marker(body: WorldBody, part: BodyPart, pose: Pose3, triangles: bool) -> Marker:
    colour = _colour(part)
    match part.shape:
        case BoxShape((x, y, z)):
            return _marker(body, Marker.CUBE, pose, Vector3(x=x, y=y, z=z), colour)
        case CylinderShape(radius, length):
            return _marker(body, Marker.CYLINDER, pose, Vector3(x=2 * radius, y=2 * radius, z=length), colour)
        case SphereShape(radius):
            return _marker(body, Marker.SPHERE, pose, Vector3(x=2 * radius, y=2 * radius, z=2 * radius), colour)
        case MeshShape(mesh, file, (x, y, z)) if file is not None and len(mesh.triangles) > MAX_TRIANGLES // 10:
            return _marker(
                body, Marker.MESH_RESOURCE, pose, Vector3(x=x, y=y, z=z), colour, mesh_resource=file.resolve().as_uri()
            )
        case shape:
            rows = MAP_ROWS if isinstance(shape, HeightMapShape) else 0
            return _triangles(body, pose, _small(shape_mesh(shape, rows), triangles), colour)


def _compound_marker(body: WorldBody, parts: list[BodyPart], triangles: bool) -> Marker:
    meshes = [placed(_small(shape_mesh(part.shape, MAP_ROWS), triangles), part.pose) for part in parts]
    marker = _triangles(body, body.pose, joined(meshes), _colour(parts[0]))
    if len({part.colour for part in parts}) == 1:
        return marker
    colours = [_colour(part) for part, mesh in zip(parts, meshes, strict=True) for _ in range(3 * len(mesh.triangles))]
    return msgspec.structs.replace(marker, colors=tuple(colours))


def _small(mesh: Mesh, triangles: bool) -> Mesh:
    """Return the mesh, or its bounding box if it has too many triangles."""
    if triangles and len(mesh.triangles) <= MAX_TRIANGLES:
        return mesh
    low, high = mesh.bounds
    box = shape_mesh(BoxShape(tuple((high - low).tolist())))
    return Mesh(box.vertices + (low + high) / 2, box.triangles)


def _triangles(body: WorldBody, pose: Pose3, mesh: Mesh, colour: ColorRGBA) -> Marker:
    corners = mesh.vertices[mesh.triangles].reshape(-1, 3).tolist()
    points = tuple(Point(x=x, y=y, z=z) for x, y, z in corners)
    return _marker(body, Marker.TRIANGLE_LIST, pose, _UNIT, colour, points)


def _marker(
    body: WorldBody,
    kind: int,
    pose: Pose3,
    scale: Vector3,
    colour: ColorRGBA,
    points: tuple[Point, ...] = (),
    mesh_resource: str = "",
) -> Marker:
    return Marker(
        header=_HEADER,
        ns=body.kind,
        type=kind,
        pose=pose.to_msg(),
        scale=scale,
        color=colour,
        points=points,
        text=body.name,
        mesh_resource=mesh_resource,
    )


def _colour(part: BodyPart) -> ColorRGBA:
    r, g, b, a = part.colour
    return ColorRGBA(r=r, g=g, b=b, a=a)


def _ground(world: WorldDescription) -> Marker:
    """Return the rectangle that contains all bodies at their start, with a margin, and all paths."""
    reaches = []
    for body in world.all_bodies:
        for part in body.parts:
            low, high = shape_mesh(part.shape, 2).bounds
            reach = float(np.linalg.norm(np.maximum(abs(low), abs(high)))) + GROUND_MARGIN
            x, y, _ = (body.pose @ part.pose).position
            reaches.append((x, y, reach))
        if body.path is not None:
            reaches += [(x, y, GROUND_MARGIN) for x, y, _ in body.path.points]
    low_x, high_x = _extent([(x - reach, x + reach) for x, _, reach in reaches])
    low_y, high_y = _extent([(y - reach, y + reach) for _, y, reach in reaches])
    return Marker(
        header=_HEADER,
        ns=GROUND_NAME,
        type=Marker.CUBE,
        pose=Pose(position=Point(x=(low_x + high_x) / 2, y=(low_y + high_y) / 2, z=-_GROUND_THICKNESS / 2)),
        scale=Vector3(x=high_x - low_x, y=high_y - low_y, z=_GROUND_THICKNESS),
        color=_GROUND_COLOUR,
        text=GROUND_NAME,
    )


def _extent(intervals: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the interval [m] that contains all, at least MIN_GROUND long."""
    low, high = min((each[0] for each in intervals), default=0.0), max((each[1] for each in intervals), default=0.0)
    missing = max(0.0, MIN_GROUND - (high - low)) / 2
    return low - missing, high + missing
