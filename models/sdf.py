"""Reads worlds and models in SDF, Gazebo's format, versions 1.4 to 1.11: bodies of primitive shapes and meshes.

Unsupported content is ignored and listed in the notes of the world, each tag once with file and line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from messages.errors import BadInput
from messages.se3 import IDENTITY, Pose3, Vector, quaternion_from_rpy, rotate, rotate_inverse
from models.bodies import (
    GREY,
    GROUND_NAME,
    LEAST_EXTENT,
    LEAST_MASS,
    MAX_PARTS,
    BadWorld,
    BodyPart,
    BoxShape,
    Colour,
    CylinderShape,
    HeightMapShape,
    Light,
    MeshShape,
    Shape,
    SphereShape,
    Start,
    WorldBody,
    WorldDescription,
)
from models.model_uri import find_model_file, find_resource
from models.packages import OWNER, FileAccess, FileMissing, PackagePath
from models.polyline import extruded
from models.sdf_xml import SdfElement, parse_sdf, read_sdf
from models.shape_mesh import shape_mesh
from models.world_meshes import WorldMeshes

MAX_INCLUDES = 2000
"""Maximum number of includes in a world, counting repeated ones."""
MAX_NESTING = 8
"""Maximum nesting of models, and of files that include files."""
MAX_CHAIN = 100
"""Maximum length of a chain of frames with relative poses."""
MAX_VALUE = 1e4
"""Maximum magnitude of a length or coordinate, m."""
FLOOR_EXTENT, FLOOR_HEIGHT = 2.0, 0.5
"""Wheels roll on parts that are larger than the first in both horizontal directions, and lower than the second [m]."""
PLANE_THICKNESS = 0.1
"""Thickness [m] of the box below the surface of a plane that is not the ground."""

_SHAPES = ("box", "cylinder", "sphere", "plane", "mesh", "heightmap", "polyline", "capsule", "ellipsoid")
_SILENT = (
    "scene gravity physics magnetic_field atmosphere spherical_coordinates gui wind self_collide allow_auto_disable "
    "enable_wind kinematic velocity_decay must_be_base_link description license author name audio light sensor "
    "wheelslip max_contacts laser_retro cast_shadows transparency meta plugin state population road placement_frame "
    "uri static pose frame"
)
"""Tags that describe no body: the simulation has its own equivalent, or they are only for display."""


def read_sdf_world(path: Path, packages: Sequence[Path] = ()) -> WorldDescription:
    """Read the world in an SDF file, or its models if it has no world; raises BadWorld with file and line."""
    return _Reader(packages).world(read_sdf(path), path)


@dataclass(frozen=True)
class SdfLink:
    """A link of a model: its pose in the model, its parts in its own frame, its mass [kg], centre and moments."""

    name: str
    pose: Pose3
    parts: tuple[BodyPart, ...]
    mass: float
    centre: Vector | None
    moments: Vector | None
    friction: float


@dataclass(frozen=True)
class SdfJoint:
    """A joint of a model: its kind and its links, its pose in the model, its axis in its own frame, and its limits."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose3
    axis: Vector
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    friction: float


@dataclass(frozen=True)
class SdfModel:
    """A model with its parts; ``tags`` are sensors and plugins, with the link that they belong to, if any."""

    name: str
    static: bool
    links: tuple[SdfLink, ...]
    joints: tuple[SdfJoint, ...]
    tags: tuple[tuple[str, SdfElement], ...]
    notes: tuple[str, ...]


def read_sdf_model(
    text: str, folder: Path | None = None, packages: Sequence[Path] = (), access: FileAccess = OWNER
) -> SdfModel:
    """Read the links and joints of the model in a text, and notes on unsupported content; raises BadWorld.

    Args:
        text: SDF with one model.
        folder: The folder that its paths are relative to, by default the working directory.
        packages: Folders in which ``model://`` and ``package://`` are searched for.
        access: The files it may refer to.
    """
    root, element = _only_model(text, (folder or Path()) / "model.sdf")
    return _Reader(packages, access).whole_model(element, _has_axes_of_model(root))


def read_sdf_pose(text: str) -> Pose3:
    """Return the pose of the model in a text, without reading other files; raises BadWorld."""
    _, element = _only_model(text, Path("model.sdf"))
    return _Frames(_Reader(()), element).own_pose


def _only_model(text: str, where: Path) -> tuple[SdfElement, SdfElement]:
    """Return the root of a text and its model."""
    root = parse_sdf(text, where)
    worlds = [each for each in root.children if each.tag == "world"]
    models = [each for top in (root, *worlds) for each in top.children if each.tag == "model"]
    if len(models) != 1:
        raise BadWorld(f"{where}:{root.line}: the text has {len(models)} models, not one")
    return root, models[0]


