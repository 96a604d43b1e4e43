"""What the bench says: one figure a line, each with its rounds."""

from __future__ import annotations

import statistics
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A measured figure: its name in ``--json``, unit, text, the value of each round, and the bound it is to keep."""

    name: str
    unit: str
    about: str
    rounds: tuple[float, ...]
    at_most: float | None = None
    at_least: float | None = None

    @property
    def median(self) -> float:
        """The median over the rounds."""
        return statistics.median(self.rounds)

    @property
    def bound(self) -> str:
        """The bound as it is shown."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}"
        return f"at least {self.at_least:g}" if self.at_least is not None else ""

    @property
    def ok(self) -> bool:
        """Whether the median keeps the bound."""
        return (self.at_most is None or self.median <= self.at_most) and (
            self.at_least is None or self.median >= self.at_least
        )


def ratios(ours: list[float], floor: list[float]) -> tuple[float, ...]:
    """Ours over the floor, round by round: both ran one after the other, under the same load."""
    return tuple(a / b for a, b in zip(ours, floor, strict=True))
