"""Reads a robot's URDF, built-in or external: its links and inertias, its joints and their limits."""

from __future__ import annotations

import codecs
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import NoReturn, TypeVar
from xml.etree import ElementTree
from xml.parsers import expat

from messages.errors import BadInput, did_you_mean, list_names
from messages.se3 import IDENTITY, Pose3, Rotation, Vector, quaternion_from_rpy, quaternion_multiply, rotate
from models import urdf_path
from models.input_file import read_limited

T = TypeVar("T")

MAX_CHARACTERS = 1 << 20
"""Maximum length of a URDF; a longer one is refused without parsing."""
MAX_LINKS = 2000
"""Maximum number of links of a robot."""
MAX_DEPTH = 100
"""Maximum nesting of elements, that of TinyXML, with which ROS parses URDFs; seven levels are usual."""

MAX_VALUE = 1e6
"""Maximum magnitude of lengths, angles and limits in a URDF; a joint limit beyond it is clamped to it."""

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
SINGLE_DOF = ("revolute", "continuous", "prismatic")
"""Joint types with a single position, as in a JointState."""


class BadUrdf(BadInput):
    """A URDF is invalid or does not describe a tree; the text says what and where."""


class UrdfElement(ElementTree.Element):
    """An element with its ``line`` in the text."""

    line = 0


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: position = ``factor`` * the other's + ``offset``."""

    joint: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class JointLimits:
    """The limits of a joint in rad or m, N m or N, rad/s or m/s; None if not stated in the URDF.

    A ``velocity`` of 0 is a limit for Gazebo but means "unknown" in most URDFs. The ``soft`` limits are those of the
    joint's safety controller.
    """

    kind: str
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    soft_lower: float | None = None
    soft_upper: float | None = None

    def clamp(self, position: float) -> float:
        """Return the nearest position within the limits."""
        low, high = self.lower, self.upper
        return low if low is not None and position < low else high if high is not None and position > high else position


@dataclass(frozen=True)
class Joint:
    """A joint: ``xyz`` [m] and ``rpy`` [rad] place the child in the parent at position zero; ``axis`` has length 1."""

    name: str
    kind: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    limits: JointLimits
    mimic: Mimic | None = None

    @property
    def single_dof(self) -> bool:
        """Whether its position is a single number, as in a JointState."""
        return self.kind in SINGLE_DOF

    def rotation(self, angle: float = 0.0) -> Rotation:
        """Return the quaternion (x, y, z, w) from the parent to the child with the joint at ``angle`` [rad].

        URDF's fixed axes: q = q_z(yaw) q_y(pitch) q_x(roll), followed by the rotation about the joint's axis.
        """
        mount = self._mount
        if not angle:
            return mount
        c, s = math.cos(angle / 2), math.sin(angle / 2)
        x, y, z = self.axis
        i, j, k = s * x, s * y, s * z
        return quaternion_multiply(mount, (i, j, k, c))

    @cached_property
    def _mount(self) -> Rotation:
        return quaternion_from_rpy(*self.rpy)

    def transform(self, position: float = 0.0) -> Pose3:
        """Return the pose of the child in the parent, with the joint at ``position`` [rad; m if prismatic]."""
        if self.kind != "prismatic" or not position:
            return Pose3(self.xyz, self.rotation(0.0 if self.kind == "prismatic" else position))
        mount = self.rotation()
        x, y, z = rotate(mount, self.axis)
        return Pose3((self.xyz[0] + position * x, self.xyz[1] + position * y, self.xyz[2] + position * z), mount)


@dataclass(frozen=True)
class Inertia:
    """The inertia of a link: its mass [kg], the pose of its centre of mass in the link, and xx, yy, zz, xy, xz, yz of
    its tensor [kg m2] in the axes of that pose."""

    mass: float = 0.0
    centre: Pose3 = IDENTITY
    tensor: tuple[float, ...] = (0.0,) * 6


@dataclass(frozen=True)
class Link:
    """A link; ``radius`` [m] is that of its first collision sphere, else of its first cylinder, None without either."""

    name: str
    inertia: Inertia
    radius: float | None


