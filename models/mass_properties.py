"""Mass properties of the bodies of a world, from their shapes."""

from __future__ import annotations

import math
from typing import NamedTuple

from messages.se3 import Pose3, Vector, rotated_axes
from models.bodies import BodyPart, BoxShape, CylinderShape, RampShape, SphereShape, WorldBody
from models.shape_mesh import shape_mesh


class MassProperties(NamedTuple):
    """Centre of mass [m] in the body's frame, and moments of inertia [kg m2] about that frame's axes through it."""

    centre: Vector
    moments: Vector


def box_inertia(mass: float, size: Vector) -> Vector:
    """Return the moments of inertia [kg m2] of a homogeneous box about its centre: m (b^2 + c^2) / 12."""
    x, y, z = (each * each for each in size)
    return mass * (y + z) / 12, mass * (x + z) / 12, mass * (x + y) / 12


def mass_properties(body: WorldBody) -> MassProperties:
    """Return the stated mass properties, or else those of its shapes at equal density, without products of inertia.

    A mesh is approximated by its bounding box; a ramp is a wedge.
    """
    parts = [part for part in body.parts if part.solid] or list(body.parts)
    volumes = [_volume_and_centre(part) for part in parts]
    total = sum(volume for volume, _ in volumes)
    shares = [volume / total for volume, _ in volumes]
    centre = body.centre or (
        sum(share * middle[0] for share, (_, middle) in zip(shares, volumes, strict=True)),
        sum(share * middle[1] for share, (_, middle) in zip(shares, volumes, strict=True)),
        sum(share * middle[2] for share, (_, middle) in zip(shares, volumes, strict=True)),
    )
    moments = [0.0, 0.0, 0.0]
    for part, share, (_, middle) in zip(parts, shares, volumes, strict=True):
        own, axes = _moments_of_unit_mass(part), rotated_axes(part.pose.orientation)
        away = [middle[axis] - centre[axis] for axis in range(3)]
        for axis in range(3):
            turned = sum(axes[k][axis] ** 2 * own[k] for k in range(3))
            steiner = sum(away[k] ** 2 for k in range(3) if k != axis)
            moments[axis] += body.mass * share * (turned + steiner)
    return MassProperties(centre, body.moments or (moments[0], moments[1], moments[2]))


def _volume_and_centre(part: BodyPart) -> tuple[float, Vector]:
    """Return the volume [m3] of a part and its centre in the body's frame [m]."""
    shape = part.shape
    match shape:
        case CylinderShape(radius, length):
            return math.pi * radius**2 * length, part.pose.position
        case SphereShape(radius):
            return 4 / 3 * math.pi * radius**3, part.pose.position
        case BoxShape((x, y, z)):
            return x * y * z, part.pose.position
        case RampShape((x, y, z)):
            return x * y * z / 2, _in_body(part, (x / 6, 0.0, -z / 6))
        case _:
            low, high = shape_mesh(shape).bounds.tolist()
            sizes = [max(1e-6, b - a) for a, b in zip(low, high, strict=True)]
            x, y, z = ((a + b) / 2 for a, b in zip(low, high, strict=True))
            return sizes[0] * sizes[1] * sizes[2], _in_body(part, (x, y, z))


def _in_body(part: BodyPart, point: Vector) -> Vector:
    return (part.pose @ Pose3(point)).position


def _moments_of_unit_mass(part: BodyPart) -> Vector:
    """Return the moments of inertia of the shape per mass [m2] about its own axes through its centre."""
    match part.shape:
        case SphereShape(radius):
            each = 0.4 * radius**2
            return each, each, each
        case CylinderShape(radius, length):
            across = radius**2 / 4 + length**2 / 12
            return across, across, radius**2 / 2
        case BoxShape(size):
            return box_inertia(1.0, size)
        case RampShape((x, y, z)):
            return y * y / 12 + z * z / 18, (x * x + z * z) / 18, x * x / 18 + y * y / 12
        case shape:
            low, high = shape_mesh(shape).bounds.tolist()
            x, y, z = (max(1e-3, b - a) for a, b in zip(low, high, strict=True))
            return box_inertia(1.0, (x, y, z))
