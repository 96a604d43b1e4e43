"""What a world looks like, as markers: one of its ground, and those of its bodies."""

from __future__ import annotations

import math

from messages.geometry import Point, Pose, Quaternion, Vector3
from messages.std import ColorRGBA, Header
from messages.visualization import Marker, MarkerArray
from models.world import Box, WorldDescription

GROUND_MARGIN = 1.0
"""m of ground that is drawn around the outermost bodies."""
LEAST_GROUND = 20.0
"""m; the drawn ground measures as much at least, about the origin or the bodies."""
_GROUND_THICKNESS = 0.01
_GROUND_COLOUR = ColorRGBA(r=0.85, g=0.85, b=0.85, a=1.0)
_HEADER = Header(frame_id="world")


def world_markers(world: WorldDescription) -> MarkerArray:
    """The ground, in the namespace ``ground``, as a flat cube whose top is z = 0; then the bodies, in order.

    A body's namespace is its kind (``fixed``, ``movable`` or ``moving``), its ``text`` its name, its ``id`` its place
    in the array.
    """
    bodies = [_box(box, number) for number, box in enumerate(world.boxes, start=1)]
    return MarkerArray(markers=(_ground(bodies), *bodies))


def _box(box: Box, number: int) -> Marker:
    (x, y, z), (length, width, height), (r, g, b, a) = box.position, box.size, box.colour
    return Marker(
        header=_HEADER,
        ns="fixed",
        id=number,
        type=Marker.CUBE,
        pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion.from_yaw(box.yaw)),
        scale=Vector3(x=length, y=width, z=height),
        color=ColorRGBA(r=r, g=g, b=b, a=a),
        text=box.name,
    )


def _ground(bodies: list[Marker]) -> Marker:
    """The rectangle that holds all bodies, with a margin."""
    reaches = [(each.pose.position, math.hypot(each.scale.x, each.scale.y) / 2 + GROUND_MARGIN) for each in bodies]
    low_x, high_x = _extent([(place.x - reach, place.x + reach) for place, reach in reaches])
    low_y, high_y = _extent([(place.y - reach, place.y + reach) for place, reach in reaches])
    return Marker(
        header=_HEADER,
        ns="ground",
        type=Marker.CUBE,
        pose=Pose(position=Point(x=(low_x + high_x) / 2, y=(low_y + high_y) / 2, z=-_GROUND_THICKNESS / 2)),
        scale=Vector3(x=high_x - low_x, y=high_y - low_y, z=_GROUND_THICKNESS),
        color=_GROUND_COLOUR,
        text="ground",
    )


def _extent(intervals: list[tuple[float, float]]) -> tuple[float, float]:
    """The interval [m] that holds all, LEAST_GROUND long at least."""
    low = min((each[0] for each in intervals), default=0.0)
    high = max((each[1] for each in intervals), default=0.0)
    missing = max(0.0, LEAST_GROUND - (high - low)) / 2
    return low - missing, high + missing
