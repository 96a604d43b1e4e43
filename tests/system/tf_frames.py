"""Composition of transforms from tf and tf_static."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from messages.geometry import Pose
from messages.se3 import Rotation, Vector, quaternion_multiply, rotate
from messages.tf import TFMessage


class Frame(NamedTuple):
    """A frame's transform in its parent: translation [m], rotation (x, y, z, w), simulation time [ns]."""

    parent: str
    translation: Vector
    rotation: Rotation
    stamp: int = 0


def frames_by_name(message: TFMessage) -> dict[str, Frame]:
    """Return the frames of a message by name."""
    return {
        each.child_frame_id: Frame(
            each.header.frame_id,
            (each.transform.translation.x, each.transform.translation.y, each.transform.translation.z),
            (
                each.transform.rotation.x,
                each.transform.rotation.y,
                each.transform.rotation.z,
                each.transform.rotation.w,
            ),
            each.header.stamp.ns,
        )
        for each in message.transforms
    }


def frame_of_pose(pose: Pose) -> Frame:
    """Return a pose in the world as a frame."""
    p, q = pose.position, pose.orientation
    return Frame("world", (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def frame_in_world(frames: Mapping[str, Frame], name: str) -> Frame:
    """Return the frame ``name`` in the world, composed along its parents."""
    here = frames[name]
    while here.parent != "world":
        above = frames[here.parent]
        shift = rotate(above.rotation, here.translation)
        place = (above.translation[0] + shift[0], above.translation[1] + shift[1], above.translation[2] + shift[2])
        here = Frame(above.parent, place, quaternion_multiply(above.rotation, here.rotation))
    return here