def _has_axes_of_model(root: SdfElement) -> bool:
    """Whether the axes of joints are in the frame of the model, as before version 1.5, and not in that of the joint."""
    version = re.fullmatch(r"(\d{1,9})\.(\d{1,9})", root.attributes.get("version", ""))
    return version is not None and (int(version[1]), int(version[2])) < (1, 5)


def _saved_poses(world: SdfElement) -> dict[str, SdfElement]:
    """Return the poses of models in the first ``<state>`` by name; Gazebo saves there where a model was moved to."""
    state = world.find("state")
    found: dict[str, SdfElement] = {}
    for model in state.children if state is not None else ():
        pose = model.find("pose")
        if model.tag == "model" and pose is not None and _is_finite_pose(pose.text):
            found[model.attributes.get("name", "")] = pose
    return found


def _is_finite_pose(text: str) -> bool:
    try:
        values = [float(each) for each in text.split()]
    except ValueError:
        return False
    return len(values) == 6 and all(map(math.isfinite, values))


def _with_saved_pose(element: SdfElement, poses: Mapping[str, SdfElement]) -> SdfElement:
    """Return an element of a world, with its saved pose in place of its own if it is a model that has one."""
    named = element.find("name") if element.tag == "include" else None
    name = named.text if named is not None else element.attributes.get("name", "")
    if element.tag not in ("model", "include") or name not in poses:
        return element
    return replace(element, children=[poses[name], *(each for each in element.children if each.tag != "pose")])


