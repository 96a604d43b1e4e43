"""The seed's law, step by step the tutorial's loop, and why it misses: for teaching, and to compare with.

It acts ten times a second on odometry that comes ten times a second, unsynchronised: the pose is up to 0.1 s old. It
turns at full speed until the error is below 0.05 rad and then counts the turn as done, though the base still rotates
and needs w^2 / (2 a) = 0.07 rad to stop. The next side begins from the pose of that moment, and the next turn from the
heading at its own beginning, so the errors add up, in one sense.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from services.motion.planar import STILL, Motion, Planar, wrap
from services.square import SquareParameters
from services.square.corners import Square
from services.square.move import Move, State
from services.square.profile import REST

PERIOD_NS = 100_000_000
"""Of its loop and of its odometry, ns."""
ANGLE_THRESHOLD = 0.05
"""Heading error [rad] below which it takes a turn for done."""
DISTANCE_THRESHOLD = 0.05
"""Distance [m] before the end of a side at which it stops driving."""


@dataclass(frozen=True, slots=True)
class Loop:
    """The variables of the tutorial's script: state, sides done, the pose that the side counts from, the heading asked.

    ``seen`` is the pose of its last odometry; ``sampled`` and ``acted`` count periods since time began.
    """

    square: Square
    start: Planar
    seen: Planar
    rotating: bool = False
    sides: int = 0
    target: float = 0.0
    command: Motion = STILL
    sampled: int = -1
    acted: int = -1
    finished: bool = False

    @classmethod
    def of(cls, square: Square) -> Loop:
        """At the first side. The tutorial took its start for (0, 0, 0); here it is where the robot stands."""
        return cls(square, square.start, square.start)


def step(now: Loop, time: int, here: Planar, moving: Motion, p: SquareParameters) -> tuple[Loop, Move]:
    """The loop and the move at ``time`` [ns]; between its periods it only looks, and its move has no command."""
    if (sampled := time // PERIOD_NS) != now.sampled:
        now = replace(now, seen=here, sampled=sampled)
    acted = (time - round(p.phase * 1e9)) // PERIOD_NS
    if acted == now.acted:
        return now, Move("finished" if now.finished else "driving", None, _index(now), _desired(now, p), _doing(now))
    now = replace(now, acted=acted)
    if now.sides == now.square.turns:
        standing = abs(moving.v) <= REST.v and abs(moving.w) <= REST.w
        now = replace(now, command=STILL, finished=now.finished or standing)
        done: State = "finished" if now.finished else "driving"
        return now, Move(done, STILL, _index(now), _desired(now, p), _doing(now))
    before = now.sides
    now = _act(now, p)
    reached = now.sides > before
    state: State = "reached" if reached else "driving"
    return now, Move(state, now.command, now.sides - 1 if reached else now.sides, _desired(now, p), _doing(now))


def _act(now: Loop, p: SquareParameters) -> Loop:
    """One turn of the tutorial's loop."""
    seen = now.seen
    if not now.rotating:
        if math.hypot(seen.x - now.start.x, seen.y - now.start.y) < p.side - DISTANCE_THRESHOLD:
            return replace(now, command=Motion(p.linear_speed, 0.0))
        return replace(now, command=STILL, rotating=True, start=seen, target=wrap(seen.yaw + math.pi / 2))
    error = wrap(now.target - seen.yaw)
    if abs(error) > ANGLE_THRESHOLD:
        return replace(now, command=Motion(0.0, math.copysign(p.angular_speed, error)))
    return replace(now, command=STILL, rotating=False, sides=now.sides + 1, start=seen)


def _desired(now: Loop, p: SquareParameters) -> Planar:
    """What its log calls desired: the end of the present side while it drives, the heading asked while it turns."""
    if now.rotating:
        return Planar(now.seen.x, now.seen.y, now.target)
    yaw = now.start.yaw
    return Planar(now.start.x + p.side * math.cos(yaw), now.start.y + p.side * math.sin(yaw), now.seen.yaw)


def _index(now: Loop) -> int:
    return now.sides - 1 if now.sides == now.square.turns else now.sides


def _doing(now: Loop) -> str:
    if now.sides == now.square.turns:
        return "done"
    return "ROTATE" if now.rotating else "MOVE_FORWARD"
