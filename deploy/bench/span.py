"""A span of simulation time."""

from __future__ import annotations

from typing import NamedTuple

from services.runtime.service import STEP_NS


class Span(NamedTuple):
    """The simulation time that is timed, s."""

    begin: float
    end: float

    @property
    def steps(self) -> range:
        """The same in physics steps."""
        return range(*(round(seconds * 1e9 / STEP_NS) for seconds in self))

    @property
    def length(self) -> float:
        """In s."""
        return self.end - self.begin
