"""Reads world files: this project's TOML and, by their extensions, SDF and ``map.yaml``."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from messages.errors import BadInput, unknown_name
from messages.se3 import IDENTITY, Pose3, quaternion_from_rpy
from models.angles import Angle, angle_fault
from models.bodies import (
    GREY,
    GROUND_NAME,
    LEAST_MASS,
    MAX_MOVABLE,
    MAX_PARTS,
    BadWorld,
    BodyPart,
    BodyPath,
    Box,
    BoxShape,
    Colour,
    Coordinate,
    CylinderShape,
    Extent,
    HeightMapShape,
    Light,
    MeshShape,
    RampShape,
    Repeat,
    Shade,
    Shape,
    SphereShape,
    Start,
    WorldBody,
    WorldDescription,
)
from models.floor_plan import PLAN_NAME, PlanKeys, plan_body, read_map_yaml, read_plan
from models.input_file import read_limited
from models.toml_source import TomlSource, key_path
from models.world_meshes import WorldMeshes

MAX_BYTES = 8 << 20
"""Maximum size of a world's TOML file [bytes]; a box takes about 100."""
MAX_POINTS = 10_000
"""Maximum number of points in all paths of a world."""

COLOURS: dict[str, Colour] = {
    "white": (1.0, 1.0, 1.0, 1.0),
    "black": (0.05, 0.05, 0.05, 1.0),
    "grey": GREY,
    "red": (0.75, 0.15, 0.12, 1.0),
    "green": (0.12, 0.55, 0.25, 1.0),
    "blue": (0.15, 0.30, 0.70, 1.0),
    "yellow": (0.90, 0.75, 0.15, 1.0),
    "orange": (0.90, 0.50, 0.10, 1.0),
    "purple": (0.50, 0.25, 0.60, 1.0),
    "brown": (0.45, 0.30, 0.18, 1.0),
}
"""Colours by name."""

Friction = Annotated[float, Meta(ge=0, le=10)]
Position = tuple[Coordinate, Coordinate, Coordinate]
ColourValue = Annotated[tuple[Shade, ...], Meta(min_length=3, max_length=4)] | str
Scale = Annotated[float, Meta(ge=-1e4, le=1e4)]


class WorldTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a world's file; an unknown key is an error."""


class PathKeys(WorldTable, frozen=True, kw_only=True):
    """Motion of a body along a path."""

    path: tuple[Annotated[tuple[Coordinate, ...], Meta(min_length=2, max_length=3)], ...] = ()
    speed: Annotated[float, Meta(ge=1e-4, le=100, extra={"unit": "m/s"})] = 0.5
    repeat: Repeat = "there_and_back"
    pause: Annotated[float, Meta(ge=0, le=1e6, extra={"unit": "s"})] = 0.0
    start: Annotated[float, Meta(ge=0, le=1e6, extra={"unit": "s"})] = 0.0


class BodyKeys(PathKeys, frozen=True, kw_only=True, tag_field="shape"):
    """The keys common to all bodies."""

    name: Annotated[str, Meta(min_length=1, max_length=255)]
    position: Position | None = None
    yaw: Angle = 0.0
    rpy: tuple[Angle, Angle, Angle] | None = None
    colour: ColourValue = GREY
    fixed: bool | None = None
    mass: Annotated[float, Meta(ge=LEAST_MASS, le=1e6, extra={"unit": "kg"})] | None = None
    friction: Friction = 0.5
    ground: bool | None = None


class BoxKeys(BodyKeys, frozen=True, kw_only=True, tag="box"):
    """A box."""

    size: tuple[Extent, Extent, Extent]


class CylinderKeys(BodyKeys, frozen=True, kw_only=True, tag="cylinder"):
    """A cylinder, upright unless rotated."""

    radius: Extent
    length: Extent


class SphereKeys(BodyKeys, frozen=True, kw_only=True, tag="sphere"):
    """A sphere."""

    radius: Extent


