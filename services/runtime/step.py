"""The physics step, and the periods of loops that must be a whole number of them in lockstep."""

from __future__ import annotations

from services.runtime.errors import BadInput

STEP_NS = 5_000_000
"""The physics step, ns: 200 Hz. In lockstep every rate divides it."""


def period_of(rate: float, lockstep: bool) -> int:
    """The period [ns] of a rate [Hz]; in lockstep it must be a whole number of physics steps, else BadInput."""
    period = round(1e9 / rate)
    if lockstep and period % STEP_NS:
        raise BadInput(f"a rate of {rate:g} Hz is not a whole number of physics steps of {STEP_NS / 1e6:g} ms")
    return period
