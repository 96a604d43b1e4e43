"""Keyboard events, the key bindings of teleop_twist_keyboard and turtle_teleop_key, and the commanded velocity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

from services.teleop import MIN_SPEED, TeleopParameters
from services.teleop.hold_detector import HoldDetector, pressed, reset


class KeyEvent(NamedTuple):
    """A key press, repeat or release.

    Attributes:
        key: The character; ``up``, ``down``, ``left`` or ``right`` for an arrow key.
        time: Time of the event [s], on the source's clock.
        released: The key was released, on keyboards that report it.
        stall: How much earlier [s] the event may have happened, because the reader was delayed.
    """

    key: str
    time: float
    released: bool = False
    stall: float = 0.0


class Keyboard(Protocol):
    """A keyboard; ``with`` acquires it and restores it."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def read_events(self, within: float) -> list[KeyEvent]:
        """Return the key events since the last call, oldest first; wait up to ``within`` [s] for the first.

        Times are those of ``time.monotonic``. Raises Stopped when the keyboard is gone.
        """
        ...


class Direction(NamedTuple):
    """Signs of the velocity forwards, left and up, and of the turn rate to the left; each -1, 0 or 1."""

    x: int
    y: int
    z: int
    yaw: int


class Scale(NamedTuple):
    """Factors that a key applies to speed and turn rate."""

    speed: float
    turn: float


NO_DIRECTION = Direction(0, 0, 0, 0)

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
    "up": Direction(1, 0, 0, 0),
    "down": Direction(-1, 0, 0, 0),
    "left": Direction(0, 0, 0, 1),
    "right": Direction(0, 0, 0, -1),
    "t": Direction(0, 0, 1, 0),
    "b": Direction(0, 0, -1, 0),
}
"""With shift, a holonomic base moves sideways where other bases turn."""

SCALES = {
    "q": Scale(1.1, 1.1),
    "z": Scale(0.9, 0.9),
    "w": Scale(1.1, 1.0),
    "x": Scale(0.9, 1.0),
    "e": Scale(1.0, 1.1),
    "c": Scale(1.0, 0.9),
}

KEY_TABLE = """\
   move        with shift: sideways      u i o      U I O
                                         j k l      J K L
                                         m , .      M < >
   up down left right (arrows): ahead, back and turn, as turtle_teleop_key
   t/b         up, down
   q/z         speed and turn 10 % up, down
   w/x         speed alone
   e/c         turn alone
   any other key stops; Ctrl-C ends
"""
"""The key table shown to the user."""


class Velocity(NamedTuple):
    """Velocity forwards, left and up [m/s], and turn rate to the left [rad/s]."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


ZERO_VELOCITY = Velocity()


@dataclass(frozen=True)
class KeyState:
    """The set ``speed`` [m/s] and ``turn`` [rad/s], and the direction of the last key while it is held."""

    speed: float
    turn: float
    detector: HoldDetector
    direction: Direction = NO_DIRECTION

    @classmethod
    def initial(cls, p: TeleopParameters) -> KeyState:
        """Return the initial state."""
        detector = HoldDetector(p.key_timeout, p.adaptive)
        return cls(min(p.speed, p.speed_limit), min(p.turn, p.turn_limit), detector)

    def command(self, now: float) -> Velocity | None:
        """Return the commanded velocity at ``now`` [s]; None if no motion key is held."""
        if self.direction == NO_DIRECTION or not self.detector.is_held(now):
            return None
        x, y, z, yaw = self.direction
        return Velocity(x * self.speed, y * self.speed, z * self.speed, yaw * self.turn)


def reconfigured(state: KeyState, before: TeleopParameters, p: TeleopParameters) -> KeyState:
    """Return the state after a change of parameters from ``before``; scaled speeds stay within the limits."""
    speed = p.speed if p.speed != before.speed else state.speed
    turn = p.turn if p.turn != before.turn else state.turn
    detector = state.detector
    if (p.key_timeout, p.adaptive) != (before.key_timeout, before.adaptive):
        detector = replace(detector, first_timeout=p.key_timeout, adaptive=p.adaptive)
    return replace(state, speed=min(speed, p.speed_limit), turn=min(turn, p.turn_limit), detector=detector)


def is_stop(event: KeyEvent) -> bool:
    """Whether the key stops the robot, as does any key without a binding."""
    return not event.released and event.key not in MOVES and event.key not in SCALES


def on_key(state: KeyState, event: KeyEvent, p: TeleopParameters) -> KeyState:
    """Return the state after a key event.

    A scaling key changes a current motion and then counts as the held key itself, as a keyboard repeats only the last
    key; it starts no motion. On keyboards that report releases, a release ends the key's motion at once.
    """
    if event.released:
        return (
            replace(state, direction=NO_DIRECTION, detector=reset(state.detector))
            if event.key == state.detector.key
            else state
        )
    detector = pressed(state.detector, event.key, event.time, event.stall)
    if event.key in MOVES:
        return replace(state, detector=detector, direction=MOVES[event.key])
    if event.key not in SCALES:
        return replace(state, detector=reset(state.detector), direction=NO_DIRECTION)
    scale = SCALES[event.key]
    return KeyState(
        speed=_scaled(state.speed, scale.speed, p.speed_limit),
        turn=_scaled(state.turn, scale.turn, p.turn_limit),
        detector=detector,
        direction=state.direction if state.detector.is_held(event.time - event.stall) else NO_DIRECTION,
    )


def _scaled(value: float, factor: float, limit: float) -> float:
    return value if factor == 1.0 else min(limit, max(MIN_SPEED, value * factor))
