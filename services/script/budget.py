"""What a turn of lockstep may spend: points are counted, never measured by a clock, so a run repeats."""

from __future__ import annotations

BUDGET = 500.0
"""Points that a thread may spend in one tick; then its turn ends, and it goes on at the next."""
LOOK = 1.0
PUBLISH = 5.0
LOG = 5.0
CALL = 50.0
WHILE_PASSES = 100
"""Passes of a ``while`` of the script that make one point."""

_TABLE = (
    (LOOK, "a look at time, shutdown, connections, a parameter, a goal's state; a failed lookup of a transform"),
    (PUBLISH, "a published message"),
    (LOG, "a line of the log"),
    (CALL, "a call of a service"),
    (1 / WHILE_PASSES, "a pass of a while loop, or of a for loop over an endless iterator"),
)


def explain() -> str:
    """The table as text."""
    lines = [f"In lockstep a thread's turn ends when it waits, or has spent {BUDGET:g} points in one tick:"]
    return "\n".join([*lines, *(f"  {cost:>5g}  {what}" for cost, what in _TABLE)])
