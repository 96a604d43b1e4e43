"""What is published of a world's look."""

import math

from messages.base import decoder, encode
from messages.topics import WORLD_MARKERS
from messages.visualization import Marker, MarkerArray
from models.world import WorldDescription, read_world
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


def test_the_ground_of_an_empty_world_is_shown_about_the_origin() -> None:
    (ground,) = world_markers(WorldDescription()).markers
    assert (ground.pose.position.x, ground.pose.position.y) == (0.0, 0.0)
    assert (ground.scale.x, ground.scale.y) == (20.0, 20.0)