class RampKeys(BodyKeys, frozen=True, kw_only=True, tag="ramp"):
    """A wedge that rises along its x axis."""

    size: tuple[Extent, Extent, Extent]


class MeshKeys(BodyKeys, frozen=True, kw_only=True, tag="mesh"):
    """A mesh from an STL, OBJ or DAE file."""

    file: str
    scale: Scale | Annotated[tuple[Scale, ...], Meta(min_length=3, max_length=3)] = 1.0
    convex: bool = False


class HeightMapKeys(BodyKeys, frozen=True, kw_only=True, tag="height_map"):
    """Ground with heights from an image: black at the first value of ``height``, white at the second."""

    image: str
    resolution: Annotated[float, Meta(gt=0, le=1000, extra={"unit": "m"})]
    height: tuple[Coordinate, Coordinate]


AnyBody = BoxKeys | CylinderKeys | SphereKeys | RampKeys | MeshKeys | HeightMapKeys
_SHAPES = ("box", "cylinder", "sphere", "ramp", "mesh", "height_map")


class LightKeys(WorldTable, frozen=True, kw_only=True):
    """A light; ``type`` and ``position`` are accepted but have no effect."""

    name: str = ""
    type: Literal["directional", "point", "spot"] = "directional"
    position: Position = (0.0, 0.0, 10.0)
    direction: tuple[float, float, float] = (-0.5, 0.1, -0.9)
    colour: ColourValue = (1.0, 1.0, 1.0)


