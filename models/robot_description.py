"""A URDF from anywhere, read and checked: the tree of its links, and limits and mimicry of its joints."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from messages.errors import BadInput
from messages.se3 import Vector
from models.urdf import Joint

MAX_CHARACTERS = 1 << 20
"""Characters of a URDF; a longer one is refused unread."""
MAX_LINKS = 2000
"""Links of a robot."""
MAX_DEPTH = 100
"""Elements within elements, as TinyXML has them at most, by which ROS reads a URDF; seven are usual."""

MAX_VALUE = 1e6
"""Bound of every number in a URDF, m or rad; a joint's limit that lies beyond it is taken as this one."""

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


class BadUrdf(BadInput):
    """A URDF is not one, or describes no tree; the text says what and where."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: position = ``factor`` * the other's + ``offset``."""

    joint: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class DescribedJoint:
    """A joint, with what a controller must know of it.

    ``lower`` and ``upper`` bound its position [rad or m], None without a limit; the ``soft`` ones are those of its
    safety controller.
    """

    frame: Joint
    lower: float | None = None
    upper: float | None = None
    soft_lower: float | None = None
    soft_upper: float | None = None
    mimic: Mimic | None = None

    @property
    def name(self) -> str:
        """The joint's name."""
        return self.frame.name

    @property
    def kind(self) -> str:
        """One of KINDS."""
        return self.frame.kind

    @property
    def single_dof(self) -> bool:
        """Whether one number tells where it stands, as a JointState does."""
        return self.kind in ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class RobotDescription:
    """A robot: its name, the link that is in no other, and all joints in the order of the URDF.

    ``remarks`` tell what ROS takes as well, and does nothing with.
    """

    name: str
    root: str
    joints: tuple[DescribedJoint, ...]
    warnings: tuple[str, ...] = ()


def parse_urdf(urdf: str) -> RobotDescription:
    """The robot that a URDF describes; raises BadDescription."""
    robot = parse_xml(urdf)
    links = [each.get("name", "") for each in robot.findall("link")]
    joints, remarks = _resolve_mimics(tuple(_joint(each) for each in robot.findall("joint")))
    return RobotDescription(robot.get("name", ""), _root(links, joints), joints, remarks)


