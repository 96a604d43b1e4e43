"""The model of a world with its robots, as compiled by MuJoCo: everything in a fixed order, with the engine's settings.

Each setting is there for a measured reason, given beside it; ``docs/engines.md`` compares the engines.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from messages.se3 import IDENTITY, Pose3, Vector
from models.bodies import (
    GREY,
    BodyPart,
    BoxShape,
    CylinderShape,
    HeightMapShape,
    Light,
    MeshShape,
    RampShape,
    SphereShape,
)
from models.mass_properties import mass_properties
from models.mesh import Mesh, hull_points
from models.shape_mesh import ramp_mesh
from models.shapes import Shape
from models.world import WorldBody, WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_pieces import convex_pieces
from services.sim.physics.mujoco_robot import Part, RobotTree
from services.sim.physics.world import GRAVITY

Floats = NDArray[np.float64]
Filter = tuple[int, int]
"""Bits of what a shape is, and of what it collides with; in MuJoCo two shapes collide if either matches the other."""

_BODY_BIT, _ROLLER_BIT, _GROUND_BIT, _FIXED_BIT, _PATH_BIT = 1, 2, 4, 8, 16
BODY: Filter = (_BODY_BIT, _BODY_BIT | _GROUND_BIT | _FIXED_BIT)
ROLLER: Filter = (_ROLLER_BIT, _GROUND_BIT)
"""Rolling parts touch only the ground, because a sphere is wider than the wheel it stands for."""
FIXED: Filter = (_FIXED_BIT, _BODY_BIT)
GROUND: Filter = (_GROUND_BIT, _BODY_BIT | _ROLLER_BIT)
MOVABLE_GROUND: Filter = (_BODY_BIT | _GROUND_BIT, _BODY_BIT | _ROLLER_BIT | _GROUND_BIT)
ON_PATH: Filter = (_PATH_BIT, _BODY_BIT)
"""A body that follows a path passes through fixed ones."""
NOTHING: Filter = (0, 0)

SEEN, UNSEEN, GROUNDS = 0, 2, 4
"""Groups of shapes: hit by rays, ignored by rays, and hit by rays and driven on."""

SEEN_GROUPS = np.array([number in (SEEN, GROUNDS) for number in range(6)], np.uint8)
"""The groups that rays hit."""

STIFF = (0.01, 1.0)
"""Time constant [s], twice a step of 5 ms and the smallest that is stable, and damping: the error of a contact, stop or
motor is corrected within one step."""
BUMPER = (0.02, 1.0)
"""The same for contacts between bodies, which are slightly compliant."""
CONTACT_IMPEDANCE = (0.999, 0.999, 0.001, 0.5, 2.0)
"""With 0.99, wheels sink in by 35 um, and a robot drives 0.053 % short; with this it is 0.006 %."""
CONTACT_MARGIN = 0.001
"""m; contacts are detected from this distance on, so that they exist in the step in which they begin: without it, a
body standing on three points rocks on them."""
JOINT_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The hardest possible: with it the tutorial's arm stays at a stop within 0.001 degrees under 1,000 N m."""
MIN_RANGE = 1e-6
"""rad or m, minimum distance between the stops of a joint."""
GROUND_COLOUR = (0.8, 0.8, 0.8, 1.0)
THINNEST, THICKNESS = 1e-5, 1e-3
"""m; a shape thinner than the first gets the second as its thickness, since a hull needs a volume."""
PATH_MASS = 1e4
"""kg, mass of a body that follows a path: everything it meets gives way."""
TYPICAL_INERTIA = 0.1
"""Scale of the solver's tolerance; computed from the masses, a body on a path would make it useless."""


@dataclass(frozen=True)
class PlacedRobot:
    """A robot to add to the scene: its name and parts, the pose of its root, whether that is fixed, and the links that
    slide, each along an axis of its frame."""

    name: str
    tree: RobotTree
    pose: Pose3
    fixed: bool
    slides: tuple[tuple[str, Vector], ...] = ()


@dataclass
class Scene:
    """The compiled model and, for each of its shapes, the index of its owner in ``owners``, its friction, whether it is
    ground to stand on, and its sliding axis (zero if none), shape (n, 3). The ground plane's owner is -1."""

    model: mujoco.MjModel
    owners: tuple[str, ...]
    owner: NDArray[np.int32]
    friction: NDArray[np.float64]
    ground: NDArray[np.bool_]
    slide: NDArray[np.float64]
    slides: bool


@dataclass
class _Shapes:
    """Data of the shapes, in the order of the model."""

    owner: list[int] = field(default_factory=list)
    friction: list[float] = field(default_factory=list)
    ground: list[bool] = field(default_factory=list)
    slide: list[Vector] = field(default_factory=list)


