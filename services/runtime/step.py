"""The physics step, and the periods of loops, which in lockstep are whole numbers of steps."""

from __future__ import annotations

from services.runtime.errors import BadInput

STEP_NS = 5_000_000
"""The physics step [ns]: 200 Hz. In lockstep every rate divides it."""


def period_of(rate: float, lockstep: bool) -> int:
    """Return the period [ns] of a rate [Hz]; in lockstep, raises BadInput unless it is a multiple of STEP_NS."""
    period = round(1e9 / rate)
    if lockstep and period % STEP_NS:
        raise BadInput(f"a rate of {rate:g} Hz is not a whole number of physics steps of {STEP_NS / 1e6:g} ms")
    return period
