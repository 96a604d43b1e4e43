"""Markers as bodies: the footprint of each type, and rejected ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from messages.errors import BadInput
from messages.geometry import Point, Pose, Vector3
from messages.se3 import Pose3
from messages.visualization import Marker, MarkerArray
from models.mesh import Mesh, write_stl
from services.markers.footprint import NearestBody
from services.markers.world_bodies import WorldBody, world_bodies

SQUARE = ((0, 1, 2), (0, 2, 3))


def slab(x: float, y: float, length: float, width: float) -> np.ndarray:
    """Return the two triangles of a rectangle 0.1 m above the ground, shape (2, 3, 3) [m]."""
    corners = np.array([(x, y, 0.1), (x + length, y, 0.1), (x + length, y + width, 0.1), (x, y + width, 0.1)])
    return corners[np.array(SQUARE)]


U_SHAPE = np.concatenate((slab(0, 0, 1, 4), slab(1, 0, 2, 1), slab(3, 0, 1, 4)))


def body(kind: str, resource: str = "") -> WorldBody:
    points = () if resource else tuple(Point(x=x, y=y, z=z) for x, y, z in U_SHAPE.reshape(-1, 3).tolist())
    (found,) = world_bodies(
        MarkerArray(
            markers=(
                Marker(
                    ns=kind,
                    text="u",
                    type=Marker.MESH_RESOURCE if resource else Marker.TRIANGLE_LIST,
                    scale=Vector3(x=1.0, y=1.0, z=1.0),
                    points=points,
                    mesh_resource=resource,
                ),
            )
        )
    )
    return found


def distance(body: WorldBody, pose: Pose3 | None = None) -> float:
    """Return the distance [m] from the middle between the arms of the U."""
    found, _ = NearestBody([body.footprints(pose)]).find(np.array([(2.0, 3.0)]), np.zeros(1), np.ones(1))
    return float(found[0])


def test_a_fixed_mesh_covers_what_its_triangles_do_and_a_moving_one_its_hull(tmp_path: Path) -> None:
    file = tmp_path / "a u.stl"
    write_stl(file, Mesh(U_SHAPE.reshape(-1, 3), np.arange(18, dtype=np.int32).reshape(-1, 3)))
    for resource in ("", file.as_uri()):
        assert distance(body("fixed", resource)) == pytest.approx(1.0)
        assert distance(body("movable", resource)) == pytest.approx(-1.0), "within the hull"
        assert distance(body("moving", resource), Pose3((5.0, 0.0, 0.0))) == pytest.approx(3.0)
        assert distance(body("fixed", resource), Pose3((0.0, 0.0, 0.95))) == math.inf, "above"


def test_parts_of_one_name_are_one_body_and_ground_labels_and_what_is_deleted_are_none() -> None:
    legs = [Marker(ns="fixed", text="table", id=n, type=Marker.CUBE, pose=Pose.planar(n, 0)) for n in range(4)]
    others = (
        Marker(ns="ground", text="ground", type=Marker.CUBE),
        Marker(ns="ground", text="ramp", type=Marker.CUBE),
        Marker(ns="fixed", text="label", type=Marker.TEXT_VIEW_FACING),
        Marker(ns="fixed", text="gone", action=Marker.DELETE),
        Marker(ns="movable", id=7, type=Marker.SPHERE),
    )
    found = world_bodies(MarkerArray(markers=(*legs, *others)))
    assert [(each.name, each.kind, len(each.markers)) for each in found] == [
        ("table", "fixed", 4),
        ("ramp", "ground", 1),
        ("movable_7", "movable", 1),
    ]
    assert len(found[0].footprints()) == 4


def test_what_cannot_be_drawn_says_why(tmp_path: Path) -> None:
    for marker, why in (
        (Marker(ns="fixed", text="lines", type=5), "'lines' has type 5"),
        (Marker(ns="movable", text="strip", type=4), "'strip' has type 4"),
        (Marker(id=7, type=0), "'_7' has type 0"),
        (Marker(ns="fixed", text="few", type=Marker.TRIANGLE_LIST, points=(Point(),) * 4), "4 points"),
        (
            Marker(ns="fixed", text="web", type=Marker.MESH_RESOURCE, mesh_resource="https://a.b/c.stl"),
            "not a file of this",
        ),
        (Marker(ns="fixed", text="none", type=Marker.MESH_RESOURCE, mesh_resource=f"file://{tmp_path}/x.stl"), "x.stl"),
    ):
        (found,) = world_bodies(MarkerArray(markers=(marker,)))
        with pytest.raises(BadInput, match=why):
            found.footprints()
