"""What the logger takes from the tree of frames: where odometries begin and lasers are mounted, which is fixed."""

from __future__ import annotations

from services.logger.alignment import Alignment
from services.runtime.errors import NoTransform
from services.runtime.frames.buffer import FrameBuffer
from services.runtime.frames.rigid import HERE, Rigid

WORLD = "world"


def lies_in_world(frames: FrameBuffer, frame: str) -> Alignment | None:
    """Where a frame lies in the world, on the ground; None when ``/tf_static`` does not tell."""
    if frame in ("", WORLD):
        return Alignment()
    if (found := mounted(frames, WORLD, frame)) is None:
        return None
    return Alignment(x=found.place[0], y=found.place[1], yaw=found.rpy[2])


def mounted(frames: FrameBuffer, base: str, frame: str) -> Rigid | None:
    """Where a frame lies in ``base``; None when ``/tf_static`` does not tell."""
    if base == frame:
        return HERE
    try:
        found = frames.lookup(base, frame)
    except NoTransform:
        return None
    return found.rigid if found.time is None else None
