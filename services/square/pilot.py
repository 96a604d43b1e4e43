"""The pilot: latches the start, and takes the robot around by one of the laws."""

from __future__ import annotations

from services.motion.planar import STILL, Motion, Planar
from services.square import SquareParameters, profile, seed
from services.square.corners import Square
from services.square.move import Move


class Pilot:
    """A pose goes in, a move comes out. ``square`` is None until the first pose: the square begins there."""

    def __init__(self, parameters: SquareParameters) -> None:
        self._p = parameters
        self.square: Square | None = None
        self._course: profile.Course | None = None
        self._loop: seed.Loop | None = None
        self._held = False
        self._last = Move("waiting", STILL, 0, Planar(0.0, 0.0), "waiting")

    def retune(self, parameters: SquareParameters) -> None:
        """Drive on by other parameters around the same square."""
        self._p = parameters

    def step(self, time: int, here: Planar, moving: Motion, dt: float) -> Move:
        """One tick at ``time`` [ns]: the robot is ``here``, moves at ``moving``; the last tick was ``dt`` [s] ago."""
        if self.square is None:
            self.square = Square(here, self._p.side, self._p.count)
            if self._p.law == "seed":
                self._loop = seed.Loop.of(self.square)
            else:
                self._course = profile.Course(self.square)
        if self._loop is not None:
            self._loop, self._last = seed.step(self._loop, time, here, moving, self._p)
        elif self._course is not None:
            course = profile.resume(self._course, here) if self._held else self._course
            self._course, self._last = profile.step(course, here, moving, self._p, dt)
        self._held = False
        return self._last

    def wait(self) -> Move:
        """Stand still for want of odometry; the way goes on from where the robot is afterwards."""
        self._held = True
        return Move("waiting", STILL, self._last.index, self._last.desired, "waiting")