@dataclass(frozen=True)
class RobotDescription:
    """A robot: its name, its root link, all links, and all joints in the order of the URDF.

    ``warnings`` list what ROS accepts but ignores.
    """

    name: str
    root: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    warnings: tuple[str, ...] = ()

    def link_offset(self, link: str) -> Vector:
        """Return the origin of ``link`` in the root's frame with all joints at zero, m."""
        above = {joint.child: joint for joint in self.joints}
        offset = (0.0, 0.0, 0.0)
        while (joint := above.get(link)) is not None:
            x, y, z = rotate(joint.rotation(), offset)
            offset = (x + joint.xyz[0], y + joint.xyz[1], z + joint.xyz[2])
            link = joint.parent
        return offset


@cache
def read_robot(name: str) -> RobotDescription:
    """Read the robot ``name``; raises ``models.UnknownModel``."""
    return parse_urdf(urdf_path(name).read_text(encoding="utf-8"))


def read_joints(name: str) -> tuple[Joint, ...]:
    """Return all joints of the robot ``name`` in the URDF's order; raises ``models.UnknownModel``."""
    return read_robot(name).joints


def read_joint_limits(name: str) -> dict[str, JointLimits]:
    """Return the limits of the robot's movable joints, in the URDF's order; raises ``models.UnknownModel``."""
    return {each.name: each.limits for each in read_joints(name) if each.single_dof}


def read_urdf(path: Path) -> str:
    """Read the text of a URDF file, in its declared encoding; raises BadUrdf."""
    try:
        content = read_limited(path, 4 * MAX_CHARACTERS, "a URDF")
    except BadInput as error:
        raise BadUrdf(str(error)) from None
    declared = re.match(rb"\s*<\?xml[^>]*\bencoding\s*=\s*[\"']([\w.-]{1,40})", content)
    encoding = "utf-16" if content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
    if declared and declared[1].lower() not in (b"utf-8", b"utf-16"):
        encoding = declared[1].decode()
    try:
        return content.decode(encoding)
    except (LookupError, UnicodeError) as error:
        raise BadUrdf(f"{path}: the text cannot be read as {encoding}: {error}") from None


def parse_urdf(urdf: str, file: str = "") -> RobotDescription:
    """Parse a URDF; raises BadUrdf, whose text begins with ``file`` and the line if known."""
    robot = parse_xml(urdf, file)
    with located(file):
        links = tuple(_located(_link, each) for each in robot.findall("link"))
        joints, warnings = _resolve_mimics(tuple(_located(_joint, each) for each in robot.findall("joint")))
        lines = {(each.tag, each.get("name", "")): line_of(each) for each in robot}
        root = _root([each.name for each in links], joints, lines)
    return RobotDescription(robot.get("name", ""), root, links, joints, warnings)


def line_of(element: ElementTree.Element) -> int:
    """Return the line of an element in the text that it was parsed from; 0 if unknown."""
    return element.line if isinstance(element, UrdfElement) else 0


@contextmanager
def located(file: str) -> Iterator[None]:
    """Prefix errors with ``file:line:`` instead of ``line N:``; unchanged without a file."""
    try:
        yield
    except BadUrdf as error:
        if not file:
            raise
        raise BadUrdf(
            re.sub(r"^line (\d+): |^", lambda at: f"{file}:{at[1]}: " if at[1] else f"{file}: ", str(error), count=1)
        ) from None


def _located(read: Callable[[ElementTree.Element], T], element: ElementTree.Element) -> T:
    try:
        return read(element)
    except BadUrdf as error:
        raise BadUrdf(f"line {line_of(element)}: {error}") from None


def parse_xml(urdf: str, file: str = "") -> ElementTree.Element:
    """Parse the elements of a URDF, at most MAX_DEPTH deep, so that recursion over them is safe; raises BadUrdf, whose
    text begins with ``file``.

    Prefixes of names (``xacro:property``) are kept, declared or not, as in TinyXML.
    """
    with located(file):
        return _parse_xml(urdf)