def parse_xml(urdf: str) -> ElementTree.Element:
    """The elements of a URDF, at most DEEPEST deep, so that whoever walks them may recurse; raises BadDescription.

    Prefixes of names (``xacro:property``) are part of them, declared or not, as TinyXML has it.
    """
    if len(urdf) > MAX_CHARACTERS:
        raise BadUrdf(f"the URDF has {len(urdf)} characters, the limit is {MAX_CHARACTERS}")
    builder, depth = ElementTree.TreeBuilder(), 0
    parser = expat.ParserCreate("utf-8")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise BadUrdf(f"the URDF has elements more than {MAX_DEPTH} deep, at line {parser.CurrentLineNumber}")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> NoReturn:
        raise BadUrdf("the URDF declares a document type or entities: a URDF needs none")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(urdf.strip().encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        hint = ": is it a xacro or a path? Convert a xacro with the command xacro" if "<robot" not in urdf else ""
        raise BadUrdf(f"the URDF is not XML: {error}{hint}") from None
    robot = builder.close()
    if robot.tag != "robot":
        raise BadUrdf(f"the URDF's root is <{robot.tag[:40]}>, not <robot>")
    return robot


def _joint(element: ElementTree.Element) -> DescribedJoint:
    name, kind = element.get("name", ""), element.get("type", "")
    if not name:
        raise BadUrdf("a joint has no name")
    if kind not in JOINT_TYPES:
        raise BadUrdf(f"joint {name!r} is of the type {kind!r}; there are {', '.join(JOINT_TYPES)}")
    frame = Joint(
        name=name,
        kind=kind,
        parent=_link_of(element, "parent", name),
        child=_link_of(element, "child", name),
        xyz=_vector(element, "origin", "xyz", (0.0, 0.0, 0.0), name),
        rpy=_vector(element, "origin", "rpy", (0.0, 0.0, 0.0), name),
        axis=_axis(element, name, kind),
    )
    limited = kind in ("revolute", "prismatic")
    limit = element.find("limit")
    if limited and limit is None:
        raise BadUrdf(f"joint {name!r} is {kind} and has no <limit>; a joint that turns for ever is continuous")
    lower = _limit(limit, "lower", name) if limited else None
    upper = _limit(limit, "upper", name) if limited else None
    if lower is not None and upper is not None and lower > upper:
        raise BadUrdf(f"joint {name!r}: its lower limit {lower:g} lies above the upper one {upper:g}")
    safety = element.find("safety_controller")
    follows = element.find("mimic")
    return DescribedJoint(
        frame=frame,
        lower=lower,
        upper=upper,
        soft_lower=_limit(safety, "soft_lower_limit", name, None),
        soft_upper=_limit(safety, "soft_upper_limit", name, None),
        mimic=_mimic(follows, name) if follows is not None else None,
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
    """The unit vector of the axis; x when none is given, or none is meant."""
    if kind in ("fixed", "floating"):
        return 1.0, 0.0, 0.0
    axis = _vector(element, "axis", "xyz", (1.0, 0.0, 0.0), name)
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


def _vector(element: ElementTree.Element, tag: str, attribute: str, default: Vector, name: str) -> Vector:
    found = element.find(tag)
    text = found.get(attribute) if found is not None else None
    if text is None:
        return default
    try:
        x, y, z = (float(part) for part in text.split())
    except ValueError:
        raise BadUrdf(f"joint {name!r}: {tag} {attribute}={text[:60]!r} is not three numbers") from None
    if not all(abs(each) <= MAX_VALUE for each in (x, y, z)):
        raise BadUrdf(f"joint {name!r}: {tag} {attribute}={text[:60]!r} exceeds {MAX_VALUE:g}")
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
    """A limit within FARTHEST: converters write 1e16 or inf for none."""
    text = element.get(attribute) if element is not None else None
    try:
        value = float(text) if text is not None else 0.0
    except ValueError:
        value = 0.0
    if abs(value) > MAX_VALUE:
        return math.copysign(MAX_VALUE, value)
    return _number(element, attribute, name, default)


def _root(links: list[str], joints: tuple[DescribedJoint, ...]) -> str:
    """The one link that no joint moves; raises BadDescription when the links are no tree."""
    if not links:
        raise BadUrdf("the URDF has no link")
    if len(links) > MAX_LINKS:
        raise BadUrdf(f"the URDF has {len(links)} links, the limit is {MAX_LINKS}")
    for kind, names in (("link", links), ("joint", [each.name for each in joints])):
        if twice := sorted(name for name, count in Counter(names).items() if count > 1):
            raise BadUrdf(f"the {kind} {twice[0]!r} is there twice")
    above: dict[str, str] = {}
    for each in joints:
        for link in (each.frame.parent, each.frame.child):
            if link not in links:
                raise BadUrdf(f"joint {each.name!r}: there is no link {link!r} (known: {', '.join(links)})")
        if each.frame.child in above:
            raise BadUrdf(
                f"link {each.frame.child!r} has two parents, {above[each.frame.child]!r} and {each.frame.parent!r}"
            )
        above[each.frame.child] = each.frame.parent
    roots = [each for each in links if each not in above]
    if len(roots) > 1:
        raise BadUrdf(f"the links are no tree: {', '.join(map(repr, roots))} hang on nothing")
    for link in links:
        seen = {link}
        while (parent := above.get(link)) is not None:
            if parent in seen:
                raise BadUrdf(f"the links are in a loop through {parent!r}")
            seen.add(parent)
            link = parent
    return roots[0]


def _resolve_mimics(joints: tuple[DescribedJoint, ...]) -> tuple[tuple[DescribedJoint, ...], tuple[str, ...]]:
    """The joints, without mimicry that ROS takes and that moves nothing, and what that was; raises BadDescription.

    A joint that does not move follows nobody, and one that follows what does not move, or is not there, is told by
    joint states alone, as by robot_state_publisher.
    """
    own = {each.name: each for each in joints}
    remarks: list[str] = []
    kept = []
    for each in joints:
        if each.mimic is not None and each.single_dof:
            followed = own.get(each.mimic.joint)
            if followed is None or not followed.single_dof:
                what = "does not exist" if followed is None else f"is {followed.kind}"
                remarks.append(f"joint {each.name!r} mimics {each.mimic.joint!r}, which {what}: it follows nothing")
                each = replace(each, mimic=None)
        elif each.mimic is not None:
            remarks.append(f"joint {each.name!r} is {each.kind} and mimics {each.mimic.joint!r}: it stays as it is")
            each = replace(each, mimic=None)
        kept.append(each)
    _check_mimics(kept)
    return tuple(kept), tuple(remarks)


def _check_mimics(joints: Sequence[DescribedJoint]) -> None:
    """Nobody follows himself, not even through others."""
    own = {each.name: each for each in joints}
    for each in joints:
        seen, follower = {each.name}, each
        while follower.mimic is not None:
            follower = own[follower.mimic.joint]
            if follower.name in seen:
                raise BadUrdf(f"joints mimic each other in a circle, {follower.name!r} for one")
            seen.add(follower.name)
