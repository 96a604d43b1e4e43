"""A ring of sonars: what each hears, as ranges and as a cloud of points. Readings are made while somebody listens."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from messages.base import Float32Array
from messages.geometry import Point32
from messages.sensor import ChannelFloat32, PointCloud, Range
from messages.std import Header
from models.figures import Sonar
from models.frames import read_joints
from services.sim.physics.rotation import matrix
from services.sim.physics.world import World

CIRCLES = 3
"""Circles of rays around a cone's axis: 1 + 6 + 12 + 18 = 37 rays. In a cone of 30 degrees they are 5 degrees apart, so
that what lies between them seems farther by 0.13 %."""

ABOVE_GROUND = 0.001
"""Rays end this high above the ground, m: it gives no echo, since sound that meets it so flat is reflected away."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Ring:
    """The ``n`` sonars of a robot in the frame ``figures.link``: where they are [m] and look, both of shape (n, 3),
    and the rays of their cones, unit vectors of shape (n, m, 3)."""

    figures: Sonar
    places: Floats
    axes: Floats
    rays: Floats


def ring_of(model: str, figures: Sonar) -> Ring:
    """The ring of the robot ``model``, its sonars where the URDF mounts their links on ``figures.link``."""
    mounts = {joint.child: joint for joint in read_joints(model) if joint.parent == figures.link}
    turns = [matrix(mounts[link].rotation()) for link in figures.links]
    return Ring(
        figures=figures,
        places=np.array([mounts[link].xyz for link in figures.links]),
        axes=np.array([each[:, 0] for each in turns]),
        rays=np.array([cone(figures.cone) @ each.T for each in turns]),
    )


def cone(angle: float) -> Floats:
    """Unit vectors in a cone about the x axis, shape (m, 3): the axis, then ``CIRCLES`` circles, the last at
    ``angle / 2`` [rad] from it."""
    vectors = [(1.0, 0.0, 0.0)]
    for circle in range(1, CIRCLES + 1):
        off = angle / 2 * circle / CIRCLES
        for step in range(6 * circle):
            around = 2 * math.pi * step / (6 * circle)
            vectors.append((math.cos(off), math.sin(off) * math.cos(around), math.sin(off) * math.sin(around)))
    return np.array(vectors)


def measure(world: World, robot: str, ring: Ring, noise: np.random.Generator | None = None) -> Floats:
    """How far each sonar's nearest echo is, m, shape (n,); all at the same instant.

    inf without an echo up to ``range_max``, -inf for one nearer than ``range_min`` (REP 117). Whatever stands in the
    cone gives an echo, however oblique. Sixteen sonars take about 2 ms.
    """
    figures = ring.figures
    eye = world.link_placement(robot, figures.link)
    turn = matrix(eye.orientation)
    rays = ring.rays @ turn.T
    starts = np.repeat((np.array(eye.position) + ring.places @ turn.T)[:, None, :], rays.shape[1], axis=1)
    fall = np.minimum(rays[:, :, 2], -1e-12)
    reach = np.clip((ABOVE_GROUND - starts[:, :, 2]) / fall, ABOVE_GROUND, figures.range_max)
    ends = starts + reach[:, :, None] * rays
    fractions = world.rays(starts.reshape(-1, 3), ends.reshape(-1, 3)).reshape(reach.shape)
    ranges: Floats = (reach * fractions).min(axis=1)
    if noise is not None:
        heard = np.isfinite(ranges)
        errors = noise.normal(0.0, figures.noise, len(ranges))
        ranges[heard] = np.minimum(ranges + errors, figures.range_max)[heard]
    ranges[ranges < figures.range_min] = -np.inf
    return ranges


def cloud(ring: Ring, ranges: Floats, header: Header) -> PointCloud:
    """The echoes as points, in the order of the sonars, as RosAria publishes them; the header's frame is the ring's.

    Every sonar has a point on its axis: one that hears nothing at ``range_max``, as ARIA reports it, one whose echo is
    too near at ``range_min``. The channel ``range`` has the readings themselves.
    """
    shown = np.clip(ranges, ring.figures.range_min, ring.figures.range_max)
    return PointCloud(
        header=header,
        points=tuple(Point32(x=x, y=y, z=z) for x, y, z in (ring.places + shown[:, None] * ring.axes).tolist()),
        channels=(ChannelFloat32(name="range", values=Float32Array(ranges)),),
    )


def ranges_of(ring: Ring, ranges: Floats, headers: Sequence[Header]) -> list[Range]:
    """The readings one by one; each sonar's header has its own frame."""
    figures = ring.figures
    return [
        Range(
            header=header,
            radiation_type=Range.ULTRASOUND,
            field_of_view=figures.cone,
            min_range=figures.range_min,
            max_range=figures.range_max,
            range=reading,
        )
        for header, reading in zip(headers, ranges.tolist(), strict=True)
    ]
