"""A service's own checks of the run: figures that it measures itself, with bounds, which the report judges."""

from __future__ import annotations

import math

import msgspec

from messages.elea import MOST_CHECKS, Check
from services.runtime.errors import BadInput


class ServiceChecks:
    """The checks that a node has stated, by name; the last statement of each counts."""

    def __init__(self) -> None:
        self._stated: dict[str, Check] = {}

    def state(
        self, name: str, value: float | bool | None, least: float | None, most: float | None, reason: str
    ) -> tuple[Check, ...] | None:
        """State one; all of them, or None when nothing has changed. Raises BadInput."""
        if isinstance(value, bool):
            least = 1.0 if least is None and most is None else least
        if least is None and most is None:
            raise BadInput(f"the check {name!r} needs a bound: give min, max or both (a bool needs none)")
        number = None if value is None or not math.isfinite(value) else float(value)
        try:
            made = msgspec.convert(
                {"name": name, "value": number, "min": least, "max": most, "reason": reason}, Check, strict=True
            )
        except msgspec.ValidationError as error:
            raise BadInput(f"the check {name!r} cannot be stated: {error}") from None
        if self._stated.get(name) == made:
            return None
        if name not in self._stated and len(self._stated) == MOST_CHECKS:
            raise BadInput(f"the check {name!r} is one too many: a node states {MOST_CHECKS} at most")
        self._stated[name] = made
        return tuple(self._stated.values())

    def holds(self, name: str) -> bool:
        """Whether the value of a check keeps to its bounds; what was not measured does not."""
        known = self._stated[name]
        if known.value is None:
            return False
        return (known.min is None or known.value >= known.min) and (known.max is None or known.value <= known.max)
