"""The frames of one robot under their short names, for scripts that were written for a single robot."""

from __future__ import annotations

from collections.abc import Container

SHARED = frozenset(["map", "world", "earth"])
"""Frames that all robots have in common, as REP 105 has it."""


class RobotFrames:
    """Gives short names of frames the prefix of a robot, as ROS's ``tf_prefix``; without a prefix, changes none."""

    def __init__(self, prefix: str = "") -> None:
        self._prefix = f"{prefix.strip('/')}/" if prefix.strip("/") else ""
        self.seen: set[str] = set()
        """All frames that a buffer of this process has had."""

    def full(self, frame: str) -> str:
        """The name under which a script publishes a frame: a known frame of all robots keeps its own."""
        if not self._prefix:
            return frame
        frame = frame.removeprefix("/")
        return frame if frame in SHARED else self.find(frame, self.seen)

    def find(self, frame: str, known: Container[str]) -> str:
        """The frame that a script means: its robot's, or the one that has this very name."""
        if not self._prefix or not isinstance(frame, str) or not frame or "/" in frame:
            return frame
        own = f"{self._prefix}{frame}"
        return own if own in known or (frame not in known and frame not in SHARED) else frame
