"""What the seed's law comes to without slip and with perfect odometry: it is off by design, not by accident."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from services.motion.planar import STILL, Motion, Planar
from services.runtime.service import STEP_NS
from services.square import SERVICE, SquareParameters
from services.square.corners import Square
from services.square.seed import Loop, step

STEP_S = STEP_NS / 1e9
LONGEST_S = 3600.0

Base = Callable[[Motion], Motion]
"""A base: takes the command and gives the motion of one physics step, with what its limits leave of it."""


class Expected(NamedTuple):
    """Where a square ends: m from its start, and rad by which the turns were too much, not wrapped."""

    closure: float
    turned: float


def expected(p: SquareParameters, base: Base) -> Expected | None:
    """The end of the squares of ``p`` (one, if they have no end) by the seed's law; None if not within LONGEST_S.

    The base moves along the middle heading of each step; a command acts from the step after it.
    """
    assert SERVICE.rate is not None
    tick = round(1 / SERVICE.rate / STEP_S)
    rounds = p.count or 1
    loop = Loop.of(Square(Planar(0.0, 0.0), p.side, rounds))
    here, moving, wanted = Planar(0.0, 0.0), STILL, STILL
    for number in range(round(LONGEST_S / STEP_S)):
        if number % tick == 0:
            loop, move = step(loop, number * STEP_NS, here, moving, p)
            wanted = move.command or wanted
            if move.state == "finished":
                return Expected(math.hypot(here.x, here.y), here.yaw - rounds * math.tau)
        moving = base(wanted)
        middle, ahead = here.yaw + moving.w * STEP_S / 2, moving.v * STEP_S
        here = Planar(
            here.x + ahead * math.cos(middle), here.y + ahead * math.sin(middle), here.yaw + moving.w * STEP_S
        )
    return None


def runs_on(base: Base, w: float) -> float:
    """By how much a base that turns at ``w`` [rad/s] turns on after the command to stop, rad."""
    for _ in range(round(60 / STEP_S)):
        base(Motion(0.0, w))
    angle = 0.0
    while (moving := base(STILL)).w:
        angle += moving.w * STEP_S
    return angle
