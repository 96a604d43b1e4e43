"""The markers that the simulation publishes for a world's appearance."""

import math
from pathlib import Path

import numpy as np
import pytest

from messages.base import decoder, encode
from messages.se3 import Pose3
from messages.topics import WORLD_MARKERS
from messages.visualization import Marker, MarkerArray
from models.bodies import (
    MAX_PARTS,
    BodyPart,
    BodyPath,
    BoxShape,
    CylinderShape,
    HeightMapShape,
    MeshShape,
    RampShape,
    SphereShape,
)
from models.shape_mesh import height_map_mesh
from models.world import WorldBody, WorldDescription, read_world
from services.sim.world_markers import world_markers


def test_a_world_is_its_ground_and_its_bodies_in_order() -> None:
    world = read_world("arena")
    array = world_markers(world)
    ground, *bodies = array.markers
    assert (ground.ns, ground.text, ground.type) == ("ground", "ground", Marker.CUBE)
    assert ground.pose.position.z + ground.scale.z / 2 == 0
    assert ground.scale.x >= 20
    assert [(each.ns, each.text) for each in bodies] == [("fixed", box.name) for box in world.boxes]
    assert len({(each.ns, each.id) for each in array.markers}) == len(array.markers)
    red = next(each for each in bodies if each.text == "red_box")
    assert (red.pose.position.x, red.pose.position.y, red.pose.position.z) == (2.0, 2.0, 0.2)
    assert (red.scale.x, red.scale.y, red.scale.z) == (0.4, 0.4, 0.4)
    assert math.isclose(red.pose.orientation.yaw, 0.5)
    payload = encode(array)
    assert decoder(MarkerArray)(payload) == array
    assert len(payload) < WORLD_MARKERS.largest


def test_bodies_of_every_shape_are_drawn_by_few_markers() -> None:
    wave = HeightMapShape(np.random.default_rng(1).random((300, 200)), (20.0, 30.0))
    rows = 120
    x, y = np.meshgrid(np.arange(rows, dtype=float), np.arange(rows, dtype=float))
    large = height_map_mesh(HeightMapShape(x + y, (1.0, 1.0)))
    path = BodyPath(((30.0, 0.0, 0.5), (40.0, 0.0, 0.5)), 1.0)
    red, blue = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
    table = BodyPart(BoxShape((1, 1, 0.1)), Pose3((0, 0, 0.7)), red), BodyPart(CylinderShape(0.1, 0.7), colour=blue)
    world = WorldDescription(
        bodies=(
            WorldBody("hills", (BodyPart(wave, ground=True),)),
            WorldBody("ramp", (BodyPart(RampShape((2, 1, 0.5)), ground=True),), Pose3((0, 0, 0.25))),
            WorldBody("ball", (BodyPart(SphereShape(0.2)),), Pose3((1, 2, 0.2)), mass=1.0),
            WorldBody("table", table, Pose3((5, 5, 0)), mass=4.0),
            WorldBody("cart", (BodyPart(CylinderShape(0.2, 1.0)),), Pose3((30, 0, 0.5)), path=path),
            WorldBody("statue", (BodyPart(MeshShape(large, Path("/tmp/a b.stl"), (0.1, 0.2, 0.3))),)),
            WorldBody("unnamed", (BodyPart(MeshShape(large)),)),
            WorldBody("felt", (BodyPart(BoxShape((1, 1, 1)), visible=False),)),
        )
    )
    array = world_markers(world)
    ground, *markers = array.markers
    assert [(each.ns, each.text, each.type) for each in markers] == [
        ("ground", "hills", Marker.TRIANGLE_LIST),
        ("ground", "ramp", Marker.TRIANGLE_LIST),
        ("movable", "ball", Marker.SPHERE),
        ("movable", "table", Marker.TRIANGLE_LIST),
        ("moving", "cart", Marker.CYLINDER),
        ("fixed", "statue", Marker.MESH_RESOURCE),
        ("fixed", "unnamed", Marker.TRIANGLE_LIST),
    ]
    hills, ramp, ball, table_marker, cart, statue, unnamed = markers
    assert len(hills.points) == 3 * 2 * 49 * 49
    assert max(point.y for point in hills.points) == 15
    assert len(ramp.points) == 3 * 8
    assert (ball.scale.x, ball.pose.position.y) == (0.4, 2.0)
    assert (table_marker.pose.position.x, len(table_marker.colors)) == (5.0, len(table_marker.points))
    assert (cart.scale.x, cart.scale.z) == (0.4, 1.0)
    assert (statue.mesh_resource, statue.scale.z) == ("file:///tmp/a%20b.stl", 0.3)
    assert len(unnamed.points) == 3 * 12  # too large for a message: its bounding box
    assert ground.pose.position.x + ground.scale.x / 2 >= 41  # the whole path
    assert len(encode(array)) < WORLD_MARKERS.largest


@pytest.mark.slow
def test_the_largest_worlds_fit_into_a_message() -> None:
    part = BodyPart(BoxShape((1.23456789, 1.23456789, 1.23456789)), Pose3((0.123456789, 0.1, 0.1)))
    fixed = [WorldBody(f"a_wall_with_a_long_name_{n}", (part,), Pose3((n / 7, n / 3, 0.1))) for n in range(MAX_PARTS)]
    array = world_markers(WorldDescription(bodies=tuple(fixed)))
    assert len(encode(array)) < WORLD_MARKERS.largest
    wave = HeightMapShape(np.random.default_rng(1).random((60, 60)), (20.0, 30.0))
    hills = [WorldBody(f"hill_{n}", (BodyPart(wave),)) for n in range(30)]
    assert len(encode(world_markers(WorldDescription(bodies=tuple(hills))))) < WORLD_MARKERS.largest


def test_the_ground_of_an_empty_world_is_shown_about_the_origin() -> None:
    (ground,) = world_markers(WorldDescription()).markers
    assert (ground.pose.position.x, ground.pose.position.y) == (0.0, 0.0)
    assert (ground.scale.x, ground.scale.y) == (20.0, 20.0)
