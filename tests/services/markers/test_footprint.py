"""Footprints of bodies on the ground, and distances of points to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from messages.se3 import Pose3, quaternion_from_rpy, rotated_axes
from services.markers.footprint import (
    Footprint,
    NearestBody,
    box_footprint,
    convex_hull,
    cylinder_footprint,
    points_footprint,
    sphere_footprint,
    triangle_footprints,
)

pytestmark = pytest.mark.slow

TILTED = quaternion_from_rpy(0.3, -0.7, 1.1)


def area(footprint: Footprint) -> float:
    x, y = footprint.polygon().T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def test_a_box_covers_its_rectangle_and_when_it_is_tilted_its_hull() -> None:
    flat = box_footprint(Pose3((1.0, 2.0, 0.2), quaternion_from_rpy(0, 0, 0.5)), (0.4, 0.2, 0.4))
    assert len(flat.corners) == 4
    assert math.isclose(area(flat), 0.08)
    assert np.allclose(flat.corners.mean(axis=0), (1, 2))
    assert (flat.bottom, flat.top) == (0.0, 0.4)
    on_edge = box_footprint(Pose3((0, 0, 1), quaternion_from_rpy(math.pi / 4, 0, 0)), (1.0, 1.0, 1.0))
    assert math.isclose(area(on_edge), math.sqrt(2))
    assert math.isclose(on_edge.top, 1 + math.sqrt(0.5))
    tilted = box_footprint(Pose3((0, 0, 0), TILTED), (1.0, 2.0, 3.0))
    assert len(tilted.corners) == 6
    # A box's projection along z has the sum of its visible faces' areas times the cosines of their normals (Cauchy).
    assert math.isclose(area(tilted), np.dot((6, 3, 2), np.abs(_axes(TILTED)[2])))


def test_round_bodies_cover_circles_and_tilted_cylinders_an_oblong() -> None:
    ball = sphere_footprint(Pose3((1, 1, 0.5), TILTED), 1.0)
    post = cylinder_footprint(Pose3((1, 1, 0.5), quaternion_from_rpy(0, math.pi, 2)), 1.0, 1.0)
    for each in (ball, post):
        assert (each.radius, each.bottom, each.top) == (0.5, 0.0, 1.0)
        assert math.isclose(area(each), math.pi / 4, rel_tol=3e-3)
    lying = cylinder_footprint(Pose3((0, 0, 0.1), quaternion_from_rpy(0, math.pi / 2, 0)), 0.2, 1.0)
    assert math.isclose(area(lying), 0.2)
    assert np.allclose(np.ptp(lying.corners, axis=0), (1.0, 0.2))


def test_the_hull_of_many_points_is_that_of_their_extremes() -> None:
    random = np.random.default_rng(5)
    inner = random.uniform(-0.99, 0.99, (20_000, 2))
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1.0)])
    assert np.array_equal(convex_hull(np.concatenate((inner, corners))), corners)
    assert len(convex_hull(np.ones((500, 2)))) == 1
    line = convex_hull(np.column_stack((np.linspace(0, 1, 999), np.linspace(0, 1, 999))))
    assert np.allclose(line, [(0, 0), (1, 1)])


def distances_to(footprints: list[Footprint], points: np.ndarray) -> np.ndarray:
    """Return the distances to bodies of one footprint each, at all heights, shape (points, bodies)."""
    low, high = np.full(len(points), -math.inf), np.full(len(points), math.inf)
    return np.column_stack([NearestBody([[each]]).find(points, low, high)[0] for each in footprints])


def test_distances_are_exact_beside_at_corners_and_inside() -> None:
    box = box_footprint(Pose3((2, 0, 0.5), quaternion_from_rpy(0, 0, math.pi / 2)), (1.0, 2.0, 1.0))
    ball = sphere_footprint(Pose3((0, 3, 0), TILTED), 2.0)
    corners = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, -1.0, 1.0)])
    plate = points_footprint(Pose3(), corners)
    (upright,) = triangle_footprints(Pose3(), corners[None])
    points = np.array([(0.0, 0.0), (4.0, 1.5), (1.2, 0.1), (0.0, 2.75), (0.0, -1.0)])
    expected = [
        (1, 2, 1, 1),
        (math.sqrt(2), math.hypot(4, 1.5) - 1, math.hypot(3, 2.5), math.hypot(3, 2.5)),
        (-0.2, math.hypot(1.2, 2.9) - 1, math.hypot(0.2, 1.1), math.hypot(0.2, 1.1)),
        (math.hypot(1, 2.25), -0.75, 3.75, 3.75),
        (math.hypot(1, 0.5), 3, 0, 0),
    ]
    assert np.allclose(distances_to([box, ball, plate, upright], points), expected)
    low, high = np.zeros(5), np.ones(5)
    nearest, which = NearestBody([[box], [ball, plate]]).find(points, low, high)
    assert np.allclose(nearest, np.min(expected, axis=1))
    assert which.tolist() == [0, 0, 0, 1, 1]


def test_bodies_above_and_below_and_those_too_far_are_left_out() -> None:
    shelf = box_footprint(Pose3((0, 0, 1.0)), (1.0, 1.0, 0.1))
    mat = box_footprint(Pose3((2, 0, 0.005)), (1.0, 1.0, 0.01))
    search = NearestBody([[shelf], [mat]])
    points, low = np.array([(1.0, 0.0)] * 4), np.full(4, 0.02)
    distances, which = search.find(points, low - (0, 0, 1, 0), np.array([0.5, 2.0, 0.5, 2.0]), np.array([9, 9, 9, 0.4]))
    assert distances.tolist() == [math.inf, 0.5, 0.5, math.inf]
    assert which.tolist()[1:3] == [0, 1]


def test_distances_to_many_bodies_agree_with_a_search_along_their_edges() -> None:
    random = np.random.default_rng(7)
    bodies = [
        points_footprint(Pose3((*random.uniform(-5, 5, 2), 0.0), TILTED), random.uniform(-0.5, 0.5, (8, 3)))
        for _ in range(40)
    ]
    points = random.uniform(-5, 5, (300, 2))
    found = distances_to(bodies, points)
    share = np.linspace(0, 1, 400)[:, None]
    for body, footprint in enumerate(bodies):
        ends = np.roll(footprint.corners, -1, axis=0)
        edge = np.concatenate([a + share * (b - a) for a, b in zip(footprint.corners, ends, strict=True)])
        searched = np.sqrt(((points[:, None] - edge) ** 2).sum(axis=2)).min(axis=1)
        assert np.all(np.abs(np.abs(found[:, body]) - searched) < 0.004)
    assert (found < 0).any()
    low, high = np.full(300, -9.0), np.full(300, 9.0)
    nearest, which = NearestBody([[each] for each in bodies]).find(points, low, high, np.full(300, 0.5))
    near = found.min(axis=1) <= 0.5
    assert np.array_equal(nearest[near], found.min(axis=1)[near])
    assert np.array_equal(which[near], found.argmin(axis=1)[near])


def test_without_bodies_there_is_none_nearest() -> None:
    assert NearestBody([]).find(np.zeros((3, 2)), np.zeros(3), np.ones(3))[0].tolist() == [math.inf] * 3


def _axes(rotation: tuple[float, float, float, float]) -> np.ndarray:
    return np.array(rotated_axes(rotation)).T
