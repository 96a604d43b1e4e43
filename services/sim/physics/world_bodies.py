"""The bodies of a world in PyBullet: fixed ones piece by piece, movable and moving ones as one body each."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from messages.se3 import IDENTITY, Pose3, Vector, cross, rotate
from models.bodies import BodyPart, BoxShape, CylinderShape, HeightMapShape, MeshShape, RampShape, Shape, SphereShape
from models.mass_properties import mass_properties
from models.mesh import Mesh, hull_points
from models.shape_mesh import height_map_mesh, ramp_mesh
from models.world import WorldBody, WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._pybullet import pybullet
from services.sim.physics.collision_groups import BODY, FIXED, GROUND, MOVING_GROUND, set_contact_dynamics
from services.sim.physics.world import BodyState

MAX_TRIANGLES = 80_000
"""Per collision shape; PyBullet's limits are 131,072 corners and 524,288 indices, so larger meshes become several
bodies."""
_DRAWN_ROWS = 200
"""Rows and columns of a height map in camera images."""
_SKY = 1e4
"""m; nothing is higher."""
_BENEATH = 0.001
"""m; a ray continues this far below its last hit: from inside a convex shape it does not hit that again."""
_NONE = -1


@dataclass
class LoadedWorld:
    """What was loaded: the names of all bodies except the ground by number, the numbers of those that wheels roll on,
    of those the height maps, and the handles of bodies that are not fixed."""

    names: dict[int, str] = field(default_factory=dict)
    grounds: set[int] = field(default_factory=set)
    height_maps: set[int] = field(default_factory=set)
    handles: dict[str, WorldBodyHandle] = field(default_factory=dict)


@dataclass(frozen=True)
class WorldBodyHandle:
    """A movable or moving body in a client; ``centre`` [m] is its centre of mass in its frame."""

    client: int
    number: int
    body: WorldBody
    centre: Vector

    def state(self) -> BodyState:
        """Return pose and velocity of its frame; PyBullet has those of the centre of mass, v = v_c - w x R c."""
        position, orientation = pybullet.getBasePositionAndOrientation(self.number, self.client)
        linear, angular = pybullet.getBaseVelocity(self.number, self.client)
        arm = rotate(orientation, self.centre)
        return BodyState(_minus(position, arm), orientation, _minus(linear, cross(angular, arm)), angular)

    def set_state(self, state: BodyState) -> None:
        """Set its pose and velocity, without a check."""
        arm = rotate(state.orientation, self.centre)
        x, y, z = cross(state.angular, arm)
        linear = state.linear[0] + x, state.linear[1] + y, state.linear[2] + z
        self.set_pose(Pose3(state.position, state.orientation))
        pybullet.resetBaseVelocity(self.number, linear, state.angular, physicsClientId=self.client)

    def set_pose(self, pose: Pose3) -> None:
        """Set its pose, without a check and without changing its velocity."""
        place = pose @ Pose3(self.centre)
        pybullet.resetBasePositionAndOrientation(self.number, *place, physicsClientId=self.client)

    def follow_path(self, seconds: float, step: float) -> None:
        """Place a moving body on its path at a time [s], with the speed that keeps it on the path in the next step."""
        path = self.body.path
        assert path is not None
        here, there = path.position_at(seconds), path.position_at(seconds + step)
        x, y, z = _minus(there, here)
        still = (0.0, 0.0, 0.0)
        self.set_state(BodyState(here, self.body.pose.orientation, (x / step, y / step, z / step), still))


def load_bodies(client: int, world: WorldDescription, loaded: LoadedWorld) -> None:
    """Load the bodies of a world into a client, in their order; raises BadInput if PyBullet refuses one."""
    for body in world.bodies:
        try:
            if body.kind == "fixed":
                _load_fixed(client, body, loaded)
            else:
                _load_moving(client, body, loaded)
        except (pybullet.error, SystemError) as error:
            raise BadInput(f"the body {body.name!r} cannot be put into the world: {error}") from error


def ground_height(client: int, grounds: Collection[int], x: float, y: float) -> float | None:
    """Return the height [m] of the highest of these bodies at a point; None if none is there."""
    top = _SKY
    while grounds:
        hit = pybullet.rayTest((x, y, top), (x, y, -_SKY), physicsClientId=client)[0]
        if hit[0] < 0:
            break
        height: float = hit[3][2]
        if hit[0] in grounds:
            return height
        top = min(height, top) - _BENEATH
    return None


def _load_fixed(client: int, body: WorldBody, loaded: LoadedWorld) -> None:
    for part in body.parts:
        pose = body.pose @ part.pose
        for shape, look, offset in _fixed_pieces(client, part):
            at = pose @ Pose3(offset)
            # As a plain rigid body, a fixed one takes a twentieth of the step time of a multibody.
            number = pybullet.createMultiBody(0, shape, look, *at, useMaximalCoordinates=1, physicsClientId=client)
            _register(client, number, _NONE, body, part, loaded)


def _register(client: int, number: int, link: int, body: WorldBody, part: BodyPart, loaded: LoadedWorld) -> None:
    loaded.names[number] = body.name
    if part.solid:
        fixed = body.kind == "fixed"
        touches = (GROUND if fixed else MOVING_GROUND) if part.ground else (FIXED if fixed else BODY)
        set_contact_dynamics(client, number, link, body.friction, touches)
    if part.ground:
        loaded.grounds.add(number)
    if isinstance(part.shape, HeightMapShape):
        loaded.height_maps.add(number)


def _load_moving(client: int, body: WorldBody, loaded: LoadedWorld) -> None:
    """Load one multibody about the centre of mass; a single part is its base, several parts are links."""
    properties = mass_properties(body)
    centre = properties.centre
    places = [Pose3(_minus(part.pose.position, centre), part.pose.orientation) for part in body.parts]
    base = body.pose @ Pose3(centre)
    shapes = [
        _movable_shape(client, part, place if len(places) == 1 else IDENTITY) if part.solid else _NONE
        for part, place in zip(body.parts, places, strict=True)
    ]
    looks = [
        _visual_shape(client, part, place if len(places) == 1 else IDENTITY)
        for part, place in zip(body.parts, places, strict=True)
    ]
    mass = body.mass if body.kind == "movable" else 0.0
    if len(places) == 1:
        number = pybullet.createMultiBody(mass, shapes[0], looks[0], *base, physicsClientId=client)
        _register(client, number, _NONE, body, body.parts[0], loaded)
    else:
        count = len(places)
        number = pybullet.createMultiBody(
            mass,
            _NONE,
            _NONE,
            *base,
            linkMasses=[0.0] * count,
            linkCollisionShapeIndices=shapes,
            linkVisualShapeIndices=looks,
            linkPositions=[place.position for place in places],
            linkOrientations=[place.orientation for place in places],
            linkInertialFramePositions=[(0.0, 0.0, 0.0)] * count,
            linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)] * count,
            linkParentIndices=[0] * count,
            linkJointTypes=[pybullet.JOINT_FIXED] * count,
            linkJointAxis=[(0.0, 0.0, 1.0)] * count,
            physicsClientId=client,
        )
        for link, part in enumerate(body.parts):
            _register(client, number, link, body, part, loaded)
    if mass:
        pybullet.changeDynamics(number, _NONE, localInertiaDiagonal=properties.moments, physicsClientId=client)
    pybullet.changeDynamics(number, _NONE, linearDamping=0, angularDamping=0, physicsClientId=client)
    loaded.handles[body.name] = WorldBodyHandle(client, number, body, centre)


def _fixed_pieces(client: int, part: BodyPart) -> list[tuple[int, int, Vector]]:
    """Return collision and visual shapes of a part that does not move, and the position of each in the part's frame."""
    shape, origin = part.shape, (0.0, 0.0, 0.0)
    if not part.solid:
        return [(_NONE, _visual_shape(client, part, IDENTITY), origin)]
    if isinstance(shape, HeightMapShape):
        middle = float(shape.heights.min() + shape.heights.max()) / 2  # Bullet centres height fields vertically
        look = _visual_shape(client, part, Pose3((0.0, 0.0, -middle)))
        return [(_height_field(client, shape), look, (0.0, 0.0, middle))]
    if isinstance(shape, MeshShape) and not shape.convex:
        return [
            (_trimesh(client, chunk), _visual_shape(client, replace(part, shape=MeshShape(chunk)), IDENTITY), origin)
            for chunk in _chunks(shape.mesh)
        ]
    return [(_movable_shape(client, part, IDENTITY), _visual_shape(client, part, IDENTITY), origin)]


