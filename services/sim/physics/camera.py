"""A picture of a PyBullet world, drawn by its software renderer: it needs neither display nor GPU."""

from __future__ import annotations

import math

import numpy as np

from services.sim.physics.quiet import pybullet
from services.sim.physics.rotation import matrix
from services.sim.physics.world import Lens, Placement


def render(client: int, eye: Placement, lens: Lens) -> bytes:
    """The picture seen from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel."""
    turn = matrix(eye.orientation)
    position = np.array(eye.position)
    view = pybullet.computeViewMatrix(
        position.tolist(), (position + turn[:, 2]).tolist(), (-turn[:, 1]).tolist(), physicsClientId=client
    )
    aspect = lens.width / lens.height
    upright = 2 * math.atan(math.tan(lens.fov / 2) / aspect)
    projection = pybullet.computeProjectionMatrixFOV(
        math.degrees(upright), aspect, lens.near, lens.far, physicsClientId=client
    )
    shot = pybullet.getCameraImage(
        lens.width,
        lens.height,
        view,
        projection,
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
        physicsClientId=client,
    )
    pixels = np.asarray(shot[2], np.uint8).reshape(lens.height, lens.width, 4)
    return pixels[:, :, :3].tobytes()
