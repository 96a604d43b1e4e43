"""Keyboard events, the key bindings of teleop_twist_keyboard, and the velocity that the keys ask for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

from services.teleop import MIN_SPEED, TeleopParameters
from services.teleop.hold_detector import HoldDetector, pressed, reset


class KeyEvent(NamedTuple):
    """A key pressed, or repeated, at ``time`` [s of the source's clock]; ``released``: let go, where that is reported.

    It may have been up to ``stall`` [s] earlier, when the reader was held up.
    """

    key: str
    time: float
    released: bool = False
    stall: float = 0.0


class Keyboard(Protocol):
    """A keyboard that a person sits at; ``with`` takes it over and gives it back as it was."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def read_events(self, within: float) -> list[KeyEvent]:
        """What was struck since the last call, oldest first; blocks at most ``within`` [s] for the first.

        Times are those of ``time.monotonic``. Raises Stopped when the keyboard is gone.
        """
        ...


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

KEY_TABLE = """\
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


class Velocity(NamedTuple):
    """Speed ahead, to the left and up, m/s, and turn rate to the left, rad/s."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


ZERO_VELOCITY = Velocity()


@dataclass(frozen=True)
class KeyState:
    """``speed`` [m/s] and ``turn`` [rad/s] as they are set; where the key struck last points, while it is held."""

    speed: float
    turn: float
    detector: HoldDetector
    direction: Direction = NO_DIRECTION

    @classmethod
    def initial(cls, p: TeleopParameters) -> KeyState:
        """The hand at the start."""
        man = HoldDetector(p.key_timeout, p.adaptive)
        return cls(min(p.speed, p.speed_limit), min(p.turn, p.turn_limit), man)

    def command(self, now: float) -> Velocity | None:
        """The motion asked for at ``now`` [s], None when no moving key is held."""
        if self.direction == NO_DIRECTION or not self.detector.is_held(now):
            return None
        x, y, z, yaw = self.direction
        return Velocity(x * self.speed, y * self.speed, z * self.speed, yaw * self.turn)


def reconfigured(hand: KeyState, before: TeleopParameters, p: TeleopParameters) -> KeyState:
    """The hand after the parameters changed from ``before``; speeds that keys have scaled stay within the limits."""
    speed = p.speed if p.speed != before.speed else hand.speed
    turn = p.turn if p.turn != before.turn else hand.turn
    man = hand.detector
    if (p.key_timeout, p.adaptive) != (before.key_timeout, before.adaptive):
        man = replace(man, first_timeout=p.key_timeout, adaptive=p.adaptive)
    return replace(hand, speed=min(speed, p.speed_limit), turn=min(turn, p.turn_limit), detector=man)


def is_stop(press: KeyEvent) -> bool:
    """Whether a press asks the robot to stop: any key without a meaning of its own."""
    return not press.released and press.key not in MOVES and press.key not in SCALES


def on_key(hand: KeyState, press: KeyEvent, p: TeleopParameters) -> KeyState:
    """The hand after a press.

    A scaling key changes a motion under way and then counts as the held key itself: a keyboard repeats only the key
    that was struck last. It sets nothing in motion. On keyboards that tell, a key that goes up ends its motion at once.
    """
    if press.released:
        return (
            replace(hand, direction=NO_DIRECTION, detector=reset(hand.detector))
            if press.key == hand.detector.key
            else hand
        )
    man = pressed(hand.detector, press.key, press.time, press.stall)
    if press.key in MOVES:
        return replace(hand, detector=man, direction=MOVES[press.key])
    if press.key not in SCALES:
        return replace(hand, detector=reset(hand.detector), direction=NO_DIRECTION)
    scale = SCALES[press.key]
    return KeyState(
        speed=_scaled(hand.speed, scale.speed, p.speed_limit),
        turn=_scaled(hand.turn, scale.turn, p.turn_limit),
        detector=man,
        direction=hand.direction if hand.detector.is_held(press.time - press.stall) else NO_DIRECTION,
    )


def _scaled(value: float, factor: float, limit: float) -> float:
    return value if factor == 1.0 else min(limit, max(MIN_SPEED, value * factor))