def _height_field(client: int, shape: HeightMapShape) -> int:
    rows, columns = shape.heights.shape
    number: int = pybullet.createCollisionShape(
        pybullet.GEOM_HEIGHTFIELD,
        meshScale=(shape.size[0] / (columns - 1), shape.size[1] / (rows - 1), 1.0),
        heightfieldData=shape.heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
        physicsClientId=client,
    )
    return number


def _movable_shape(client: int, part: BodyPart, place: Pose3) -> int:
    """Return a convex collision shape at ``place`` in the frame of its body or link."""
    match part.shape:
        case MeshShape(mesh):
            return _hull(client, hull_points(mesh).tolist(), place)
        case RampShape():
            return _hull(client, ramp_mesh(part.shape).vertices.tolist(), place)
        case shape:
            number: int = pybullet.createCollisionShape(
                **_primitive(shape, "length"),
                collisionFramePosition=place.position,
                collisionFrameOrientation=place.orientation,
                physicsClientId=client,
            )
            return number


def _hull(client: int, points: list[Vector], place: Pose3) -> int:
    vertices = [_plus(rotate(place.orientation, (x, y, z)), place.position) for x, y, z in points]
    number: int = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=vertices, physicsClientId=client)
    return number


def _trimesh(client: int, mesh: Mesh) -> int:
    number: int = pybullet.createCollisionShape(
        pybullet.GEOM_MESH,
        vertices=mesh.vertices.tolist(),
        indices=mesh.triangles.ravel().tolist(),
        flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        physicsClientId=client,
    )
    return number