class _Reader:
    """Converts elements to bodies; ``notes`` list unsupported content, by tag."""

    def __init__(self, packages: Sequence[Path], access: FileAccess = OWNER) -> None:
        self.notes: dict[str, str] = {}
        self.lights: list[Light] = []
        self._meshes = WorldMeshes()
        self._packages, self._access = PackagePath(tuple(packages)), access
        self._includes = self._parts = 0
        self._open: list[Path] = []
        self._floor = 1.0
        self._missing: dict[str, str] | None = None
        """By URI, files that a world lacks and is read without, as in Gazebo; None if a missing file is an error."""

    def world(self, root: SdfElement, path: Path) -> WorldDescription:
        self._open.append(path.resolve())
        self._missing = {}
        worlds = [each for each in root.children if each.tag == "world"]
        if len(worlds) > 1:
            self._note(worlds[1], "a file's second world is left out")
        top = worlds[0] if worlds else root
        frames, saved = _Frames(self, top), _saved_poses(top)
        bodies: list[WorldBody] = []
        for each in top.children:
            child = _with_saved_pose(each, saved)
            if child.tag in ("model", "include") and self._is_out_of_reach(child):
                continue
            match child.tag:
                case "model":
                    bodies += self.model(child, frames.base_of(child), "", 0)
                case "include":
                    bodies += self._include(child, frames.base_of(child), 0)
                case "light":
                    self.lights.append(self._light(child))
                case "actor":
                    self._note(child, "an actor is left out; a body with a path moves by itself")
                case _:
                    self._unknown(child)
        if not worlds and not bodies:
            raise BadWorld(f"{path}:{root.line}: there is neither a world nor a model in this SDF")
        return WorldDescription(
            about=top.attributes.get("name", ""),
            start=Start(),
            friction=self._floor,
            bodies=_with_own_names(tuple(bodies)),
            lights=tuple(self.lights),
            notes=(*self.notes.values(), *self._missing.values()),
            missing=tuple(self._missing.values()),
        )

    def model(
        self, element: SdfElement, above: Pose3, name: str, depth: int, static: bool | None = None
    ) -> Iterator[WorldBody]:
        """Yield the bodies of a model; ``above`` is the frame of its pose, ``name`` replaces its own."""
        if depth > MAX_NESTING:
            self._fail(element, f"models lie more than {MAX_NESTING} deep in each other")
        name = name or element.attributes.get("name", "model")
        frames = _Frames(self, element)
        pose = above @ frames.own_pose
        stands = self._flag(element, "static", False) if static is None else static
        static_inside = True if stands else None
        links: list[SdfLink] = []
        for child in element.children:
            match child.tag:
                case "link":
                    links.append(self._link(child, frames.pose_of(child), stands))
                case "model":
                    inner = f"{name}::{child.attributes.get('name', 'model')}"
                    yield from self.model(child, pose @ frames.base_of(child), inner, depth + 1, static_inside)
                case "include":
                    yield from self._include(child, pose @ frames.base_of(child), depth + 1, f"{name}::", static_inside)
                case "joint" | "static" | "pose" | "frame":
                    pass
                case _:
                    self._unknown(child)
        yield from self._bodies(element, name, pose, links, stands)

    def whole_model(self, element: SdfElement, axes_of_model: bool) -> SdfModel:
        """Return a model with its joints, whose axes are by default in the frame of the model or in their own."""
        frames = _Frames(self, element)
        stands = self._flag(element, "static", False)
        links: list[SdfLink] = []
        joints: list[SdfJoint] = []
        tags: list[tuple[str, SdfElement]] = []
        inner = [each for each in element.children if each.tag in ("model", "include")]
        for child in element.children:
            if child.tag == "link":
                made = self._link(child, frames.pose_of(child), stands)
                links.append(made)
                tags += [(made.name, each) for each in child.children if each.tag in ("sensor", "plugin")]
            elif child.tag == "joint":
                joints.append(self._joint(child, frames, axes_of_model))
            elif child.tag == "plugin":
                tags.append(("", child))
        for child in inner:
            links += self._inner_links(child, frames.base_of(child), stands)
        return SdfModel(
            name=element.attributes.get("name", "model"),
            static=stands,
            links=tuple(links),
            joints=tuple(joints),
            tags=tuple(tags),
            notes=tuple(self.notes.values()),
        )

    def _inner_links(self, element: SdfElement, base: Pose3, stands: bool) -> Iterator[SdfLink]:
        """Yield the bodies of a nested model as links of the outer one; its pose is relative to ``base``."""
        static = True if stands else None
        if element.tag == "include":
            bodies = self._include(element, base, 1, "", static)
        else:
            bodies = self.model(element, base, "", 1, static)
        for body in bodies:
            yield SdfLink(
                body.name.replace("::", "_"),
                body.pose,
                body.parts,
                body.mass or 1.0,
                body.centre,
                body.moments,
                body.friction,
            )

    def _joint(self, element: SdfElement, frames: _Frames, axis_of_model: bool) -> SdfJoint:
        kind = element.attributes.get("type", "fixed")
        parent, child = ("" if (each := element.find(tag)) is None else each.text for tag in ("parent", "child"))
        if not child or not parent:
            self._fail(element, "a joint needs its <parent> and its <child>")
        axis = element.find("axis")
        limit, dynamics = (None if axis is None else axis.find(tag) for tag in ("limit", "dynamics"))

        def number(owner: SdfElement | None, tag: str, default: float) -> float:
            return default if owner is None else self._number(owner, tag, default, most=1e300)

        pose = frames.joint_pose(element, child)
        return SdfJoint(
            name=element.attributes.get("name", f"{parent}_{child}"),
            kind=kind,
            parent=parent,
            child=child,
            pose=pose,
            axis=(0.0, 0.0, 1.0) if axis is None else self._axis(axis, frames, pose, axis_of_model),
            lower=number(limit, "lower", -1e16),
            upper=number(limit, "upper", 1e16),
            effort=number(limit, "effort", -1.0),
            velocity=number(limit, "velocity", -1.0),
            damping=number(dynamics, "damping", 0.0),
            friction=number(dynamics, "friction", 0.0),
        )

    def _axis(self, axis: SdfElement, frames: _Frames, pose: Pose3, of_model: bool) -> Vector:
        """Return the direction of an axis in the frame of its joint, whose pose in the model is given.

        ``of_model`` says whether a direction is in the frame of the model if it states no frame.
        """
        direction, stated = self._vector(axis, "xyz", (0.0, 0.0, 1.0)), axis.find("xyz")
        if stated is None or not stated.text:
            return direction
        if frame := stated.attributes.get("expressed_in"):
            return rotate_inverse(pose.orientation, rotate(frames.frame_pose(frame, stated).orientation, direction))
        if self._flag(axis, "use_parent_model_frame", of_model):
            return rotate_inverse(pose.orientation, direction)
        return direction

    def _bodies(
        self, element: SdfElement, name: str, pose: Pose3, links: list[SdfLink], stands: bool
    ) -> Iterator[WorldBody]:
        links = [link for link in links if link.parts]
        joints = [each for each in element.children if each.tag == "joint"]
        jointed = [each for each in joints if each.attributes.get("type") != "fixed"]
        if jointed and not stands:
            self._note(jointed[0], f"the model {name!r} has movable joints: it is simulated as one fixed body")
        ends = [end for each in joints for end in (each.find("parent"), each.find("child"))]
        if stands or jointed or any(end is not None and end.text == "world" for end in ends):
            parts = tuple(replace(part, pose=link.pose @ part.pose) for link in links for part in link.parts)
            if parts:
                yield WorldBody(name, parts, pose, friction=links[0].friction)
            return
        if joints:
            links = [_merged(links)] if links else []
        for link in links:
            own = name if len(links) == 1 else f"{name}::{link.name}"
            parts = tuple(replace(part, ground=False) for part in link.parts)
            if not any(part.solid for part in parts):
                yield WorldBody(own, parts, pose @ link.pose)
                continue
            yield WorldBody(
                own, parts, pose @ link.pose, link.mass, link.friction, centre=link.centre, moments=link.moments
            )

    def _link(self, element: SdfElement, pose: Pose3, stands: bool) -> SdfLink:
        frames = _Frames(self, element)
        solid, shown, friction = [], [], 0.5
        for child in element.children:
            if child.tag == "collision":
                friction = self._friction(child, friction)
                solid += self._parts_of(child, frames.pose_of(child), stands)
            elif child.tag == "visual":
                shown += self._parts_of(child, frames.pose_of(child), stands)
            elif child.tag not in ("inertial", "gravity"):
                self._unknown(child)
        parts = _united(solid, shown)
        inertial = element.find("inertial")
        mass, centre, moments = 1.0, None, None
        if inertial is not None:
            mass = self._mass(inertial)
            if inertial.find("pose") is not None:
                centre = self._pose(inertial.find("pose")).position
            tensor = inertial.find("inertia")
            if tensor is not None:
                moments = self._moments(tensor)
        return SdfLink(element.attributes.get("name", "link"), pose, parts, mass, centre, moments, friction)

    def _parts_of(self, element: SdfElement, pose: Pose3, stands: bool) -> list[BodyPart]:
        geometry = element.find("geometry")
        if geometry is None:
            self._note(element, "it has no <geometry>, and is left out")
            return []
        kind = next((each for each in geometry.children), None)
        if kind is None or kind.tag == "empty":
            return []
        solid = element.tag == "collision"
        if kind.tag == "plane":
            return self._plane(kind, pose, solid)
        try:
            shape = self._shape(kind)
        except FileMissing as error:
            self._miss(element, error)
            return []
        except BadWorld as error:
            uri = kind.find("uri")
            if uri is not None and uri.text.startswith(("http://", "https://")):
                self._note(uri, f"{uri.text} is on the Internet and left out: download it", key=uri.text)
            elif solid or kind.tag != "mesh":
                raise
            else:
                self._note(kind, f"this visual is left out: {error}", key=str(error))
            return []
        if shape is None:
            return []
        self._parts += 1
        if self._parts > 4 * MAX_PARTS:
            self._fail(element, f"the world has more than {4 * MAX_PARTS:,} shapes")
        if kind.tag == "heightmap":
            x, y, z = self._vector(kind, "pos", (0.0, 0.0, 0.0))
            pose = pose @ Pose3((x, y, z))
        part = BodyPart(shape, pose, self._colour(element), solid=solid, visible=not solid)
        return [replace(part, ground=stands and solid and _is_floor(part))]

    def _shape(self, kind: SdfElement) -> Shape | None:
        match kind.tag:
            case "box":
                return BoxShape(self._size(kind, "size"))
            case "cylinder":
                return CylinderShape(self._length(kind, "radius"), self._length(kind, "length"))
            case "sphere":
                return SphereShape(self._length(kind, "radius"))
            case "capsule":
                radius = self._length(kind, "radius")
                self._note(kind, "a capsule is replaced by a cylinder of the same total length")
                return CylinderShape(radius, self._length(kind, "length") + 2 * radius)
            case "ellipsoid":
                x, y, z = self._size(kind, "radii")
                ball = shape_mesh(SphereShape(1.0))
                return MeshShape(ball.scaled(x, y, z), convex=True)
            case "mesh":
                return self._mesh(kind)
            case "heightmap":
                return self._heightmap(kind)
            case "polyline":
                return self._polyline(kind)
        known = ", ".join(_SHAPES)
        if kind.tag not in ("cone", "image"):
            self._fail(kind, f"unknown shape <{kind.tag}> (known: {known})")
        self._note(kind, f"the shape is left out (known: {known})")
        return None

    def _mesh(self, kind: SdfElement) -> Shape | None:
        x, y, z = self._vector(kind, "scale", (1.0, 1.0, 1.0))
        if 0 in (x, y, z):
            self._note(kind, "a mesh that is scaled by 0 is left out")
            return None
        if (part := kind.find("submesh")) is not None:
            self._note(part, "the submesh is ignored: the complete mesh is used")
        file = self._file(kind)
        try:
            return self._meshes.mesh(file, (x, y, z))
        except BadInput as error:
            self._fail(kind, str(error))

    def _heightmap(self, kind: SdfElement) -> Shape:
        x, y, z = self._vector(kind, "size", (1.0, 1.0, 1.0))
        if min(x, y, z) <= 0:
            self._fail(kind, "a height map's size is positive")
        file = self._file(kind)
        try:
            return self._meshes.height_map(file, (0.0, z), (x, y))
        except BadInput as error:
            self._fail(kind, str(error))

    def _polyline(self, kind: SdfElement) -> Shape:
        height = self._length(kind, "height")
        points = []
        for each in kind.children:
            if each.tag == "point":
                numbers = self._numbers(each, 2)
                points.append((numbers[0], numbers[1]))
        try:
            return MeshShape(extruded(points, height))
        except BadInput as error:
            self._fail(kind, str(error))

    def _plane(self, kind: SdfElement, pose: Pose3, solid: bool) -> list[BodyPart]:
        """Return no parts for the ground, a level plane at z = 0; for any other plane, a box below its surface."""
        x, y, z = self._vector(kind, "normal", (0.0, 0.0, 1.0))
        level = z > 0.999 * math.hypot(x, y, z) and abs(pose.position[2]) < 1e-3
        if level or not solid:
            return []
        width, length = self._numbers(kind.find("size"), 2) if kind.find("size") is not None else (1.0, 1.0)
        if min(width, length) <= 0:
            self._fail(kind, "the size of a plane is positive")
        tilt = Pose3(orientation=_turn_to(x, y, z))
        box = BoxShape((width, length, PLANE_THICKNESS))
        return [BodyPart(box, pose @ tilt @ Pose3((0.0, 0.0, -PLANE_THICKNESS / 2)), GREY, ground=True)]

    def _include(
        self, element: SdfElement, above: Pose3, depth: int, prefix: str = "", static: bool | None = None
    ) -> Iterator[WorldBody]:
        self._includes += 1
        if self._includes > MAX_INCLUDES:
            self._fail(element, f"the world has more than {MAX_INCLUDES} includes")
        uri = element.find("uri")
        if uri is None or not uri.text:
            self._fail(element, "<include> has no <uri>")
        if (built_in := re.sub(r"[^a-z]", "", uri.text.rpartition("/")[2].lower())) in ("groundplane", "sun"):
            # This simulation has both anyway, as Gazebo does.
            if built_in == "sun":
                self.lights.append(Light("sun"))
            return
        try:
            file = find_model_file(uri.text, element.file, self._packages, self._access)
        except FileMissing as error:
            if self._missing is None:
                self._fail(uri, str(error))
            self._miss(uri, error)
            return
        except BadInput as error:
            self._fail(uri, str(error))
        if file is None:
            self._note(uri, f"{uri.text} is on the Internet and left out: download it", key=uri.text)
            return
        if file in self._open:
            self._fail(uri, f"{uri.text} includes itself")
        if len(self._open) > MAX_NESTING:
            self._fail(uri, f"files include each other more than {MAX_NESTING} deep")
        self._open.append(file)
        root = read_sdf(file)
        models = [each for each in root.children if each.tag == "model"]
        light = next((each for each in root.children if each.tag == "light"), None)
        if not models and light is None:
            self._fail(uri, f"{file} has no model")
        name = element.find("name")
        if element.find("static") is not None:
            static = self._flag(element, "static", False)
        for model in models[:1]:
            own = prefix + (name.text if name is not None and name.text else model.attributes.get("name", "model"))
            pose = above
            if (stated := element.find("pose")) is not None:
                # It replaces the model's own pose.
                pose = above @ self._pose(stated) @ _Frames(self, model).own_pose.inverse()
            yield from self.model(model, pose, own, depth, static)
        self._open.pop()

    def _light(self, element: SdfElement) -> Light:
        x, y, z = self._vector(element, "direction", (-0.5, 0.1, -0.9))
        if not any((x, y, z)):
            x, y, z = 0.0, 0.0, -1.0
        diffuse = element.find("diffuse")
        r, g, b, _ = self._rgba(diffuse) if diffuse is not None else (1.0, 1.0, 1.0, 1.0)
        return Light(element.attributes.get("name", ""), (x, y, z), (r, g, b))

    def _mass(self, inertial: SdfElement) -> float:
        """Return the mass [kg]; 0, as in some static models, counts as not stated, since Gazebo tolerates it."""
        mass = self._number(inertial, "mass", 1.0, most=1e9)
        if mass > 0:
            return max(LEAST_MASS, mass)
        self._note(inertial, f"a mass of {mass:g} kg is replaced by 1 kg")
        return 1.0

    def _moments(self, tensor: SdfElement) -> Vector | None:
        """Return the moments [kg m2]; None if not usable, since Gazebo's editor writes nan beside a mass of 0."""
        stated = [tensor.find(each) for each in ("ixx", "iyy", "izz")]
        if any(each is None or each.text.lstrip("-").lower() == "nan" for each in stated):
            return None
        x, y, z = (self._number(tensor, each, 0.0, most=1e12) for each in ("ixx", "iyy", "izz"))
        return (x, y, z) if min(x, y, z) > 1e-12 else None

    def _friction(self, element: SdfElement, default: float) -> float:
        ode = element.find("surface", "friction", "ode")
        if ode is None or ode.find("mu") is None:
            return default
        return min(10.0, abs(self._number(ode, "mu", default, most=1e9)))

    def _colour(self, element: SdfElement) -> Colour:
        material = element.find("material")
        for tag in ("diffuse", "ambient"):
            if material is not None and (stated := material.find(tag)) is not None:
                return self._rgba(stated)
        script = element.find("material", "script", "name")
        if script is not None:
            return _GAZEBO_COLOURS.get(script.text.removeprefix("Gazebo/"), GREY)
        return GREY

    def _rgba(self, element: SdfElement) -> Colour:
        try:
            r, g, b, *a = (min(1.0, max(0.0, float(each))) for each in element.text.split())
        except ValueError:
            self._fail(element, f"{element.text[:60]!r} is not a colour")
        opacity = a[0] if a else 1.0
        if not all(math.isfinite(each) for each in (r, g, b, opacity)):
            self._fail(element, f"{element.text[:60]!r} is not a colour")
        return r, g, b, opacity

    def _file(self, element: SdfElement) -> Path:
        uri = element.find("uri")
        if uri is None or not uri.text:
            self._fail(element, f"<{element.tag}> has no <uri>")
        try:
            return find_resource(uri.text, element.file, self._packages, self._access)
        except FileMissing as error:
            if self._missing is None:
                self._fail(uri, str(error))
            raise
        except BadInput as error:
            self._fail(uri, str(error))

    def _is_out_of_reach(self, element: SdfElement) -> bool:
        """Whether a model of a world is too far away to matter; it is then reported and left out.

        Worlds saved by Gazebo contain models that fell or flew away.
        """
        pose = element.find("pose")
        try:
            place = [float(each) for each in (pose.text if pose is not None else "").split()[:3]]
        except ValueError:
            return False
        if pose is None or not any(MAX_VALUE < abs(each) < math.inf for each in place):
            return False
        self._note(pose, f"a model farther away than {MAX_VALUE:g} m is left out: {pose.text[:60]}", key=pose.text)
        return True

    def _pose(self, element: SdfElement | None) -> Pose3:
        if element is None or not element.text:
            return IDENTITY
        rotation = element.attributes.get("rotation_format", "euler_rpy")
        if rotation == "quat_xyzw":
            x, y, z, *q = self._numbers(element, 7)
            length = math.hypot(*q)
            if length < 1e-6:
                self._fail(element, "the quaternion 0 0 0 0 is not a rotation")
            return Pose3((x, y, z), (q[0] / length, q[1] / length, q[2] / length, q[3] / length))
        x, y, z, *rpy = self._numbers(element, 6)
        if element.attributes.get("degrees") in ("true", "1"):
            rpy = [math.radians(each) for each in rpy]
        return Pose3((x, y, z), quaternion_from_rpy(*rpy))

    def _numbers(self, element: SdfElement | None, count: int) -> list[float]:
        assert element is not None
        try:
            values = [float(each) for each in element.text.split()]
        except ValueError:
            values = []
        if len(values) != count or not all(abs(each) <= MAX_VALUE for each in values):
            self._fail(element, f"<{element.tag}> {element.text[:60]!r}: expected {count} numbers up to {MAX_VALUE:g}")
        return values

    def _vector(self, element: SdfElement, tag: str, default: Vector) -> Vector:
        found = element.find(tag)
        if found is None or not found.text:
            return default
        x, y, z = self._numbers(found, 3)
        return x, y, z

    def _size(self, element: SdfElement, tag: str) -> Vector:
        size = self._vector(element, tag, (1.0, 1.0, 1.0))
        if min(size) <= 0:
            self._fail(element, f"<{tag}> {size[0]:g} {size[1]:g} {size[2]:g} of a {element.tag} is not positive")
        x, y, z = (max(each, LEAST_EXTENT) for each in size)
        return x, y, z

    def _length(self, element: SdfElement, tag: str) -> float:
        return max(LEAST_EXTENT, self._number(element, tag, 1.0, positive=True, most=MAX_VALUE))

    def _number(
        self, element: SdfElement, tag: str, default: float, positive: bool = False, most: float = 1e6
    ) -> float:
        found = element.find(tag)
        if found is None:
            return default
        try:
            value = float(found.text)
        except ValueError:
            value = math.nan
        if not abs(value) <= most:
            self._fail(found, f"<{tag}> {found.text[:60]!r} of <{element.tag}> is not a number up to {most:g}")
        if positive and value <= 0:
            self._fail(found, f"<{tag}> {found.text[:60]!r} of <{element.tag}> is not positive")
        return value

    def _flag(self, element: SdfElement, tag: str, default: bool) -> bool:
        found = element.find(tag)
        return default if found is None else found.text.strip().lower() in ("1", "true")

    def _unknown(self, element: SdfElement) -> None:
        if element.tag not in _SILENT.split():
            self._note(element, "it is not understood, and ignored")
        elif element.tag in ("plugin", "sensor", "road", "population"):
            self._note(element, "it is left out")

    def _note(self, element: SdfElement, text: str, key: str = "") -> None:
        self.notes.setdefault(key or element.tag + text, f"{element.file}:{element.line}: <{element.tag}>: {text}")

    def _miss(self, element: SdfElement, error: FileMissing) -> None:
        assert self._missing is not None
        self._missing.setdefault(str(error), f"{element.file}:{element.line}: left out: {error}")

    def _fail(self, element: SdfElement, text: str) -> NoReturn:
        raise BadWorld(f"{element.file}:{element.line}: {text}")


