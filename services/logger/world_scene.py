"""The world in a recording: its bodies, logged once, and the transforms of the moving ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from messages.errors import BadInput
from messages.gazebo import WorldStates
from messages.geometry import Pose
from messages.visualization import MarkerArray
from services.logger import entity_paths
from services.logger.marker_shapes import marker_shape
from services.markers.world_bodies import FIXED, GROUND, world_bodies

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


class WorldScene:
    """The bodies of the world; what cannot be displayed is reported to ``warn``.

    States of moving bodies are added by ``add_states`` and drained by ``transforms``.
    """

    def __init__(self, array: MarkerArray, warn: Callable[[str], None]) -> None:
        self._bodies, self._warn = world_bodies(array), warn
        self._moving = {body.name for body in self._bodies if body.kind not in (FIXED, GROUND)}
        self._rows: list[tuple[int, str, Pose]] = []

    @property
    def extent(self) -> tuple[float, float, float, float] | None:
        """The ground area [m] of the bodies at the start, as in the blueprint; None without bodies."""
        parts = []
        for body in self._bodies:
            with suppress(BadInput):
                parts += body.footprints()
        if not parts:
            return None
        outlines = np.concatenate([part.polygon() for part in parts])
        (left, bottom), (right, top) = outlines.min(axis=0).tolist(), outlines.max(axis=0).tolist()
        return left, bottom, right, top

    def log_to(self, stream: rr.RecordingStream) -> None:
        """Log the shapes of all bodies."""
        for body in self._bodies:
            for number, marker in enumerate(body.markers):
                try:
                    shape = marker_shape(marker)
                except BadInput as error:
                    self._warn(f"{body.name} is not drawn: {error}")
                    continue
                entity = f"{entity_paths.WORLD_BODIES}/{rr.escape_entity_path_part(body.name)}/{number}"
                if body.name in self._moving:
                    stream.log(entity, rr.CoordinateFrame(_frame(body.name)), shape, static=True)
                    continue
                # A separate frame, fixed in the world.
                frame, (p, q) = f"{_frame(body.name)}/{number}", (marker.pose.position, marker.pose.orientation)
                place = rr.Transform3D(
                    translation=(p.x, p.y, p.z),
                    quaternion=rr.Quaternion(xyzw=(q.x, q.y, q.z, q.w)),
                    parent_frame="world",
                    child_frame=frame,
                )
                stream.log(entity, rr.CoordinateFrame(frame), shape, static=True)
                stream.log(f"{entity}/pose", place, static=True)

    def begin(self, time: int = 0) -> None:
        """Reset moving bodies to their start poses, at ``time`` [ns] of a new timeline."""
        self._rows = [(time, body.name, body.markers[0].pose) for body in self._bodies if body.name in self._moving]

    def add_states(self, messages: Sequence[WorldStates]) -> None:
        """Add states of the bodies, oldest first."""
        for message in messages:
            stamp = message.header.stamp.ns
            self._rows += [
                (stamp, name, pose)
                for name, pose in zip(message.name, message.pose, strict=False)
                if name in self._moving
            ]

    def transforms(self) -> tuple[Stamps, rr.ComponentColumnList] | None:
        """Return times and rows of the transforms since the last call; None without any."""
        rows, self._rows = sorted(self._rows, key=lambda row: row[0]), []
        if not rows:
            return None
        places = np.array([(pose.position.x, pose.position.y, pose.position.z) for _, _, pose in rows])
        turns = [pose.orientation for _, _, pose in rows]
        columns = rr.Transform3D.columns(
            translation=places,
            quaternion=np.array([(each.x, each.y, each.z, each.w) for each in turns]),
            parent_frame=["world"] * len(rows),
            child_frame=[_frame(name) for _, name, _ in rows],
        )
        return np.array([time for time, _, _ in rows], np.int64), columns


def _frame(name: str) -> str:
    """Return the frame of a body in the recording, distinct from robots' frames."""
    return f"world/{name}"
