"""Converts an SDF model to a URDF, for robots and objects that are spawned at run time.

Sensors and plugins are copied into ``<gazebo>`` tags, which both formats share.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from messages.errors import BadInput, unknown_name
from messages.se3 import IDENTITY, Pose3, rpy_from_quaternion
from models.bodies import BadWorld, BodyPart, BoxShape, CylinderShape, MeshShape, SphereShape, WorldBody
from models.mass_properties import mass_properties
from models.packages import OWNER, FileAccess
from models.sdf import SdfJoint, SdfLink, SdfModel, read_sdf_model
from models.sdf_xml import ROOTS, SdfElement, without_comments

_KINDS = ("revolute", "continuous", "prismatic", "fixed")
_UNLIMITED = 1e3
"""rad or m; limits beyond this mean none."""
_NO_EFFORT = 1e5


class UrdfOfSdf(NamedTuple):
    """The URDF of an SDF model, and notes on unsupported content."""

    urdf: str
    notes: tuple[str, ...]


def urdf_of_sdf(
    text: str, folder: Path | None = None, packages: Sequence[Path] = (), access: FileAccess = OWNER
) -> UrdfOfSdf:
    """Convert the model in a text to URDF; raises BadWorld.

    Its root link is the model's own frame, whose pose in the world is that of ``models.sdf.read_sdf_pose``.
    """
    model = read_sdf_model(text, folder, packages, access)
    notes = list(model.notes)
    if not model.links:
        raise BadWorld(f"the model {model.name!r} has no links")
    root, joints = _tree(model, notes)
    frames = {root: IDENTITY} | {each.child: each.pose for each in joints}
    robot = ElementTree.Element("robot", name=model.name)
    for link in model.links:
        _add_link(robot, link, frames[link.name].inverse() @ link.pose)
    for joint in joints:
        _add_joint(robot, joint, frames[joint.parent].inverse() @ joint.pose, model.static)
    if model.static or any("world" in (each.parent, each.child) for each in model.joints):
        ElementTree.SubElement(ElementTree.SubElement(robot, "gazebo"), "static").text = "true"
    for name, tag in model.tags:
        gazebo = ElementTree.SubElement(robot, "gazebo", {"reference": name} if name else {})
        gazebo.append(_element(tag))
    return UrdfOfSdf(ElementTree.tostring(robot, encoding="unicode"), tuple(notes))


def model_name(text: str) -> str:
    """Return the model name in the text of a URDF or SDF; empty if it has none."""
    tag = re.search(r"<(?:robot|model)\b([^<>]*)>", without_comments(text))
    found = re.search(r"\bname\s*=\s*[\"']([^\"']*)[\"']", tag[1]) if tag else None
    return found[1] if found else ""


def is_sdf(text: str) -> bool:
    """Whether a text is SDF rather than URDF, by its first tag."""
    tag = re.search(r"<([A-Za-z_][\w:.-]*)", without_comments(text))
    return tag is not None and tag[1] in ROOTS


def _tree(model: SdfModel, notes: list[str]) -> tuple[str, list[SdfJoint]]:
    """Return the root link, and joints that connect all links; links without a joint are fixed to the root."""
    links = {each.name: each for each in model.links}
    if len(links) < len(model.links):
        raise BadWorld(f"the model {model.name!r} has two links of the same name")
    held: dict[str, SdfJoint] = {}
    for joint in model.joints:
        for end in (joint.parent, joint.child):
            if end not in links and end != "world":
                raise BadWorld(str(unknown_name("link", end, links, f"joint {joint.name!r}")))
        if "world" in (joint.parent, joint.child):
            if joint.kind != "fixed":
                raise BadWorld(
                    f"joint {joint.name!r} is {joint.kind} to the world: only fixed joints to the world are supported"
                )
            continue
        if joint.child in held:
            notes.append(f"joint {joint.name!r} closes a loop, and is left out")
            continue
        if joint.kind not in _KINDS:
            notes.append(f"joint {joint.name!r} of the type {joint.kind!r} is fixed here (known: {', '.join(_KINDS)})")
            joint = replace(joint, kind="fixed")
        held[joint.child] = joint
    free = [name for name in links if name not in held]
    if not free:
        raise BadWorld(f"the joints of {model.name!r} form a ring: no link is its root")
    for name in free[1:]:
        if not model.static:
            notes.append(f"no joint connects link {name!r} to {free[0]!r}: it is fixed to it")
        pose = links[name].pose
        held[name] = SdfJoint(f"{name}_fixed", "fixed", free[0], name, pose, (0.0, 0.0, 1.0), 0, 0, 0, 0, 0, 0)
    return free[0], list(held.values())


def _add_link(robot: ElementTree.Element, link: SdfLink, pose: Pose3) -> None:
    """Add a link; ``pose`` is that of its SDF frame in its URDF frame."""
    made = ElementTree.SubElement(robot, "link", name=link.name)
    if any(part.solid for part in link.parts) or link.moments is not None:
        inertial = ElementTree.SubElement(made, "inertial")
        body = WorldBody(link.name, link.parts, mass=link.mass, centre=link.centre, moments=link.moments)
        properties = mass_properties(body)
        _add_origin(inertial, pose @ Pose3(properties.centre))
        ElementTree.SubElement(inertial, "mass", value=_text(link.mass))
        x, y, z = properties.moments
        tensor = {"ixx": x, "iyy": y, "izz": z, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
        ElementTree.SubElement(inertial, "inertia", {name: _text(value) for name, value in tensor.items()})
    for part in link.parts:
        for tag, present in (("visual", part.visible), ("collision", part.solid)):
            if present:
                _add_part(made, tag, part, pose @ part.pose)
    gazebo = ElementTree.SubElement(robot, "gazebo", reference=link.name)
    for name in ("mu1", "mu2"):
        ElementTree.SubElement(gazebo, name).text = _text(link.friction)


def _add_part(link: ElementTree.Element, tag: str, part: BodyPart, pose: Pose3) -> None:
    made = ElementTree.SubElement(link, tag)
    _add_origin(made, pose)
    geometry = ElementTree.SubElement(made, "geometry")
    match part.shape:
        case BoxShape(size):
            ElementTree.SubElement(geometry, "box", size=" ".join(map(_text, size)))
        case CylinderShape(radius, length):
            ElementTree.SubElement(geometry, "cylinder", radius=_text(radius), length=_text(length))
        case SphereShape(radius):
            ElementTree.SubElement(geometry, "sphere", radius=_text(radius))
        case MeshShape(file=Path() as file, scale=scale):
            ElementTree.SubElement(geometry, "mesh", filename=f"file://{file}", scale=" ".join(map(_text, scale)))
        case _:
            raise BadWorld(
                f"link {link.get('name')!r}: height maps, polylines and ellipsoids are supported only in world files; "
                "boxes, cylinders, spheres and meshes can be spawned"
            )
    if tag == "visual":
        colour = ElementTree.SubElement(made, "material", name=f"{link.get('name')}_{len(link)}")
        ElementTree.SubElement(colour, "color", rgba=" ".join(map(_text, part.colour)))


def _add_joint(robot: ElementTree.Element, joint: SdfJoint, pose: Pose3, static: bool) -> None:
    endless = joint.lower < -_UNLIMITED or joint.upper > _UNLIMITED
    kind = "fixed" if static else "continuous" if joint.kind == "revolute" and endless else joint.kind
    made = ElementTree.SubElement(robot, "joint", name=joint.name, type=kind)
    _add_origin(made, pose)
    ElementTree.SubElement(made, "parent", link=joint.parent)
    ElementTree.SubElement(made, "child", link=joint.child)
    if kind == "fixed":
        return
    ElementTree.SubElement(made, "axis", xyz=" ".join(map(_text, joint.axis)))
    limits = {
        "effort": joint.effort if joint.effort > 0 else _NO_EFFORT,
        "velocity": joint.velocity if joint.velocity > 0 else _UNLIMITED,
    }
    if kind != "continuous":
        limits |= {"lower": max(joint.lower, -_UNLIMITED), "upper": min(joint.upper, _UNLIMITED)}
    ElementTree.SubElement(made, "limit", {name: _text(value) for name, value in limits.items()})
    dynamics = {"damping": _text(joint.damping), "friction": _text(joint.friction)}
    ElementTree.SubElement(made, "dynamics", dynamics)


def _add_origin(owner: ElementTree.Element, pose: Pose3) -> None:
    rpy = rpy_from_quaternion(pose.orientation)
    ElementTree.SubElement(owner, "origin", xyz=" ".join(map(_text, pose.position)), rpy=" ".join(map(_text, rpy)))


def _element(tag: SdfElement) -> ElementTree.Element:
    made = ElementTree.Element(tag.tag, tag.attributes)
    made.text = tag.text
    made.extend([_element(each) for each in tag.children])
    return made


def _text(value: float) -> str:
    if abs(value) > 1e300:
        raise BadInput(f"{value} is not a valid number in a model")
    return format(value, ".9g")