class _Frames:
    """The frames inside a world, model or link: poses may be ``relative_to`` another of its elements, by name."""

    def __init__(self, reader: _Reader, owner: SdfElement) -> None:
        self._reader, self._kind = reader, owner.tag
        self._named = {
            each.attributes["name"]: each
            for each in owner.children
            if each.tag in ("link", "frame", "model", "joint", "collision", "visual") and "name" in each.attributes
        }
        self.own_pose = reader._pose(owner.find("pose"))
        self._seen: list[str] = []

    def pose_of(self, element: SdfElement) -> Pose3:
        """Return the pose of an element in the frame of its owner."""
        return self.base_of(element) @ self._reader._pose(element.find("pose"))

    def base_of(self, element: SdfElement) -> Pose3:
        """Return the pose, in the frame of its owner, of the frame that the pose of an element is relative to."""
        stated = element.find("pose")
        base = stated.attributes.get("relative_to") or stated.attributes.get("frame") if stated is not None else None
        base = base or element.attributes.get("attached_to")
        if not base or base in ("__model__", "__root__", "world"):
            return IDENTITY
        if base not in self._named:
            where, kind = element if stated is None else stated, self._kind
            self._reader._note(where, f"there is no frame {base!r} in this {kind}: the pose is in the {kind}'s frame")
            return IDENTITY
        if base in self._seen:
            self._reader._fail(element, f"the poses of {', '.join(self._seen)} are relative to each other")
        if len(self._seen) >= MAX_CHAIN:
            self._reader._fail(element, f"more than {MAX_CHAIN} poses are relative to one another")
        self._seen.append(base)
        under = self.pose_of(self._named[base])
        self._seen.pop()
        return under

    def frame_pose(self, name: str, where: SdfElement) -> Pose3:
        """Return the pose of a frame in the frame of its owner; an unknown one, used at ``where``, is noted."""
        if name in ("__model__", "world"):
            return IDENTITY
        found = self._named.get(name)
        if found is None:
            self._reader._note(where, f"there is no frame {name!r} in this {self._kind}: the {self._kind}'s is used")
            return IDENTITY
        child = found.find("child") if found.tag == "joint" else None
        return self.pose_of(found) if child is None else self.joint_pose(found, child.text)

    def joint_pose(self, joint: SdfElement, child: str) -> Pose3:
        """Return the pose of a joint in the frame of its owner; by default it is stated in the frame of its child."""
        stated = joint.find("pose")
        if stated is not None and (stated.attributes.get("relative_to") or stated.attributes.get("frame")):
            return self.pose_of(joint)
        under = self.pose_of(self._named[child]) if child in self._named else IDENTITY
        return under @ self._reader._pose(stated)


