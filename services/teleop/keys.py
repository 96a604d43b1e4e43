"""The seam to the keyboard: what a source of keys gives, whatever the platform."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self


class Press(NamedTuple):
    """A key was struck, or repeated, at ``at`` [s of the source's clock]; ``up``: it was let go, where that is told.

    It may have been up to ``stall`` [s] earlier, when the reader was held up.
    """

    key: str
    at: float
    up: bool = False
    stall: float = 0.0


class Keyboard(Protocol):
    """A keyboard that a person sits at; ``with`` takes it over and gives it back as it was."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def take(self, within: float) -> list[Press]:
        """What was struck since the last call, oldest first; blocks at most ``within`` [s] for the first.

        Times are those of ``time.monotonic``. Raises Stopped when the keyboard is gone.
        """
        ...
