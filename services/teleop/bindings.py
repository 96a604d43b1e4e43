"""What each key means: the table of teleop_twist_keyboard (ros-teleop/teleop_twist_keyboard)."""

from __future__ import annotations

from typing import NamedTuple


class Direction(NamedTuple):
    """Parts of the speed ahead, to the left and up, and of the turn rate to the left; -1, 0 or 1 each."""

    x: int
    y: int
    z: int
    yaw: int


class Scale(NamedTuple):
    """Factors of speed and turn rate."""

    speed: float
    turn: float


NOWHERE = Direction(0, 0, 0, 0)

MOVES = {
    "i": Direction(1, 0, 0, 0),
    "o": Direction(1, 0, 0, -1),
    "j": Direction(0, 0, 0, 1),
    "l": Direction(0, 0, 0, -1),
    "u": Direction(1, 0, 0, 1),
    ",": Direction(-1, 0, 0, 0),
    ".": Direction(-1, 0, 0, 1),
    "m": Direction(-1, 0, 0, -1),
    "I": Direction(1, 0, 0, 0),
    "O": Direction(1, -1, 0, 0),
    "J": Direction(0, 1, 0, 0),
    "L": Direction(0, -1, 0, 0),
    "U": Direction(1, 1, 0, 0),
    "<": Direction(-1, 0, 0, 0),
    ">": Direction(-1, -1, 0, 0),
    "M": Direction(-1, 1, 0, 0),
    "t": Direction(0, 0, 1, 0),
    "b": Direction(0, 0, -1, 0),
}
"""With shift, a holonomic base goes sideways where another one turns."""

SCALES = {
    "q": Scale(1.1, 1.1),
    "z": Scale(0.9, 0.9),
    "w": Scale(1.1, 1.0),
    "x": Scale(0.9, 1.0),
    "e": Scale(1.0, 1.1),
    "c": Scale(1.0, 0.9),
}

KEYS = """\
   move        with shift: sideways      u i o      U I O
                                         j k l      J K L
                                         m , .      M < >
   t/b         up, down
   q/z         speed and turn 10 % up, down
   w/x         speed alone
   e/c         turn alone
   any other key stops; Ctrl-C ends
"""
"""The table as it is shown."""
