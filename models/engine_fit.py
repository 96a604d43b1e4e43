"""Adapts the URDF for the physics engine to how a robot drives: wheels, casters and friction.

``models/README.md`` explains what PyBullet needs to drive straight, and why. Names, joints and frames are unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

from messages.se3 import Pose3, rotate, rotate_inverse
from models.extents import bottom, lowest_point, placed_shapes, solid_shapes
from models.gazebo_tags import Friction
from models.model import RobotModel
from models.robot_facts import BuiltWheels, Skid
from models.shapes import LinkShapes, Shape
from models.urdf import RobotDescription, parse_xml
from models.urdf_writer import link_poses
from models.wheels import TOUCHES, Wheel, read_wheel, rolling_joints

WHEEL_FRICTION = 1.0
"""Friction of a driven wheel without a tag."""
CASTER_WHEEL_FRICTION = 0.6
"""Friction of a passive wheel without a tag."""
SLIDER_FRICTION = 0.05
"""Friction of a part that slides on the ground without rolling, e.g. a ball or a skid, without a tag."""
BODY_FRICTION = 0.5
"""Friction of all other parts without a tag."""
LIFTED = 0.005
"""Parts that reach below the driven wheels by at most this height [m] are raised to the wheels' level: contacts are
rigid here, so the wheels would hang in the air; Gazebo's contacts are soft."""
HULL_MARGIN = 0.001
"""Distance [m] by which the engine's convex hulls of cylinders and meshes exceed their shapes."""
MAX_FRICTION = 1.5
"""Maximum friction. Rubber on concrete has less; tags use 100 and 1e5 for "does not slip", with which a skid-steered
robot would hop."""


@dataclass(frozen=True)
class DrivenWheels:
    """The joints of a robot's driven wheels, the wheels' radius [m], and whether the base is holonomic instead."""

    left: tuple[str, ...] = ()
    right: tuple[str, ...] = ()
    radius: float = 0.0
    holonomic: bool = False

    @classmethod
    def of(cls, model: RobotModel) -> DrivenWheels:
        """Return the driven wheels of a model."""
        if model.wheels is None:
            return cls(holonomic=model.planar is not None)
        return cls(model.wheels.left_joints, model.wheels.right_joints, model.wheels.radius)

    @property
    def joints(self) -> tuple[str, ...]:
        """All driven joints."""
        return (*self.left, *self.right)


@dataclass(frozen=True)
class EngineFit:
    """The URDF text; the height of the root when the robot stands on the ground [m]; the start positions of joints
    whose range excludes zero [rad or m]; the skidding of a base with several driven wheels per side; and the wheels'
    dimensions by their shapes."""

    text: str
    height: float
    starts: dict[str, float]
    skid: Skid | None = None
    wheels: BuiltWheels | None = None


def find_suspensions(robot: RobotDescription, driven: DrivenWheels) -> tuple[str, ...]:
    """Return the prismatic joints between the root and driven wheels, in the order of the file."""
    above = {each.child: each for each in robot.joints}
    slides: set[str] = set()
    for wheel in (each for each in robot.joints if each.name in driven.joints):
        link = wheel.parent
        while (joint := above.get(link)) is not None:
            link = joint.parent
            if joint.kind == "prismatic" and joint.limits.clamp(0.0) == 0:
                slides.add(joint.name)
    return tuple(each.name for each in robot.joints if each.name in slides)


def fit_urdf(
    text: str,
    robot: RobotDescription,
    shapes: Mapping[str, LinkShapes],
    friction: Mapping[str, Friction],
    driven: DrivenWheels,
) -> EngineFit:
    """Adapt the URDF ``text`` of the robot for the engine, with its shapes and the friction of its tags."""
    return _Fit(text, robot, shapes, friction, driven).result()


