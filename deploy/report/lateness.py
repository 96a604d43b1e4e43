"""Whether the machine kept up with real time, in words: on one that does not, a missed check says little of a robot."""

from __future__ import annotations

from deploy.report.record import RunFigures

MOST = 3
"""Nodes named."""


def lateness(run: RunFigures, ok: bool) -> tuple[str, ...]:
    """One note for a run in real time in which the simulation fell behind; or services, if its checks do not hold.

    A tick now and then is missed on most machines, and harms nobody.
    """
    if run.mode != "real" or not (run.lag_s or (run.ticks_missed and not ok)):
        return ()
    parts = []
    if run.lag_s:
        parts.append(f"the simulation fell behind by {run.lag_s:.1f} s in all")
    if run.ticks_missed:
        worst = sorted(run.ticks_missed.items(), key=lambda each: -each[1])
        named = ", ".join(f"{node} {missed}" for node, missed in worst[:MOST])
        rest = len(worst) - MOST
        parts.append(f"ticks were missed by {named}{f' and {rest} more' if rest > 0 else ''}")
    return (
        f"This machine did not keep up with real time at factor {run.factor:g}: {'; '.join(parts)}. What is missed may "
        "be the machine's fault: let less run beside, take a lower --factor, or --mode lockstep, which waits.",
    )
