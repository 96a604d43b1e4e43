"""Explains why a transform is not known, in the words of ROS 1's tf2, which scripts print and students search for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, NamedTuple

from services.runtime.errors import FrameLoop, NoTransform
from services.runtime.tf.buffer import TransformBuffer

MOST_OF_ONE_SAMPLE = 115
"""Maximum length of tf2's sentence about a frame with one sample."""


class TransformFailure(NamedTuple):
    """An error of tf2: its exception class, and the text."""

    kind: Literal["lookup", "connectivity", "extrapolation"]
    text: str


def explain(
    buffer: TransformBuffer, error: NoTransform, target: str, source: str, time: int | None
) -> TransformFailure:
    """Return tf2's error where ``buffer.lookup(target, source, time)`` raised ``error``; both frames are known.

    tf2 climbs from the source to the root, then from the target until it meets that path, and reports the first frame
    without data; one on the source's side only matters if the two paths do not meet.
    """
    if isinstance(error, FrameLoop):
        return TransformFailure("lookup", f"The tf tree is invalid because it contains a loop.\n{described(buffer)}\n")
    if time is None:
        above, below = _line(buffer, target), _line(buffer, source)
        spans = [span for frame in _between(above, below) if (span := buffer.span(frame)) is not None]
        if above[-1] != below[-1] or not spans:
            return TransformFailure("connectivity", unconnected(target, source))
        time = min(newest for _, newest in spans)
    top, reason = source, ""
    while not (reason := _outside(buffer, top, time)) and (parent := buffer.parent(top, time)) is not None:
        top = parent
    frame: str | None = target
    while frame is not None and frame != top:
        reason = _outside(buffer, frame, time) or reason
        frame = None if _outside(buffer, frame, time) else buffer.parent(frame, time)
    if not reason:
        return TransformFailure("connectivity", unconnected(target, source))
    return TransformFailure(
        "extrapolation", f"{reason}, when looking up transform from frame [{source}] to frame [{target}]"
    )


def unconnected(target: str, source: str) -> str:
    """Return the text that no transforms connect two frames."""
    return (
        f"Could not find a connection between '{target}' and '{source}' because they are not part of the same tree."
        "Tf has two or more unconnected trees."
    )


def described(buffer: TransformBuffer, frames: Iterable[str] | None = None) -> str:
    """Return a line for each frame with a parent."""
    parents = {frame: buffer.parent(frame) for frame in (buffer.frames() if frames is None else frames)}
    return "".join(f"Frame {frame} exists with parent {parent}.\n" for frame, parent in parents.items() if parent)


def _line(buffer: TransformBuffer, frame: str) -> list[str]:
    """Return the frame and its ancestors."""
    line = [frame]
    while (parent := buffer.parent(line[-1])) is not None and parent not in line:
        line.append(parent)
    return line


def _between(above: list[str], below: list[str]) -> list[str]:
    """Return the frames of two paths below their common ancestor."""
    common = set(above) & set(below)
    return [frame for frame in (*above, *below) if frame not in common]


def _outside(buffer: TransformBuffer, frame: str, time: int) -> str:
    """Return the text that a frame is not known at a time, or ""."""
    span = buffer.span(frame)
    if span is None or span[0] <= time <= span[1]:
        return ""
    oldest, newest = span
    if oldest == newest:
        text = (
            f"Lookup would require extrapolation at time {_seconds(time)}, but only time {_seconds(newest)} is in the "
            "buffer"
        )
        return text[:MOST_OF_ONE_SAMPLE]
    if time > newest:
        return (
            f"Lookup would require extrapolation {_seconds(time - newest)}s into the future.  Requested time "
            f"{_seconds(time)} but the latest data is at time {_seconds(newest)}"
        )
    return (
        f"Lookup would require extrapolation {_seconds(oldest - time)}s into the past.  Requested time "
        f"{_seconds(time)} but the earliest data is at time {_seconds(oldest)}"
    )


def _seconds(ns: int) -> str:
    return f"{ns // 10**9}.{ns % 10**9:09d}"