def _parse_xml(urdf: str) -> ElementTree.Element:
    if len(urdf) > MAX_CHARACTERS:
        raise BadUrdf(f"the URDF has {len(urdf)} characters, the limit is {MAX_CHARACTERS}")
    builder, depth = ElementTree.TreeBuilder(UrdfElement), 0
    skipped = urdf[: len(urdf) - len(urdf.lstrip())].count("\n")
    parser = expat.ParserCreate("utf-8")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise BadUrdf(
                f"the URDF has elements more than {MAX_DEPTH} deep, at line {parser.CurrentLineNumber + skipped}"
            )
        element = builder.start(tag, attributes)
        assert isinstance(element, UrdfElement)
        element.line = parser.CurrentLineNumber + skipped

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> NoReturn:
        raise BadUrdf(
            f"line {parser.CurrentLineNumber + skipped}: the URDF declares a document type or entities: "
            "a URDF needs none"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(urdf.strip().encode(), True)
    except expat.ExpatError as error:
        hint = ": is it a xacro or a path? Convert a xacro with the command xacro" if "<robot" not in urdf else ""
        reason = expat.ErrorString(error.code)
        raise BadUrdf(
            f"line {error.lineno + skipped}: the URDF is not XML: {reason}, column {error.offset}{hint}"
        ) from None
    except UnicodeEncodeError as error:
        raise BadUrdf(f"the URDF is not XML: {error}") from None
    robot = builder.close()
    if robot.tag == "urdf" and len(robot) == 1:  # a wrapper around the robot, which joint_state_publisher accepts
        robot = robot[0]
    if robot.tag != "robot":
        raise BadUrdf(f"line {line_of(robot)}: the URDF's root is <{robot.tag[:40]}>, not <robot>")
    return robot


def _link(element: ElementTree.Element) -> Link:
    name = element.get("name", "")
    radius = None
    for kind in ("sphere", "cylinder"):
        shape = element.find(f"collision/geometry/{kind}")
        if shape is not None and "radius" in shape.attrib and radius is None:
            radius = _plain_number(shape, "radius", f"link {name!r}")
    return Link(name, _inertia(element.find("inertial"), f"link {name!r}"), radius)


def _inertia(element: ElementTree.Element | None, where: str) -> Inertia:
    mass = None if element is None else element.find("mass")
    if element is None or mass is None:
        return Inertia()
    xyz = _vector(element, "origin", "xyz", (0.0, 0.0, 0.0), where)
    rpy = _vector(element, "origin", "rpy", (0.0, 0.0, 0.0), where)
    tensor = element.find("inertia")
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    moments = (0.0,) * 6 if tensor is None else tuple(_plain_number(tensor, each, where) for each in names)
    return Inertia(_plain_number(mass, "value", where), Pose3(xyz, quaternion_from_rpy(*rpy)), moments)


def _plain_number(element: ElementTree.Element, attribute: str, where: str) -> float:
    """Return a finite number of any size, 0 if not stated."""
    text = element.get(attribute, "0")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadUrdf(f"{where}: {attribute}={text[:60]!r} is not a number")
    return value


def _joint(element: ElementTree.Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    if not name:
        raise BadUrdf("a joint has no name")
    if kind not in JOINT_TYPES:
        raise BadUrdf(f"joint {name!r} has the unknown type {kind!r} (known: {', '.join(JOINT_TYPES)})")
    where, follows = f"joint {name!r}", element.find("mimic")
    return Joint(
        name=name,
        kind=kind,
        parent=_link_of(element, "parent", name),
        child=_link_of(element, "child", name),
        xyz=_vector(element, "origin", "xyz", (0.0, 0.0, 0.0), where),
        rpy=_vector(element, "origin", "rpy", (0.0, 0.0, 0.0), where),
        axis=_axis(element, name, kind),
        limits=_limits(element, name, kind),
        mimic=_mimic(follows, name) if follows is not None else None,
    )


def _limits(element: ElementTree.Element, name: str, kind: str) -> JointLimits:
    limited, limit = kind in ("revolute", "prismatic"), element.find("limit")
    if limited and limit is None:
        raise BadUrdf(f"joint {name!r} is {kind} and has no <limit>; a joint without limits is continuous")
    lower = _limit(limit, "lower", name) if limited else None
    upper = _limit(limit, "upper", name) if limited else None
    if lower is not None and upper is not None and lower > upper:
        raise BadUrdf(f"joint {name!r}: its lower limit {lower:g} lies above the upper one {upper:g}")
    safety, dynamics = element.find("safety_controller"), element.find("dynamics")
    return JointLimits(
        kind=kind,
        lower=lower,
        upper=upper,
        effort=_limit(limit, "effort", name, None),
        velocity=_limit(limit, "velocity", name, None),
        damping=_limit(dynamics, "damping", name) or 0.0,
        friction=_limit(dynamics, "friction", name) or 0.0,
        soft_lower=_limit(safety, "soft_lower_limit", name, None),
        soft_upper=_limit(safety, "soft_upper_limit", name, None),
    )


def _mimic(element: ElementTree.Element, name: str) -> Mimic:
    followed = element.get("joint", "")
    if not followed:
        raise BadUrdf(f"joint {name!r}: its <mimic> names no joint")
    factor, offset = _number(element, "multiplier", name, 1.0), _number(element, "offset", name, 0.0)
    assert factor is not None
    assert offset is not None
    return Mimic(followed, factor, offset)


def _axis(element: ElementTree.Element, name: str, kind: str) -> Vector:
    """Return the unit vector of the axis; x if it is missing or has no direction."""
    if kind in ("fixed", "floating"):
        return 1.0, 0.0, 0.0
    axis = _vector(element, "axis", "xyz", (1.0, 0.0, 0.0), f"joint {name!r}")
    length = math.hypot(*axis)
    if length < 1e-9:
        if kind in ("revolute", "continuous", "prismatic"):
            raise BadUrdf(f"joint {name!r}: its axis is 0 0 0")
        return 1.0, 0.0, 0.0
    if abs(length - 1) < 1e-12:
        return axis
    return axis[0] / length, axis[1] / length, axis[2] / length


def _link_of(element: ElementTree.Element, tag: str, name: str) -> str:
    found = element.find(tag)
    link = found.get("link", "") if found is not None else ""
    if not link:
        raise BadUrdf(f"joint {name!r} has no <{tag} link=...>")
    return link


def _vector(element: ElementTree.Element, tag: str, attribute: str, default: Vector, where: str) -> Vector:
    found = element.find(tag)
    text = found.get(attribute) if found is not None else None
    if text is None:
        return default
    try:
        x, y, z = (float(part) for part in text.split())
    except ValueError:
        raise BadUrdf(f"{where}: {tag} {attribute}={text[:60]!r} is not three numbers") from None
    if not all(abs(each) <= MAX_VALUE for each in (x, y, z)):
        raise BadUrdf(f"{where}: {tag} {attribute}={text[:60]!r} exceeds {MAX_VALUE:g}")
    return x, y, z


def _number(
    element: ElementTree.Element | None, attribute: str, name: str, default: float | None = 0.0
) -> float | None:
    text = element.get(attribute) if element is not None else None
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_VALUE:
        raise BadUrdf(f"joint {name!r}: {attribute}={text[:60]!r} is not a number up to {MAX_VALUE:g}")
    return value


def _limit(element: ElementTree.Element | None, attribute: str, name: str, default: float | None = 0.0) -> float | None:
    """Return a limit clamped to MAX_VALUE: converters write 1e16 or inf for none."""
    text = element.get(attribute) if element is not None else None
    try:
        value = float(text) if text is not None else 0.0
    except ValueError:
        value = 0.0
    if abs(value) > MAX_VALUE:
        return math.copysign(MAX_VALUE, value)
    return _number(element, attribute, name, default)


def _root(links: list[str], joints: tuple[Joint, ...], lines: Mapping[tuple[str, str], int]) -> str:
    """Return the one link without a parent; raises BadUrdf if the links do not form a tree."""
    if not links:
        raise BadUrdf("the URDF has no link")
    if len(links) > MAX_LINKS:
        raise BadUrdf(f"the URDF has {len(links)} links, the limit is {MAX_LINKS}")
    for kind, names in (("link", links), ("joint", [each.name for each in joints])):
        if twice := sorted(name for name, count in Counter(names).items() if count > 1):
            raise BadUrdf(f"line {lines[kind, twice[0]]}: the {kind} {twice[0]!r} occurs twice")
    above: dict[str, str] = {}
    for each in joints:
        for link in (each.parent, each.child):
            if link not in links:
                known = list_names(links, 100)
                raise BadUrdf(
                    f"line {lines['joint', each.name]}: joint {each.name!r}: there is no link {link!r}"
                    f"{did_you_mean(link, links)} (known: {known})"
                )
        if each.child in above:
            raise BadUrdf(
                f"line {lines['joint', each.name]}: link {each.child!r} has two parents, {above[each.child]!r} and "
                f"{each.parent!r}"
            )
        above[each.child] = each.parent
    roots = [each for each in links if each not in above]
    if len(roots) > 1:
        apart = ", ".join(map(repr, roots))
        raise BadUrdf(f"line {lines['link', roots[1]]}: the links do not form a tree: {apart} have no parent")
    for link in links:
        seen = {link}
        while (parent := above.get(link)) is not None:
            if parent in seen:
                raise BadUrdf(f"line {lines['link', parent]}: the links are in a loop through {parent!r}")
            seen.add(parent)
            link = parent
    return roots[0]


def _resolve_mimics(joints: tuple[Joint, ...]) -> tuple[tuple[Joint, ...], tuple[str, ...]]:
    """Remove mimic tags that ROS accepts but that have no effect; return the joints and warnings. Raises BadUrdf.

    They are those of joints without a single position (fixed, floating, planar), and those that mimic such a joint or a
    missing one; the latter joints follow joint states only, as in robot_state_publisher.
    """
    own = {each.name: each for each in joints}
    remarks: list[str] = []
    kept = []
    for each in joints:
        if each.mimic is not None and each.single_dof:
            followed = own.get(each.mimic.joint)
            if followed is None or not followed.single_dof:
                what = "does not exist" if followed is None else f"is {followed.kind}"
                remarks.append(f"joint {each.name!r} mimics {each.mimic.joint!r}, which {what}: its <mimic> is ignored")
                each = replace(each, mimic=None)
        elif each.mimic is not None:
            remarks.append(
                f"joint {each.name!r} is {each.kind} and mimics {each.mimic.joint!r}: its <mimic> is ignored"
            )
            each = replace(each, mimic=None)
        kept.append(each)
    _check_mimics(kept)
    return tuple(kept), tuple(remarks)


def _check_mimics(joints: Sequence[Joint]) -> None:
    """Raise BadUrdf if a joint mimics itself, even indirectly."""
    own = {each.name: each for each in joints}
    for each in joints:
        seen, follower = {each.name}, each
        while follower.mimic is not None:
            follower = own[follower.mimic.joint]
            if follower.name in seen:
                raise BadUrdf(f"joints mimic each other in a circle, e.g. {follower.name!r}")
            seen.add(follower.name)


class NoWheels(BadInput):
    """A URDF lacks what is needed of its wheels; the text says what it has instead."""


@dataclass(frozen=True)
class WheelPair:
    """Distance of the joints' origins [m]; radii [m] of the wheels, None without a collision sphere or cylinder;
    offsets of the wheels to the left of the root's x axis [m]."""

    separation: float
    left_radius: float | None
    right_radius: float | None
    left_offset: float
    right_offset: float


def read_wheels(urdf: Path, left: str, right: str) -> WheelPair:
    """Return the wheels on the joints ``left`` and ``right``; raises NoWheels for a missing joint.

    As in ROS's ``diff_drive_controller``, the separation is the Euclidean distance between the joints' origins, the
    radius that of the wheel link's collision sphere or cylinder.
    """
    return _wheels_in(urdf.read_text(encoding="utf-8"), left, right)


@lru_cache(64)
def _wheels_in(text: str, left: str, right: str) -> WheelPair:
    robot = parse_urdf(text)
    one, other = _find(robot.joints, left), _find(robot.joints, right)
    at_left, at_right = robot.link_offset(one.child), robot.link_offset(other.child)
    radii = {each.name: each.radius for each in robot.links}
    return WheelPair(
        separation=math.dist(at_left, at_right),
        left_radius=radii[one.child],
        right_radius=radii[other.child],
        left_offset=at_left[1],
        right_offset=at_right[1],
    )


def _find(joints: tuple[Joint, ...], name: str) -> Joint:
    for joint in joints:
        if joint.name == name:
            return joint
    movable = ", ".join(joint.name for joint in joints if joint.kind != "fixed")
    raise NoWheels(f"there is no wheel joint {name!r} (movable: {movable or 'none'})")
