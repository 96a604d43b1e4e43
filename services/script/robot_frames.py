"""The frames of one robot under their short names, for scripts written for a single robot."""

from __future__ import annotations

from collections.abc import Container

SHARED = frozenset(["map", "world", "earth"])
"""Frames that all robots share, according to REP 105."""


class RobotFrames:
    """Adds a robot's prefix to short frame names, like ROS's ``tf_prefix``; without a prefix, changes none."""

    def __init__(self, prefix: str = "") -> None:
        self._prefix = f"{prefix.strip('/')}/" if prefix.strip("/") else ""
        self.seen: set[str] = set()
        """All frames that a buffer of this process has contained."""

    def full(self, frame: str) -> str:
        """Return the name under which a script publishes a frame; frames shared by all robots keep their names."""
        if not self._prefix:
            return frame
        frame = frame.removeprefix("/")
        return frame if frame in SHARED else self.find(frame, self.seen)

    def find(self, frame: str, known: Container[str]) -> str:
        """Return the frame that a script means: its robot's, or the one with exactly this name."""
        if not self._prefix or not isinstance(frame, str) or not frame or "/" in frame:
            return frame
        own = f"{self._prefix}{frame}"
        return own if own in known or (frame not in known and frame not in SHARED) else frame