class WorldFile(PlanKeys, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A world's TOML file."""

    about: str = ""
    start: Start | None = None
    friction: Friction = 1.0
    boxes: tuple[Box, ...] = ()
    bodies: tuple[AnyBody, ...] = ()
    obstacles: tuple[AnyBody, ...] = ()
    lights: tuple[LightKeys, ...] = ()


_TABLES: dict[str, type[msgspec.Struct]] = {"boxes": Box, "lights": LightKeys, "start": Start}
_BODIES: dict[str, type[msgspec.Struct]] = dict(
    zip(_SHAPES, (BoxKeys, CylinderKeys, SphereKeys, RampKeys, MeshKeys, HeightMapKeys), strict=True)
)


def read_world_file(path: Path, packages: Sequence[Path] = ()) -> WorldDescription:
    """Read the world in a file; raises BadWorld."""
    match path.suffix.lower():
        case ".toml":
            return check_world(_read_toml(path), str(path))
        case ".yaml" | ".yml":
            return check_world(read_map_yaml(path), str(path))
        case suffix if suffix in (".sdf", ".world") or _is_xml(path):
            from models.sdf import read_sdf_world

            return check_world(read_sdf_world(path, packages), str(path))
    raise BadWorld(
        f"{path}: a world's file is a .toml, .sdf, .world or .yaml, not {path.suffix or 'one without ending'}"
    )


def _is_xml(path: Path) -> bool:
    """Whether a file is XML by its content, since Gazebo accepts worlds with any extension."""
    try:
        with path.open("rb") as file:
            return file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    except OSError:
        return False


def check_world(world: WorldDescription, where: str) -> WorldDescription:
    """Return the world if it is within the limits; raises BadWorld."""
    parts = len(world.boxes) + sum(len(body.parts) for body in world.bodies)
    if parts > MAX_PARTS:
        raise BadWorld(f"{where}: the world has {parts:,} shapes, the limit is {MAX_PARTS:,}")
    moving = sum(body.kind != "fixed" for body in world.bodies)
    if moving > MAX_MOVABLE:
        raise BadWorld(f"{where}: the world has {moving} movable and moving bodies, the limit is {MAX_MOVABLE}")
    return world


def _read_toml(path: Path) -> WorldDescription:
    content = read_limited(path, MAX_BYTES, "a world")
    try:
        text = content.decode()
        tree = tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise BadWorld(f"{path}: this is not UTF-8: {error}") from None
    except ValueError as error:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        raise BadWorld(f"{path}:{found[1] if found else 1}: this is not TOML: {error}") from None
    except RecursionError:
        raise BadWorld(f"{path}: this TOML is nested too deeply") from None
    _check_counts(path, tree)
    return _TomlWorld(path, text, tree).read()


def _check_counts(path: Path, tree: dict[str, Any]) -> None:
    """Raise BadWorld for too many bodies before any is converted."""
    for key in ("boxes", "bodies", "obstacles"):
        if isinstance(rows := tree.get(key), list) and len(rows) > MAX_PARTS:
            raise BadWorld(f"{path}: [[{key}]] has {len(rows):,} entries, the limit of a world is {MAX_PARTS:,}")


class _TomlWorld:
    """Converts a TOML file to a world: every error begins with the file and the line of its key."""

    def __init__(self, path: Path, text: str, tree: dict[str, Any]) -> None:
        self._source, self._tree, self._folder = TomlSource(path, text), tree, path.parent
        self._meshes = WorldMeshes()

    def read(self) -> WorldDescription:
        try:
            file = msgspec.convert(self._tree, WorldFile)
        except msgspec.ValidationError as error:
            raise self._located(str(error)) from None
        bodies = [self._plan(file)] if file.plan else []
        for key, entries in (("bodies", file.bodies), ("obstacles", file.obstacles)):
            bodies += [self._body(entry, key, index) for index, entry in enumerate(entries)]
        self._check_names(file)
        if sum(len(each.path) for each in (*file.bodies, *file.obstacles)) > MAX_POINTS:
            raise BadWorld(f"{self._source.path}: the paths have more than {MAX_POINTS} points")
        return WorldDescription(
            about=file.about,
            start=file.start,
            friction=file.friction,
            boxes=file.boxes,
            bodies=tuple(bodies),
            lights=tuple(self._light(light, index) for index, light in enumerate(file.lights)),
        )

    def _plan(self, file: WorldFile) -> WorldBody:
        try:
            return plan_body(read_plan(file, self._folder))
        except BadInput as error:
            raise BadWorld(f"{self._source.location('plan')}: {error}") from None

    def _body(self, entry: AnyBody, key: str, index: int) -> WorldBody:
        def fail(name: str, text: str) -> BadWorld:
            return BadWorld(f"{self._source.location(key, index, name)}: {entry.name!r}: {text}")

        if key == "obstacles" and not entry.path:
            raise fail("path", "an obstacle needs a path = [[x, y], ...]; one that stands still belongs in [[bodies]]")
        if entry.path and entry.mass is not None:
            raise fail("mass", "a body with a path cannot be pushed: it has no mass")
        if entry.fixed and (entry.mass is not None or entry.path):
            raise fail("fixed", "a fixed body has neither a mass nor a path")
        if entry.fixed is False and entry.mass is None and not entry.path:
            raise fail("fixed", "a body that can be moved needs a mass [kg]")
        if entry.rpy is not None and entry.yaw:
            raise fail("yaw", "give rpy or yaw, not both")
        if isinstance(entry, HeightMapKeys) and (entry.mass is not None or entry.path):
            raise fail("mass" if entry.mass is not None else "path", "a height map does not move")
        try:
            shape = self._shape(entry)
        except BadInput as error:
            raise fail("file" if isinstance(entry, MeshKeys) else "image", str(error)) from None
        place = entry.position
        if place is None:
            place = (0.0, 0.0, _resting_height(shape))
        path = None
        if entry.path:
            points = tuple((each[0], each[1], each[2] if len(each) == 3 else place[2]) for each in entry.path)
            path = BodyPath(points, entry.speed, entry.repeat, entry.pause, entry.start)
            if entry.position is not None and entry.position[:2] != points[0][:2]:
                raise fail(
                    "position", "a body with a path starts at its first point: leave out position, or give its x and y"
                )
            place = points[0]
        orientation = quaternion_from_rpy(*(entry.rpy or (0.0, 0.0, entry.yaw)))
        ground = isinstance(entry, RampKeys | HeightMapKeys) if entry.ground is None else entry.ground
        part = BodyPart(shape, IDENTITY, self._colour(entry.colour, key, index), ground=ground)
        return WorldBody(entry.name, (part,), Pose3(place, orientation), entry.mass or 0.0, entry.friction, path=path)

    def _shape(self, entry: AnyBody) -> Shape:
        match entry:
            case BoxKeys():
                return BoxShape(entry.size)
            case CylinderKeys():
                return CylinderShape(entry.radius, entry.length)
            case SphereKeys():
                return SphereShape(entry.radius)
            case RampKeys():
                return RampShape(entry.size)
            case MeshKeys():
                x, y, z = entry.scale if isinstance(entry.scale, tuple) else (entry.scale,) * 3
                return self._meshes.mesh((self._folder / entry.file).resolve(), (x, y, z), entry.convex)
            case HeightMapKeys():
                return self._meshes.height_map(self._folder / entry.image, entry.height, None, entry.resolution)

    def _colour(self, value: ColourValue, key: str, index: int) -> Colour:
        if isinstance(value, str):
            if value not in COLOURS:
                raise BadWorld(str(unknown_name("colour", value, COLOURS, self._source.location(key, index, "colour"))))
            return COLOURS[value]
        r, g, b, *opacity = value
        return r, g, b, opacity[0] if opacity else 1.0

    def _light(self, light: LightKeys, index: int) -> Light:
        if not math.isfinite(sum(light.direction)) or not any(light.direction):
            raise BadWorld(f"{self._source.location('lights', index, 'direction')}: this is not a direction")
        return Light(light.name, light.direction, self._colour(light.colour, "lights", index)[:3])

    def _check_names(self, file: WorldFile) -> None:
        seen: dict[str, str] = {PLAN_NAME: self._source.location("plan")} if file.plan else {}
        seen[GROUND_NAME] = "z = 0"
        for key, entries in (("boxes", file.boxes), ("bodies", file.bodies), ("obstacles", file.obstacles)):
            for index, entry in enumerate(entries):
                if entry.name in seen:
                    where = self._source.location(key, index, "name")
                    raise BadWorld(f"{where}: there is a body {entry.name!r} already, at {seen[entry.name]}")
                seen[entry.name] = f"{self._source.path}: [[{key}]] {index + 1}"

    def _located(self, error: str) -> BadWorld:
        """Return msgspec's error with the line of its path, and the alternatives for an unknown key or shape."""
        text, _, where = error.partition(" - at `$")
        path = key_path(where.rstrip("`"))
        if found := re.search(r"unknown field `(.*?)`", text):
            return BadWorld(
                str(unknown_name("key", found[1], self._known_keys(path), self._source.location(*path, found[1])))
            )
        if path[-1:] == ("shape",) or "required field `shape`" in text:
            shape = self._value(path) if path[-1:] == ("shape",) else ""
            return BadWorld(str(unknown_name("shape", str(shape), _SHAPES, self._source.location(*path))))
        text = angle_fault(self._value(path), path) or text
        shown = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
        return BadWorld(f"{self._source.location(*path)}: {f'{shown}: ' if shown else ''}{text}")

    def _known_keys(self, path: tuple[str | int, ...]) -> Iterator[str]:
        record: type[msgspec.Struct] = WorldFile
        if path:
            record = _TABLES.get(str(path[0])) or _BODIES.get(self._value((*path[:2], "shape")), BoxKeys)
            yield from () if str(path[0]) in _TABLES else ("shape",)
        yield from (each.name for each in msgspec.structs.fields(record))

    def _value(self, path: tuple[str | int, ...]) -> Any:
        value: Any = self._tree
        for step in path:
            value = value[step]
        return value


def _resting_height(shape: Shape) -> float:
    """Return the height of a shape's origin [m] at which it stands upright on the ground."""
    match shape:
        case BoxShape((_, _, z)) | RampShape((_, _, z)):
            return z / 2
        case CylinderShape(_, length):
            return length / 2
        case SphereShape(radius):
            return radius
        case MeshShape() | HeightMapShape():
            return 0.0