def _united(solid: list[BodyPart], shown: list[BodyPart]) -> tuple[BodyPart, ...]:
    """Merge colliding and visible parts: those with the same shape and pose become one part."""
    parts = []
    left: dict[Pose3, list[BodyPart]] = {}
    for part in shown:
        left.setdefault(part.pose, []).append(part)
    for part in solid:
        beside = left.get(part.pose, [])
        for index, same in enumerate(beside):
            if _same_shape(same.shape, part.shape):
                part = replace(part, colour=same.colour, visible=True)
                del beside[index]
                break
        parts.append(part)
    shown = [part for beside in left.values() for part in beside]
    if not shown:
        # Without visuals, collision shapes are displayed, so that no invisible part stops a robot.
        parts = [replace(part, visible=True) for part in parts]
    return (*parts, *shown)


def _same_shape(one: Shape, other: Shape) -> bool:
    if isinstance(one, MeshShape) and isinstance(other, MeshShape):
        return one.file is not None and (one.file, one.scale) == (other.file, other.scale)
    if type(one) is type(other) and isinstance(one, BoxShape | CylinderShape | SphereShape):
        return one == other
    return isinstance(one, HeightMapShape) and isinstance(other, HeightMapShape)


def _merged(links: list[SdfLink]) -> SdfLink:
    """Merge links connected by fixed joints into one, in the frame of the first."""
    first = links[0]
    back = first.pose.inverse()
    parts = [replace(part, pose=back @ link.pose @ part.pose) for link in links for part in link.parts]
    return SdfLink(first.name, first.pose, tuple(parts), sum(link.mass for link in links), None, None, first.friction)


