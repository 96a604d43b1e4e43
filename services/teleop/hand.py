"""The hand at the keys: which way it wants to go, how fast, and whether it is still there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from services.teleop import SLOWEST, TeleopParameters
from services.teleop.bindings import MOVES, NOWHERE, SCALES, Direction
from services.teleop.dead_man import DeadMan, released, struck
from services.teleop.keys import Press


class Motion(NamedTuple):
    """Speed ahead, to the left and up, m/s, and turn rate to the left, rad/s."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


STILL = Motion()


@dataclass(frozen=True)
class Hand:
    """``speed`` [m/s] and ``turn`` [rad/s] as they are set; where the key struck last points, while it is held."""

    speed: float
    turn: float
    man: DeadMan
    direction: Direction = NOWHERE

    @classmethod
    def of(cls, p: TeleopParameters) -> Hand:
        """The hand at the start."""
        man = DeadMan(p.key_timeout, p.adaptive)
        return cls(min(p.speed, p.speed_limit), min(p.turn, p.turn_limit), man)

    def wants(self, now: float) -> Motion | None:
        """The motion asked for at ``now`` [s], None when no moving key is held."""
        if self.direction == NOWHERE or not self.man.holds(now):
            return None
        x, y, z, yaw = self.direction
        return Motion(x * self.speed, y * self.speed, z * self.speed, yaw * self.turn)


def retuned(hand: Hand, before: TeleopParameters, p: TeleopParameters) -> Hand:
    """The hand after the parameters changed from ``before``; speeds that keys have scaled stay within the limits."""
    speed = p.speed if p.speed != before.speed else hand.speed
    turn = p.turn if p.turn != before.turn else hand.turn
    man = hand.man
    if (p.key_timeout, p.adaptive) != (before.key_timeout, before.adaptive):
        man = replace(man, first=p.key_timeout, adaptive=p.adaptive)
    return replace(hand, speed=min(speed, p.speed_limit), turn=min(turn, p.turn_limit), man=man)


def stops(press: Press) -> bool:
    """Whether a press asks the robot to stop: any key without a meaning of its own."""
    return not press.up and press.key not in MOVES and press.key not in SCALES


def strike(hand: Hand, press: Press, p: TeleopParameters) -> Hand:
    """The hand after a press.

    A scaling key changes a motion under way and then counts as the held key itself: a keyboard repeats only the key
    that was struck last. It sets nothing in motion. On keyboards that tell, a key that goes up ends its motion at once.
    """
    if press.up:
        return replace(hand, direction=NOWHERE, man=released(hand.man)) if press.key == hand.man.key else hand
    man = struck(hand.man, press.key, press.at, press.stall)
    if press.key in MOVES:
        return replace(hand, man=man, direction=MOVES[press.key])
    if press.key not in SCALES:
        return replace(hand, man=released(hand.man), direction=NOWHERE)
    scale = SCALES[press.key]
    return Hand(
        speed=_scaled(hand.speed, scale.speed, p.speed_limit),
        turn=_scaled(hand.turn, scale.turn, p.turn_limit),
        man=man,
        direction=hand.direction if hand.man.holds(press.at - press.stall) else NOWHERE,
    )


def _scaled(value: float, factor: float, limit: float) -> float:
    return value if factor == 1.0 else min(limit, max(SLOWEST, value * factor))