def movable_bodies(world: WorldDescription) -> list[WorldBody]:
    """Return the bodies of a world that are not fixed, in the order in which a scene has them before the robots."""
    return [body for body in world.bodies if body.kind != "fixed"]


def build_scene(
    world: WorldDescription, robots: Sequence[PlacedRobot], step: float, bodies: Iterable[WorldBody] | None = None
) -> Scene:
    """Compile a world with robots in it.

    The positions and velocities of movable bodies come first (7 and 6 numbers each, 3 and 3 for one on a path), then
    those of the robots: the root's (7 and 6) unless it is fixed, then one for each joint in the order of the parts.

    Args:
        world: Its ground, and its bodies unless ``bodies`` is given.
        robots: The robots to add.
        step: Simulation time of one step, s.
        bodies: The bodies of the world to add; all if None.
    """
    builder = SceneBuilder(world, step)
    for body in world.all_bodies if bodies is None else bodies:
        builder.add_body(body)
    for robot in robots:
        builder.add_robot(robot)
    return builder.compile()


class SceneBuilder:
    """Builds a world from collision shapes or, for a ``picture`` of that many pixels, from visual shapes."""

    def __init__(self, world: WorldDescription, step: float, picture: tuple[int, int] | None = None) -> None:
        self._spec = spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        spec.compiler.balanceinertia = True
        spec.compiler.alignfree = False
        spec.compiler.autolimits = False
        option = spec.option
        option.timestep = step
        option.gravity = (0.0, 0.0, -GRAVITY)
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # stable with any damping of joints
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # friction without a preferred direction
        option.impratio = 10.0
        # Each island of touching bodies is solved on its own, in as many iterations as it takes: 100 driving burgers
        # need a third of the time of solving them as one, for which 30 iterations are too few even at 9.
        option.iterations = 200
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self._shapes, self._meshes = _Shapes(), 0
        self._owners: list[str] = []
        self._known_meshes: dict[int, str] = {}
        self._kept: list[Mesh] = []
        """Kept alive so that no other mesh gets the id of one in ``_known_meshes``."""
        self._looks = picture is not None
        if picture is not None:
            self._set_looks(world, picture)
        ground = self._spec.worldbody, -1, "plane", (0.0, 0.0, 1.0), IDENTITY, GROUND, world.friction, True
        self._add(*ground, colour=GROUND_COLOUR)

    def compile(self) -> Scene:
        """Compile the model; raises BadInput if MuJoCo refuses it."""
        try:
            model = self._spec.compile()
        except ValueError as error:
            raise BadInput(f"MuJoCo cannot compile the world: {error}") from error
        model.stat.meaninertia = TYPICAL_INERTIA
        found = self._shapes
        slide = np.array(found.slide, np.float64).reshape(-1, 3)
        return Scene(
            model=model,
            owners=tuple(self._owners),
            owner=np.array(found.owner, np.int32),
            friction=np.array(found.friction, np.float64),
            ground=np.array(found.ground, np.bool_),
            slide=slide,
            slides=bool(slide.any()),
        )

    def add_body(self, body: WorldBody) -> None:
        """Add a body of the world."""
        owner = self._owner(body.name)
        added = self._spec.worldbody.add_body(
            name=f"w{owner}", pos=body.pose.position, quat=wxyz(body.pose.orientation)
        )
        if body.kind == "movable":
            properties = mass_properties(body)
            self._set_inertia(added, body.mass, Pose3(properties.centre), properties.moments)
            added.add_freejoint()
        elif body.kind == "moving":
            self._set_inertia(added, PATH_MASS, IDENTITY, (PATH_MASS,) * 3)
            added.gravcomp = 1.0
            for axis in (0, 1, 2):
                along = [float(axis == each) for each in range(3)]
                # In the world's axes, whatever the body's orientation.
                added.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=_in_frame(body.pose, along))
        for part in body.parts:
            if part.visible if self._looks else part.solid:
                self._add_part(added, owner, body, part)

    def add_robot(self, robot: PlacedRobot) -> None:
        """Add a robot."""
        owner = self._owner(robot.name)
        slides = dict(robot.slides)
        bodies: list[mujoco.MjsBody] = []
        solid: list[str] = []
        for number, part in enumerate(robot.tree.parts):
            name = f"r{owner}.{number}"
            if part.joint is None:
                body = self._spec.worldbody.add_body(
                    name=name, pos=robot.pose.position, quat=wxyz(robot.pose.orientation)
                )
                if robot.fixed:
                    body.mocap = True
                else:
                    body.add_freejoint()
            else:
                body = bodies[part.parent].add_body(name=name, pos=part.pose.position, quat=wxyz(part.pose.orientation))
                self._add_joint(body, part)
            bodies.append(body)
            self._set_inertia(body, part.mass, part.centre, part.moments)
            for each in part.visuals if self._looks else part.collisions:
                if not each.rolls and name not in solid:
                    solid.append(name)
                along = slides.get(each.link)
                turn = Pose3((0.0, 0.0, 0.0), robot.tree.links[each.link][1].orientation)
                axis = (0.0, 0.0, 0.0) if along is None else (turn @ Pose3(along)).position
                self._add_shape(body, owner, each.shape, each.pose, ROLLER if each.rolls else BODY, each.friction, axis)
        for index, one in enumerate(() if self._looks else solid):
            for other in solid[index + 1 :]:
                self._spec.add_exclude(bodyname1=one, bodyname2=other)

    def _set_looks(self, world: WorldDescription, picture: tuple[int, int]) -> None:
        """Set the light and the size of the image buffer."""
        visual = self._spec.visual
        visual.global_.offwidth, visual.global_.offheight = picture
        visual.headlight.ambient, visual.headlight.diffuse = (0.5,) * 3, (0.0,) * 3
        visual.headlight.specular = (0.0,) * 3
        for light in world.lights[:1] or (Light(direction=(-0.4, -0.3, -0.85)),):
            self._spec.worldbody.add_light(
                type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
                dir=light.direction,
                diffuse=[0.6 * each for each in light.colour],
                specular=(0.0,) * 3,
                castshadow=False,
            )

    def _owner(self, name: str) -> int:
        self._owners.append(name)
        return len(self._owners) - 1

    def _set_inertia(self, body: mujoco.MjsBody, mass: float, centre: Pose3, moments: Sequence[float]) -> None:
        body.mass, body.ipos, body.iquat = mass, centre.position, wxyz(centre.orientation)
        body.inertia, body.explicitinertial = moments, True

    def _add_joint(self, body: mujoco.MjsBody, part: Part) -> None:
        joint = part.joint
        assert joint is not None
        limits = joint.limits
        bounds = None
        if joint.kind != "continuous" and limits.lower is not None and limits.upper is not None:
            bounds = limits.lower, max(limits.upper, limits.lower + MIN_RANGE)
        limited = bounds is not None and (limits.upper or 0.0) >= (limits.lower or 0.0)
        slides = joint.kind == "prismatic"
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.axis,
            limited=limited,
            range=bounds if limited else (0.0, 0.0),
            solref_limit=STIFF,
            solimp_limit=JOINT_IMPEDANCE,
            solref_friction=STIFF,
            solimp_friction=JOINT_IMPEDANCE,
        )

    def _add_part(self, body: mujoco.MjsBody, owner: int, of: WorldBody, part: BodyPart) -> None:
        """Add a part of a body of the world."""
        touches = {
            "fixed": GROUND if part.ground else FIXED,
            "movable": MOVABLE_GROUND if part.ground else BODY,
            "moving": GROUND if part.ground else ON_PATH,
        }[of.kind]
        group = GROUNDS if part.ground else SEEN

        def add(kind: str, size: Sequence[float], pose: Pose3 = part.pose, mesh: str = "") -> None:
            about = touches, of.friction, part.ground, group
            self._add(body, owner, kind, size, pose, *about, asset=mesh, colour=part.colour)

        match part.shape:
            case BoxShape((x, y, z)):
                add("box", (x / 2, y / 2, z / 2))
            case CylinderShape(radius, length):
                add("cylinder", (radius, length / 2, 0.0))
            case SphereShape(radius):
                add("sphere", (radius, 0.0, 0.0))
            case RampShape():
                add("mesh", (), mesh=self._mesh(ramp_mesh(part.shape), whole=True))
            case HeightMapShape():
                name, lowest = self._height_field(part.shape)
                add("hfield", (), part.pose @ Pose3((0.0, 0.0, lowest)), name)
            case MeshShape(mesh) if self._looks:
                add("mesh", (), mesh=self._mesh(mesh, whole=True))
            case MeshShape(mesh) if part.shape.convex or of.kind != "fixed":
                add("mesh", (), mesh=self._mesh(mesh))
            case MeshShape(mesh):
                # Rays hit its triangles; it collides as convex pieces of them.
                name = self._mesh(mesh, whole=True)
                self._add(body, owner, "mesh", (), part.pose, NOTHING, of.friction, part.ground, group, name)
                for piece in convex_pieces(mesh):
                    piece_name = self._mesh(piece, whole=True)
                    self._add(body, owner, "mesh", (), part.pose, touches, of.friction, part.ground, UNSEEN, piece_name)
            case _:
                assert_never(part.shape)

    def _add_shape(
        self,
        body: mujoco.MjsBody,
        owner: int,
        shape: Shape,
        pose: Pose3,
        touches: Filter,
        friction: float,
        axis: Vector,
    ) -> None:
        """Add a shape of a robot."""
        size: Sequence[float] = ()
        name, size_of = "", shape.size
        match shape.kind:
            case "box":
                size = tuple(each / 2 for each in size_of)
            case "sphere":
                size = (size_of[0], 0.0, 0.0)
            case "cylinder" | "capsule":
                size = (size_of[0], size_of[1] / 2, 0.0)
            case "mesh":
                assert shape.mesh is not None
                name = self._mesh(shape.mesh, whole=self._looks)
        group = UNSEEN if touches == ROLLER else SEEN
        colour = shape.colour or GREY
        self._add(body, owner, shape.kind, size, pose, touches, friction, False, group, name, axis, colour)

    def _add(
        self,
        body: mujoco.MjsBody,
        owner: int,
        kind: str,
        size: Sequence[float],
        pose: Pose3,
        touches: Filter,
        friction: float,
        ground: bool = False,
        group: int = SEEN,
        asset: str = "",
        axis: Vector = (0.0, 0.0, 0.0),
        colour: Sequence[float] = GREY,
    ) -> None:
        on_ground = bool(touches[0] & _GROUND_BIT) or touches == ROLLER
        more = {"hfieldname": asset} if kind == "hfield" else {"meshname": asset} if asset else {"size": size}
        body.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}"),
            pos=pose.position,
            quat=wxyz(pose.orientation),
            contype=0 if self._looks else touches[0],
            conaffinity=0 if self._looks else touches[1],
            rgba=colour,
            group=group,
            solref=STIFF if on_ground else BUMPER,
            priority=1 if on_ground else 0,
            solimp=CONTACT_IMPEDANCE,
            margin=CONTACT_MARGIN,
            **more,
        )
        found = self._shapes
        found.owner.append(owner)
        found.friction.append(friction)
        found.ground.append(ground)
        found.slide.append(axis)

    def _mesh(self, mesh: Mesh, whole: bool = False) -> str:
        """Return the name of a mesh among the assets: with all triangles if ``whole``, else the corners of its hull."""
        if (name := self._known_meshes.get(id(mesh))) is not None:
            return name
        self._kept.append(mesh)
        name = self._known_meshes[id(mesh)] = f"m{len(self._known_meshes)}"
        corners = thickened(mesh.vertices if whole else hull_points(mesh))
        added = self._spec.add_mesh(name=name, uservert=corners.ravel())
        if whole and len(corners) == len(mesh.vertices):
            added.userface = mesh.triangles.ravel()
        added.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # allows open meshes; the inertia is not used
        return name

    def _height_field(self, shape: HeightMapShape) -> tuple[str, float]:
        name = f"h{self._meshes}"
        self._meshes += 1
        rows, columns = shape.heights.shape
        lowest, highest = float(shape.heights.min()), float(shape.heights.max())
        rise = max(highest - lowest, 1e-6)
        self._spec.add_hfield(
            name=name,
            nrow=rows,
            ncol=columns,
            size=(shape.size[0] / 2, shape.size[1] / 2, rise, 0.1),
            userdata=((shape.heights - lowest) / rise).ravel(),
        )
        return name, lowest


def thickened(vertices: Floats) -> Floats:
    """Return the points if they span a volume; otherwise with copies beside the plane or line that they are in."""
    around = np.unique(vertices, axis=0) - vertices.mean(axis=0)
    around = np.concatenate([around, np.zeros((max(0, 3 - len(around)), 3))])  # three axes, also for a line or a point
    _, extents, axes = np.linalg.svd(around, full_matrices=False)
    flat = [axis for axis, extent in zip(axes, extents, strict=True) if extent < THINNEST]
    for axis in flat:
        vertices = np.concatenate([vertices, vertices + THICKNESS * axis])
    return vertices


def wxyz(orientation: Sequence[float]) -> tuple[float, float, float, float]:
    """Convert a quaternion (x, y, z, w) to MuJoCo's order."""
    x, y, z, w = orientation
    return w, x, y, z


def _in_frame(pose: Pose3, vector: Sequence[float]) -> Vector:
    x, y, z = vector
    return (Pose3((0.0, 0.0, 0.0), pose.orientation).inverse() @ Pose3((x, y, z))).position
