"""Walls from the image of a floor plan; reads and writes ``map.yaml`` of ROS's map_server and nav2."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from messages.errors import BadInput, nearest, unknown_name
from messages.nav import MOST_CELLS
from messages.se3 import Pose3
from models.angles import angle_fault
from models.bodies import (
    MAX_PARTS,
    BadWorld,
    BodyPart,
    BoxShape,
    Colour,
    Coordinate,
    Shade,
    Start,
    WorldBody,
    WorldDescription,
)
from models.input_file import read_limited
from models.picture import read_picture
from models.yaml_reader import YamlSource, read_yaml

MAX_PIXELS = 4096 * 4096
"""Maximum number of pixels of a floor plan."""
WALL_COLOUR: Colour = (0.72, 0.72, 0.70, 1.0)
PLAN_NAME = "plan"
"""Name of the body of all walls of a plan."""

Resolution = Annotated[float, Meta(gt=0, le=1000, extra={"unit": "m"})]
Angle = Annotated[float, Meta(ge=-100, le=100, extra={"unit": "rad"})]
Height = Annotated[float, Meta(gt=0, le=100, extra={"unit": "m"})]


class PlanKeys(msgspec.Struct, frozen=True, kw_only=True):
    """The keys of a plan in a world's file.

    ``plan`` is an image, dark where there is a wall, or a ``map.yaml``, which defines the other keys. ``origin`` is the
    pose of the image's lower left corner.
    """

    plan: str = ""
    resolution: Resolution | None = None
    origin: Annotated[tuple[Coordinate, ...], Meta(min_length=2, max_length=3)] | None = None
    wall_height: Height = 1.0
    occupied_thresh: Shade | None = None
    negate: bool | None = None


class FloorPlan(NamedTuple):
    """A plan: ``walls``, shape (rows from the top, columns), m per pixel, and its lower left corner x, y, yaw."""

    walls: NDArray[np.bool_]
    resolution: float
    origin: tuple[float, float, float]
    wall_height: float


def read_plan(keys: PlanKeys, folder: Path) -> FloorPlan:
    """Read the plan of a world's file; raises BadInput.

    Args:
        keys: The keys in the file.
        folder: The folder that the plan's path is relative to.
    """
    path = folder / keys.plan
    if path.suffix.lower() in (".yaml", ".yml"):
        stated = read_map(path)
        if keys.resolution is not None or keys.negate is not None:
            raise BadInput(f"{keys.plan} states resolution and negate: leave them out here")
    elif keys.resolution is None:
        raise BadInput("a plan needs a resolution [m per pixel]")
    else:
        stated = MapFile(image=path, resolution=keys.resolution, origin=(0.0, 0.0, 0.0))
    if keys.origin is not None:
        x, y, *yaw = keys.origin
        if yaw and (fault := angle_fault(yaw[0])):
            raise BadInput(f"origin: {fault}")
        stated = msgspec.structs.replace(stated, origin=(x, y, yaw[0] if yaw else 0.0))
    if keys.occupied_thresh is not None:
        stated = msgspec.structs.replace(stated, occupied_thresh=keys.occupied_thresh)
    if keys.negate is not None:
        stated = msgspec.structs.replace(stated, negate=keys.negate)
    return FloorPlan(_walls(stated), stated.resolution, stated.origin, keys.wall_height)


def plan_body(plan: FloorPlan) -> WorldBody:
    """Return the walls as one body of boxes; raises BadInput if there are too many."""
    rows, _ = plan.walls.shape
    x, y, yaw = plan.origin
    edge, parts = plan.resolution, []
    for top, left, bottom, right in rectangles(plan.walls):
        size = (right - left) * edge, (bottom - top) * edge, plan.wall_height
        centre = (left + right) / 2 * edge, (rows - (top + bottom) / 2) * edge, plan.wall_height / 2
        parts.append(BodyPart(BoxShape(size), Pose3(centre), WALL_COLOUR))
    if not parts:
        raise BadInput("the plan has no wall: nothing in the picture is dark enough for occupied_thresh")
    return WorldBody(PLAN_NAME, tuple(parts), Pose3.planar(x, y, yaw))


def rectangles(filled: NDArray[np.bool_]) -> Iterator[tuple[int, int, int, int]]:
    """Yield disjoint rectangles (top, left, bottom, right) that cover all filled pixels, each as large as possible from
    its first pixel; raises BadInput for more than a world may have."""
    left_over = filled.copy()
    columns = left_over.shape[1]
    flat, place, count = left_over.reshape(-1), 0, 0
    while True:
        step = int(flat[place:].argmax()) if place < flat.size else 0
        if place >= flat.size or not flat[place + step]:
            return
        place += step
        top, left = divmod(place, columns)
        count += 1
        if count > MAX_PARTS:
            raise BadInput(
                f"the plan's walls take more than {MAX_PARTS} boxes: its dark pixels are scattered, or its walls run "
                "askew; turn or clean the picture, or make it coarser"
            )
        wide = _wide_first(left_over, top, left)
        tall = _wide_first(left_over.T, left, top)
        bottom, right = wide if _area(wide, top, left) >= _area(tall[::-1], top, left) else tall[::-1]
        left_over[top:bottom, left:right] = False
        yield top, left, bottom, right


def _area(corner: tuple[int, ...], top: int, left: int) -> int:
    return (corner[0] - top) * (corner[1] - left)


def _wide_first(filled: NDArray[np.bool_], top: int, left: int) -> tuple[int, int]:
    """Return the lower right corner of the rectangle from a pixel on that is as wide as possible, then as tall."""
    row = filled[top, left:]
    length = int(row.argmin())
    right = left + (length if not row[length] else len(row))
    bottom = top + 1
    while bottom < len(filled) and filled[bottom, left:right].all():
        bottom += 1
    return bottom, right


class MapFile(msgspec.Struct, frozen=True, kw_only=True):
    """The content of a ``map.yaml``; ``notes`` list unknown keys."""

    image: Path
    resolution: Resolution
    origin: tuple[Coordinate, Coordinate, Angle]
    negate: bool = False
    occupied_thresh: Shade = 0.65
    free_thresh: Shade = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"
    notes: tuple[str, ...] = ()


_MAX_YAML = 1 << 16
_NEEDED = ("image", "resolution", "origin")


def read_map(path: Path) -> MapFile:
    """Read a ``map.yaml``, whose image path is relative to it. Raises BadInput with the line."""
    text = read_limited(path, _MAX_YAML, "a map").decode(errors="replace")
    tree, source = read_yaml(text, str(path)), YamlSource(path, text)
    if not isinstance(tree, dict):
        raise BadInput(f"{path}: this is not a map.yaml: it has no keys image, resolution and origin")
    known = [each.name for each in msgspec.structs.fields(MapFile) if each.name != "notes"]
    for key in _NEEDED:
        if key not in tree:
            raise BadInput(f"{path}: this is not a map.yaml: the key {key} is missing")
    notes = []
    for key in map(str, [each for each in tree if each not in known]):
        if nearest(key, known):
            raise unknown_name("key", key, known, source.location(key))
        notes.append(f"{source.location(key)}: {key}: it is not understood, and ignored")
    if isinstance(tree.get("negate"), int):
        tree["negate"] = bool(tree["negate"])
    image = tree["image"]
    if not isinstance(image, str):
        raise BadInput(f"{source.location('image')}: image is not the path of a picture")
    try:
        stated = {key: value for key, value in tree.items() if key in known}
        return msgspec.convert({**stated, "image": path.parent / image, "notes": notes}, MapFile, strict=False)
    except msgspec.ValidationError as error:
        reason, _, where = str(error).partition(" - at `$.")
        key = where.rstrip("`").partition("[")[0]
        raise BadInput(f"{source.location(key)}: {key}: {reason}") from None


def read_map_yaml(path: Path) -> WorldDescription:
    """Read the world of a ``map.yaml``: its occupied cells become walls 1 m high. Raises BadWorld."""
    try:
        stated = read_map(path)
        plan = FloorPlan(_walls(stated), stated.resolution, stated.origin, 1.0)
        return WorldDescription(
            about=f"The walls of {path.name}", start=Start(), bodies=(plan_body(plan),), notes=stated.notes
        )
    except BadInput as error:
        text = str(error)
        raise BadWorld(text if text.startswith(str(path)) else f"{path}: {text}") from None


def write_map(path: Path, occupied: NDArray[np.bool_], free: NDArray[np.bool_], resolution: float, origin: Any) -> None:
    """Write a ``map.yaml`` and its PGM next to it; cells that are neither ``occupied`` nor ``free`` are unknown.

    Args:
        path: The YAML file; the image has the same name with ``.pgm``.
        occupied: Cells, shape (rows from the top, columns).
        free: The same.
        resolution: m per cell.
        origin: x [m], y [m] and yaw [rad] of the lower left corner.
    """
    picture = path.with_suffix(".pgm")
    cells = np.where(occupied, 0, np.where(free, 254, 205)).astype(np.uint8)
    rows, columns = cells.shape
    picture.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + cells.tobytes())
    x, y, yaw = origin
    path.write_text(
        f"image: {picture.name}\nmode: trinary\nresolution: {resolution:g}\norigin: [{x:g}, {y:g}, {yaw:g}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def read_occupancy(stated: MapFile) -> NDArray[np.int8]:
    """Return the occupancy of a map's cells [%], -1 if unknown, shape (rows from the bottom, columns), as in ROS's
    map_server; raises BadInput."""
    picture = read_picture(stated.image, MOST_CELLS, "a map")
    occupancy = picture.lightness if stated.negate else 1.0 - picture.lightness
    occupied, free = occupancy > stated.occupied_thresh, occupancy < stated.free_thresh
    cells = np.full(occupancy.shape, -1.0)
    match stated.mode:
        case "raw":
            values = np.rint(picture.lightness * 255)
            cells = np.where(values <= 100, values, -1)
        case "scale":
            span = max(stated.occupied_thresh - stated.free_thresh, 1e-9)
            between = np.trunc(1 + 98 * (occupancy - stated.free_thresh) / span)
            cells = np.where(picture.transparent, -1, np.where(occupied, 100, np.where(free, 0, between)))
        case "trinary":
            cells = np.where(occupied, 100, np.where(free, 0, -1))
    return cells[::-1].astype(np.int8)


def _walls(stated: MapFile) -> NDArray[np.bool_]:
    """Return where a map is occupied: p > occupied_thresh, with p = 1 - lightness, or lightness if negated."""
    picture = read_picture(stated.image, MAX_PIXELS, "a floor plan")
    occupancy = picture.lightness if stated.negate else 1.0 - picture.lightness
    if stated.mode == "raw":  # pixel values are occupancies in percent, above 100 unknown
        occupancy = picture.lightness * 2.55
        occupancy[occupancy > 1.0 + 1e-9] = 0.0
    if not all(math.isfinite(each) for each in stated.origin):
        raise BadInput("the origin is not a finite pose")
    walls: NDArray[np.bool_] = (occupancy > stated.occupied_thresh) & ~picture.transparent
    return walls