def _primitive(shape: Shape, length: str) -> dict[str, object]:
    """Return the arguments of a box, cylinder or sphere; the name of a cylinder's length differs."""
    match shape:
        case BoxShape((x, y, z)):
            return {"shapeType": pybullet.GEOM_BOX, "halfExtents": (x / 2, y / 2, z / 2)}
        case CylinderShape():
            kind = {"height": shape.length} if length == "length" else {"length": shape.length}
            return {"shapeType": pybullet.GEOM_CYLINDER, "radius": shape.radius, **kind}
        case SphereShape():
            return {"shapeType": pybullet.GEOM_SPHERE, "radius": shape.radius}
        case RampShape() | MeshShape() | HeightMapShape():
            raise BadInput(f"{type(shape).__name__} cannot move")


def _visual_shape(client: int, part: BodyPart, place: Pose3) -> int:
    shape = part.shape
    if not part.visible:
        # Without a visual shape, the collision shape is drawn: add one that is too small to see.
        arguments: dict[str, object] = {"shapeType": pybullet.GEOM_SPHERE, "radius": 1e-6}
    elif isinstance(shape, MeshShape | RampShape | HeightMapShape):
        mesh = next(iter(_chunks(_drawn_mesh(shape))))
        arguments = {
            "shapeType": pybullet.GEOM_MESH,
            "vertices": mesh.vertices.tolist(),
            "indices": mesh.triangles.ravel().tolist(),
            "normals": _normals(mesh).tolist(),
        }
    else:
        arguments = _primitive(shape, "visual")
    number: int = pybullet.createVisualShape(
        **arguments,
        rgbaColor=part.colour,
        visualFramePosition=place.position,
        visualFrameOrientation=place.orientation,
        physicsClientId=client,
    )
    return number


def _drawn_mesh(shape: MeshShape | RampShape | HeightMapShape) -> Mesh:
    """Return the mesh to draw, with separate corners for each triangle, so that edges look sharp."""
    match shape:
        case MeshShape(mesh):
            if len(mesh.triangles) * 3 > MAX_TRIANGLES:
                return mesh
        case RampShape():
            mesh = ramp_mesh(shape)
        case HeightMapShape():
            return height_map_mesh(shape, _DRAWN_ROWS)
    corners = mesh.vertices[mesh.triangles].reshape(-1, 3)
    return Mesh(corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))


def _normals(mesh: Mesh) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the normals at the corners: the mean of those of their triangles, weighted by area."""
    corners = mesh.vertices[mesh.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(sums, mesh.triangles[:, corner], across)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0, sums / np.maximum(length, 1e-30), (0.0, 0.0, 1.0))


def _chunks(mesh: Mesh) -> Iterable[Mesh]:
    """Split a mesh into pieces within PyBullet's limits."""
    if len(mesh.triangles) <= MAX_TRIANGLES and len(mesh.vertices) <= 1.5 * MAX_TRIANGLES:
        yield mesh
        return
    for start in range(0, len(mesh.triangles), MAX_TRIANGLES // 2):
        used, index = np.unique(mesh.triangles[start : start + MAX_TRIANGLES // 2], return_inverse=True)
        yield Mesh(mesh.vertices[used], index.reshape(-1, 3).astype(np.int32))


def _plus(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _minus(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]
