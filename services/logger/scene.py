"""A robot's 3-D scene in a recording: its URDF, logged once, its colours, and the transforms that move it."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.urdf import UrdfTree

import models
from messages.se3 import Rotation, Vector, quaternion_multiply, rotate
from models.model import read_model
from models.palette import Colour
from models.urdf import Joint, read_joints
from services.logger import entity_paths
from services.logger.columns import Batch
from services.runtime.errors import BadInput


def lightened(full: Colour) -> Colour:
    """Return a colour halfway to white, for estimates and measurements."""
    red, green, blue = full
    return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2


def darkened(full: Colour) -> Colour:
    """Return a darker shade of a colour, for set-points and commands."""
    red, green, blue = full
    return red * 5 // 9, green * 5 // 9, blue * 5 // 9


TRAIL_WIDTH = -1.8
"""Radius of a trail; rerun interprets a negative one as points on the screen instead of metres."""

ODOMETRY_TRAIL_WIDTH = -0.9
"""Radius of the odometry trail, in the unit of TRAIL_WIDTH."""

SCAN_POINT_SIZE, GOAL_SIZE, NEXT_GOAL_SIZE = -1.6, -2.6, -5.0
"""Radii of a laser's echo, of a goal, and of the current goal, in the unit of TRAIL_WIDTH."""

DISC_MARGIN = 0.055
"""Margin of a robot's coloured disc on the ground around it [m]."""

LABEL_HEIGHT, ARM_LABEL_HEIGHT = 0.6, 1.6
"""Height of the name above the ground [m], for mobile robots and for arms."""

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class RobotScene:
    """The robot ``name`` with the model ``model``, whose frames begin with ``prefix``.

    Raises BadInput for an unknown model or an unreadable URDF. ``is_arm`` is true for robots without wheels.
    """

    def __init__(self, name: str, model: str, prefix: str, colour: Colour) -> None:
        self.name, self.colour, self._prefix = name, colour, prefix
        try:
            urdf = models.viewer_urdf_path(model)
            self._tree = UrdfTree.from_file_path(
                urdf, entity_path_prefix=name, frame_prefix=prefix, static_transform_entity_path=f"{name}/tf_static"
            )
        except models.UnknownModel as error:
            raise BadInput(f"logger, robot {name}: {error}") from None
        except (RuntimeError, ValueError, OSError) as error:
            raise BadInput(
                f"logger, robot {name}: the URDF of {models.display_name(model)} cannot be read: {error}"
            ) from None
        figures = read_model(model)
        self.is_arm = not figures.has_base
        self._radius = figures.radius + DISC_MARGIN
        self._joints = {joint.name: joint for joint in read_joints(model) if joint.single_dof}
        self.tree_name = self._tree.name
        self._frame = f"{prefix}{self._tree.root_link().name}"

    def log_to(self, stream: rr.RecordingStream) -> None:
        """Log the static parts: geometry, fixed transforms, styles of trail and reference path."""
        self._tree.log_urdf_to_recording(stream)
        if not self.is_arm:
            self._log_disc(stream)
        stream.log(
            f"{entity_paths.marker(self.name)}/name",
            rr.CoordinateFrame(self._frame),
            rr.Points3D(
                [(0, 0, ARM_LABEL_HEIGHT if self.is_arm else LABEL_HEIGHT)],
                radii=[0.0],
                colors=[self.colour],
                labels=[self.name],
                show_labels=True,
            ),
            static=True,
        )
        stream.log(
            entity_paths.trail(self.name),
            rr.CoordinateFrame("world"),
            rr.LineStrips3D.from_fields(colors=[self.colour], radii=[TRAIL_WIDTH]),
            static=True,
        )
        stream.log(entity_paths.reference(self.name), rr.CoordinateFrame("world"), static=True)
        stream.log(
            entity_paths.odometry_trail(self.name),
            rr.CoordinateFrame("world"),
            rr.LineStrips3D.from_fields(colors=[lightened(self.colour)], radii=[ODOMETRY_TRAIL_WIDTH]),
            static=True,
        )
        for entity, colour, size in (
            (entity_paths.goals(self.name), darkened(self.colour), GOAL_SIZE),
            (entity_paths.goal(self.name), self.colour, NEXT_GOAL_SIZE),
            (entity_paths.scan(self.name), lightened(self.colour), SCAN_POINT_SIZE),
        ):
            points = rr.Points3D.from_fields(colors=[colour], radii=[size])
            stream.log(entity, rr.CoordinateFrame("world"), points, static=True)

    def _log_disc(self, stream: rr.RecordingStream) -> None:
        stream.log(
            entity_paths.marker(self.name),
            rr.CoordinateFrame(self._frame),
            rr.Cylinders3D(
                lengths=[0.002],
                radii=[self._radius],
                centers=[(0, 0, 0.002)],
                colors=[(*self.colour, 150)],
                fill_mode="solid",
            ),
            static=True,
        )

    def transforms(self, batch: Batch) -> tuple[Stamps, rr.ComponentColumnList]:
        """Return times and rows of the moving transforms; each replaces a whole transform, including its frames."""
        times, positions, quaternions = [batch.times], [batch.positions], [batch.quaternions]
        parents, children = ["world"] * len(batch.times), [self._frame] * len(batch.times)
        for name, angles in zip(batch.joints, batch.angles.T, strict=True):
            if (joint := self._joints.get(name)) is not None and len(angles):
                times.append(batch.joint_times)
                at, turn = joint_transforms(joint, angles)
                positions.append(at)
                quaternions.append(turn)
                parents += [f"{self._prefix}{joint.parent}"] * len(angles)
                children += [f"{self._prefix}{joint.child}"] * len(angles)
        all_times = np.concatenate(times)
        order = np.argsort(all_times, kind="stable")
        columns = rr.Transform3D.columns(
            translation=np.concatenate(positions)[order],
            quaternion=np.concatenate(quaternions)[order],
            parent_frame=[parents[i] for i in order],
            child_frame=[children[i] for i in order],
        )
        return all_times[order], columns


def joint_transforms(joint: Joint, positions: Floats) -> tuple[Floats, Floats]:
    """Return the child's poses in the parent of a joint at ``positions`` (n,) [rad; m if prismatic]: translations (n,
    3) and quaternions (n, 4)."""
    places = np.tile(joint.xyz, (len(positions), 1))
    if joint.kind != "prismatic":
        return places, joint_rotations(joint.rotation(), joint.axis, positions)
    along = np.array(rotate(joint.rotation(), joint.axis))
    return places + positions[:, None] * along, np.tile(joint.rotation(), (len(positions), 1))


def joint_rotations(mount: Rotation, axis: Vector, angles: Floats) -> Floats:
    """Return the quaternions (n, 4) of a joint mounted as ``mount`` and rotated about ``axis`` by ``angles`` (n,)
    [rad].

    The product ``mount * (axis sin(a/2), cos(a/2))``, components x, y, z, w.
    """
    i, j, k = (part * np.sin(angles / 2) for part in axis)
    return np.column_stack(quaternion_multiply(mount, (i, j, k, np.cos(angles / 2))))