def _is_floor(part: BodyPart) -> bool:
    """Whether wheels roll on a fixed part: a height map, or a large and flat part."""
    if isinstance(part.shape, HeightMapShape):
        return True
    low, high = shape_mesh(part.shape).bounds
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    turned = np.array([(part.pose @ Pose3((x, y, z))).position for x, y, z in corners.tolist()])
    size = turned.max(axis=0) - turned.min(axis=0)
    return bool(min(size[:2]) > FLOOR_EXTENT and size[2] < FLOOR_HEIGHT)


def _turn_to(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the rotation from the z axis to a direction, about the axis perpendicular to both."""
    length = math.hypot(x, y, z)
    x, y, z = x / length, y / length, z / length
    if z < -0.999999:
        return 1.0, 0.0, 0.0, 0.0
    w = math.sqrt((1 + z) / 2)
    return -y / (2 * w), x / (2 * w), 0.0, w


def _with_own_names(bodies: tuple[WorldBody, ...]) -> tuple[WorldBody, ...]:
    """Return the bodies with duplicate names numbered, as Gazebo renames models."""
    taken, counts = {GROUND_NAME}, dict[str, int]()
    named = []
    for body in bodies:
        name = body.name
        while name in taken:
            number = counts.get(body.name, 0)
            name, counts[body.name] = f"{body.name}_{number}", number + 1
        taken.add(name)
        named.append(body if name == body.name else replace(body, name=name))
    return tuple(named)


_GAZEBO_COLOURS: dict[str, Colour] = {
    "Grey": (0.7, 0.7, 0.7, 1.0),
    "Gray": (0.7, 0.7, 0.7, 1.0),
    "DarkGrey": (0.175, 0.175, 0.175, 1.0),
    "White": (1.0, 1.0, 1.0, 1.0),
    "Black": (0.05, 0.05, 0.05, 1.0),
    "FlatBlack": (0.1, 0.1, 0.1, 1.0),
    "Red": (1.0, 0.0, 0.0, 1.0),
    "Green": (0.0, 1.0, 0.0, 1.0),
    "Blue": (0.0, 0.0, 1.0, 1.0),
    "Yellow": (1.0, 1.0, 0.0, 1.0),
    "Orange": (1.0, 0.51, 0.09, 1.0),
    "Purple": (1.0, 0.0, 1.0, 1.0),
    "Turquoise": (0.0, 1.0, 1.0, 1.0),
    "Wood": (0.55, 0.40, 0.24, 1.0),
    "Bricks": (0.6, 0.3, 0.25, 1.0),
    "Grass": (0.25, 0.45, 0.20, 1.0),
}
