"""From the bytes of a terminal to keys."""

from __future__ import annotations

from services.teleop.keys import Press

ESCAPE_S = 0.05
"""A byte later than this after an escape does not belong to its sequence."""
OTHER = "other"
"""Stands for every key without a printable ASCII character: arrows, function keys, letters with accents."""


class Decoder:
    """Takes a terminal's bytes apart.

    An escape sequence is one key without a meaning here, however it is cut: the O in the one of F1, or of an arrow,
    must not drive the robot. It counts as soon as it begins, since it stops the robot.
    """

    def __init__(self) -> None:
        self._state = ""
        self._heard = 0.0

    def feed(self, data: bytes, at: float, stall: float = 0.0) -> list[Press]:
        """The keys in ``data``, read at ``at`` [s] after a ``stall``."""
        if self._state and at - self._heard > ESCAPE_S:
            self._state = ""
        self._heard = at
        return [Press(key, at, stall=stall) for byte in data if (key := self._key(byte))]

    def _key(self, byte: int) -> str:
        """The key that a byte is or begins; empty inside of one."""
        if byte == 0x1B:
            self._state = "escape"
            return OTHER
        match self._state:
            case "escape":
                # ESC [ ... final byte; ESC O byte; ESC byte is a key with Alt.
                self._state = {0x5B: "control", 0x4F: "single"}.get(byte, "")
                return ""
            case "control":
                if 0x40 <= byte <= 0x7E:
                    self._state = ""
                return ""
            case "single":
                self._state = ""
                return ""
        return chr(byte) if 0x20 <= byte <= 0x7E else OTHER
