"""The physics step, and the periods of loops, which in lockstep are whole numbers of steps."""

from __future__ import annotations

from services.runtime.errors import BadInput

STEP_NS = 5_000_000
"""The physics step [ns]: 200 Hz. In lockstep every rate divides it."""
STEP_S = STEP_NS / 1e9
"""The physics step [s]."""


def period_of(rate: float, lockstep: bool) -> int:
    """Return the period [ns] of a rate [Hz].

    Raises:
        BadInput: The rate is out of range or, in lockstep, its period is not a multiple of STEP_NS.
    """
    if not 0 < rate <= 1e9:
        raise BadInput(f"a rate of {rate:g} Hz is out of range: it must be above 0 and at most 1e9 Hz")
    period = round(1e9 / rate)
    if lockstep and period % STEP_NS:
        raise BadInput(f"a rate of {rate:g} Hz is not a whole number of physics steps of {STEP_NS / 1e6:g} ms")
    return period
