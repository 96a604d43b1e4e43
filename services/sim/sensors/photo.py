"""Pictures of a robot's camera as messages: taken only while somebody looks, since drawing one takes 30 ms."""

from __future__ import annotations

import math

from messages.sensor import CameraInfo, Image
from messages.std import Header
from models.figures import Camera
from services.sim.physics.world import Lens, World


def photograph(world: World, robot: str, camera: Camera, header: Header) -> Image:
    """What the robot's camera sees, ``rgb8``; the header's frame should be the camera's optical one."""
    lens = Lens(camera.width, camera.height, camera.fov, camera.near, camera.far)
    pixels = world.picture(world.link_placement(robot, camera.link), lens)
    return Image(
        header=header,
        height=camera.height,
        width=camera.width,
        encoding="rgb8",
        step=3 * camera.width,
        data=pixels,
    )


def calibration(camera: Camera, header: Header) -> CameraInfo:
    """The camera's intrinsics: square pixels, no distortion, the principal point in the middle.

    The focal length in pixels is f = (width / 2) / tan(fov / 2).
    """
    focal = camera.width / 2 / math.tan(camera.fov / 2)
    cx, cy = camera.width / 2, camera.height / 2
    return CameraInfo(
        header=header,
        height=camera.height,
        width=camera.width,
        d=(0.0,) * 5,
        k=(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0),
        r=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        p=(focal, 0.0, cx, 0.0, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0),
    )