class _Fit:
    """The steps of ``fit_urdf``."""

    def __init__(
        self,
        text: str,
        robot: RobotDescription,
        shapes: Mapping[str, LinkShapes],
        friction: Mapping[str, Friction],
        driven: DrivenWheels,
    ) -> None:
        self._xml, self._robot, self._shapes, self._driven = parse_xml(text), robot, solid_shapes(shapes), driven
        self._stated = friction
        self._poses = link_poses(robot)
        self._links = {each.get("name", ""): each for each in self._xml.findall("link")}
        self._floor = lowest_point(placed_shapes(robot, shapes))
        self._bottoms: dict[str, float] = {}
        """Lowest point [m] in the root's frame of each sphere that a wheel rolls on, by link."""
        self._friction = dict.fromkeys(self._links, WHEEL_FRICTION)

    def result(self) -> EngineFit:
        rolling = self._roll_on_spheres()
        lifted = self._lift_supports(rolling)
        rigid = [bottom(shape, pose) + lifted.get(link, 0.0) for link, shape, pose in self._rigid()]
        floor = min([*rigid, *self._bottoms.values()]) if self._bottoms else self._floor
        self._set_friction(rolling, floor)
        starts = {each.name: each.limits.clamp(0.0) for each in self._robot.joints if each.single_dof}
        ElementTree.indent(self._xml)
        return EngineFit(
            text=ElementTree.tostring(self._xml, encoding="unicode") + "\n",
            height=0.0 if self._robot.root == "world" else 0.0 - floor,
            starts={name: start for name, start in starts.items() if start},
            skid=self._skid(),
            wheels=self._built(),
        )

    def _built(self) -> BuiltWheels | None:
        sides = [
            [read_wheel(self._robot, self._shapes, each) for each in self._robot.joints if each.name in side]
            for side in (self._driven.left, self._driven.right)
        ]
        if not all(each.radius > 0 for side in sides for each in side) or not all(sides):
            return None
        left, right = (sum(each.place[1] for each in side) / len(side) for side in sides)
        radii = [max(each.radius for each in side) for side in sides]
        return BuiltWheels(track=left - right, left_radius=radii[0], right_radius=radii[1])

    def _skid(self) -> Skid | None:
        if len(self._driven.left) < 2:
            return None
        wheels = [
            read_wheel(self._robot, self._shapes, each)
            for each in self._robot.joints
            if each.name in self._driven.joints
        ]
        if not wheels:
            return None
        x, y, z = (sum(each.place[axis] for each in wheels) / len(wheels) for axis in range(3))
        return Skid(
            middle=(x, y, z - max(each.radius for each in wheels)),
            friction=sum(self._friction[each.link] for each in wheels) / len(wheels),
            axles={each.link: each.axle for each in wheels},
        )

    def _roll_on_spheres(self) -> dict[str, bool]:
        """Replace the collision shapes of wheels by spheres; return their links, and whether they are driven."""
        joints = {each.name: each for each in self._robot.joints}
        rolling: dict[str, bool] = {}
        # A joint that does not exist is an error of model.toml, reported when that is read.
        for joint in [*(joints[each] for each in self._driven.joints if each in joints), *rolling_joints(self._robot)]:
            wheel = read_wheel(self._robot, self._shapes, joint)
            if wheel.link in rolling:
                continue
            driven = joint.name in self._driven.joints
            radius = wheel.radius or (self._driven.radius if driven else 0.0)
            if radius > 0 and (driven or wheel.place[2] - radius < self._floor + TOUCHES):
                rolling[wheel.link] = driven
                self._make_sphere(wheel, radius)
                if driven and wheel.width > 0 and abs(wheel.direction[1]) > 0.9:
                    self._add_guard(joint.parent, wheel, radius)
        return rolling

    def _make_sphere(self, wheel: Wheel, radius: float) -> None:
        link = self._links[wheel.link]
        for each in link.findall("collision"):
            link.remove(each)
        _collision(link, Pose3(wheel.centre), "sphere", radius=repr(radius))
        self._bottoms[wheel.link] = wheel.place[2] - radius

    def _add_guard(self, parent: str, wheel: Wheel, radius: float) -> None:
        """Add the sides of a wheel as a box for contact with other bodies: the sphere touches only the ground."""
        pose = self._poses[parent].inverse() @ Pose3(wheel.place)
        size = f"{1.8 * radius!r} {wheel.width!r} {1.2 * radius!r}"
        _collision(self._links[parent], pose, "box", size=size)

    def _lift_supports(self, rolling: Mapping[str, bool]) -> dict[str, float]:
        """Lift parts slightly lower than the driven wheels; return by how much [m], by link with own shapes."""
        driven = [self._bottoms[link] for link, has_motor in rolling.items() if has_motor]
        if not driven:
            return {}
        level, lifted = max(driven), {}
        for link, has_motor in rolling.items():
            if not has_motor and 0 < level - self._bottoms[link] <= LIFTED:
                sphere = self._links[link].find("collision/geometry/sphere")
                assert sphere is not None
                sphere.set("radius", repr(float(sphere.get("radius", "0")) - (level - self._bottoms[link])))
                self._bottoms[link] = level
        for link in dict.fromkeys(link for link, _, _ in self._rigid()):
            own = [(shape, pose) for name, shape, pose in self._rigid() if name == link]
            low = lowest_point(own)
            if low > level + TOUCHES or low < level - LIFTED:
                continue
            if len(own) == 1 and _lies(*own[0]):
                # A caster without a joint: a cylinder would collide as a hull, on two edges.
                self._replace_by_sphere(link, own[0][0], own[0][0].size[0] - max(0.0, level - low))
                self._bottoms[link] = max(low, level)
                continue
            margin = HULL_MARGIN if any(shape.kind in ("cylinder", "mesh") for shape, _ in own) else 0.0
            if level - low + margin > 0:
                lifted[link] = level - low + margin
                up = rotate_inverse(self._poses[link].orientation, (0.0, 0.0, lifted[link]))
                for origin in self._links[link].findall("collision/origin"):
                    at = [float(each) for each in origin.get("xyz", "0 0 0").split()]
                    origin.set("xyz", " ".join(repr(a + b) for a, b in zip(at, up, strict=True)))
        return lifted

    def _replace_by_sphere(self, link: str, shape: Shape, radius: float) -> None:
        for each in self._links[link].findall("collision"):
            self._links[link].remove(each)
        _collision(self._links[link], Pose3(shape.pose.position), "sphere", radius=repr(radius))

    def _rigid(self) -> list[tuple[str, Shape, Pose3]]:
        """Return the shapes that collide unchanged, with their links and link poses."""
        return [
            (link, shape, self._poses[link])
            for link, own in self._shapes.items()
            if link not in self._bottoms
            for shape in own.collisions
        ]

    def _set_friction(self, rolling: Mapping[str, bool], floor: float) -> None:
        for name, link in self._links.items():
            if link.find("collision") is None or link.find("contact") is not None:
                continue
            own = self._shapes[name].collisions
            lowest = lowest_point((each, self._poses[name]) for each in own)
            stands = name in rolling or (bool(own) and lowest < floor + TOUCHES)
            stated = self._stated.get(name)
            value = stated.coefficient if stated is not None else None
            if self._driven.holonomic and stands:
                value = 0.0
            elif value is None and name in rolling:
                value = WHEEL_FRICTION if rolling[name] else CASTER_WHEEL_FRICTION
            elif value is None:
                value = SLIDER_FRICTION if stands and self._driven.joints else BODY_FRICTION
            self._friction[name] = min(value, MAX_FRICTION)
            contact = ElementTree.SubElement(link, "contact")
            ElementTree.SubElement(contact, "lateral_friction", value=repr(self._friction[name]))
            if not stands and own and all(each.kind == "sphere" for each in own):
                # A link with nothing but spheres rolls and touches only the ground; this one must collide with
                # everything.
                _collision(link, own[0].pose, "box", size=" ".join([repr(own[0].size[0] / 10)] * 3))


def _lies(shape: Shape, frame: Pose3) -> bool:
    """Whether a shape is a cylinder with a horizontal axis."""
    return shape.kind == "cylinder" and abs(rotate((frame @ shape.pose).orientation, (0.0, 0.0, 1.0))[2]) < 0.1


def _collision(link: ElementTree.Element, pose: Pose3, shape: str, **figures: str) -> None:
    collision = ElementTree.SubElement(link, "collision")
    xyz, rpy = (" ".join(map(repr, each)) for each in (pose.position, pose.rpy))
    ElementTree.SubElement(collision, "origin", xyz=xyz, rpy=rpy)
    ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), shape, figures)
