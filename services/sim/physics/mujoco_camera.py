"""Camera images in MuJoCo: by OpenGL on a GPU or in software (EGL), or by OSMesa; neither needs a display."""

from __future__ import annotations

import ctypes
import importlib
import math
import os
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from messages.se3 import Pose3, rotated_axes
from models.world import WorldDescription
from services.runtime.errors import BadInput
from services.sim.physics._mujoco import mujoco
from services.sim.physics.mujoco_scene import PlacedRobot, SceneBuilder
from services.sim.physics.world import CameraModel

LIBRARIES: Mapping[str, tuple[str, ...]] = {
    "egl": ("libEGL.so.1", "libEGL.so"),
    "osmesa": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}
"""The OpenGL libraries to try in turn, and their file names."""
_PLATFORM = "PYOPENGL_PLATFORM"
_CONTEXTS = ("mujoco.egl", "mujoco.egl.egl_ext", "mujoco.osmesa")
_MAX_SHAPES = 100_000
_SKY = 255
"""Background: white, as in PyBullet's images."""


class MujocoCamera:
    """Renders a world with robots at the positions of ``data``. OpenGL is opened for the first image."""

    def __init__(self, world: WorldDescription, robots: tuple[PlacedRobot, ...]) -> None:
        self._world, self._robots = world, robots
        self._size = 0, 0
        self._context: Any = None

    def render(self, data: Any, eye: Pose3, camera: CameraModel) -> bytes:
        """Render the image from ``eye`` (z forward, x right, y down): rows from the top, three bytes RGB per pixel."""
        width, height = camera.width, camera.height
        if width > self._size[0] or height > self._size[1]:
            self._open(max(width, self._size[0]), max(height, self._size[1]))
        self._context.make_current()
        self._data.qpos[:], self._data.mocap_pos[:], self._data.mocap_quat[:] = (
            data.qpos,
            data.mocap_pos,
            data.mocap_quat,
        )
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        category = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, mujoco.MjvCamera(), category, self._scene)
        self._aim(eye, camera)
        view = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(view, self._scene, self._drawing)
        pixels, depth = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
        mujoco.mjr_readPixels(pixels, depth, view, self._drawing)
        # The depth buffer is reversed: empty pixels are at 0 or at 1.
        pixels[(depth >= 1.0) | (depth <= 0.0)] = _SKY
        return pixels[::-1].tobytes()

    def close(self) -> None:
        """Close OpenGL."""
        if self._context is not None:
            self._context.make_current()
            self._drawing.free()
            self._context.free()
            self._context, self._size = None, (0, 0)

    def _open(self, width: int, height: int) -> None:
        self.close()
        self._context = open_context(width, height)
        self._context.make_current()
        builder = SceneBuilder(self._world, 1.0, (width, height))
        for body in self._world.all_bodies:
            builder.add_body(body)
        for robot in self._robots:
            builder.add_robot(robot)
        self._model = builder.compile().model
        self._data = mujoco.MjData(self._model)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = 1
        self._scene = mujoco.MjvScene(self._model, maxgeom=_MAX_SHAPES)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._drawing = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._drawing)
        self._size = width, height

    def _aim(self, eye: Pose3, camera: CameraModel) -> None:
        axes = np.array(rotated_axes(eye.orientation)).T
        top = camera.near * math.tan(camera.fov / 2) * camera.height / camera.width
        for each in self._scene.camera:
            each.pos[:], each.forward[:], each.up[:] = eye.position, axes[:, 2], -axes[:, 1]
            each.frustum_center, each.frustum_width = 0.0, 0.0
            each.frustum_bottom, each.frustum_top = -top, top
            each.frustum_near, each.frustum_far = camera.near, camera.far


def open_context(width: int, height: int) -> Any:
    """Open an OpenGL context without a display; raises BadInput if no library for it works."""
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    faults = []
    for name in (chosen,) if chosen in LIBRARIES else LIBRARIES:
        if not any(map(_loads, LIBRARIES[name])):
            faults.append(f"{name}: {LIBRARIES[name][0]} is not installed")
            continue
        platform = os.environ.get(_PLATFORM)
        try:
            module = importlib.import_module(f"mujoco.{name}")
            return module.GLContext(width, height)
        except Exception as error:  # noqa: BLE001  (a foreign library that is missing or broken may raise anything)
            faults.append(f"{name}: {error or type(error).__name__}")
        _forget_opengl(platform)
    raise BadInput(
        "the camera cannot render: MuJoCo needs OpenGL, and no OpenGL library works here; on Debian, "
        f"apt install libegl1 libgl1 libgl1-mesa-dri, or libosmesa6 ({'; '.join(faults)})"
    )


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _forget_opengl(platform: str | None) -> None:
    """Unload PyOpenGL, so that another library can be tried: it is bound to the first one at import."""
    if platform is None:
        os.environ.pop(_PLATFORM, None)
    for name in [each for each in sys.modules if each.split(".")[0] == "OpenGL" or each in _CONTEXTS]:
        del sys.modules[name]
