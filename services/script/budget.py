"""The budget of a turn in lockstep: points, counted rather than measured by a clock, so that runs are repeatable."""

from __future__ import annotations

import re

BUDGET = 500.0
"""Points that a thread may spend in one tick; its turn then ends, and it continues at the next tick."""
QUERY = 1.0
PUBLISH = 5.0
LOG = 5.0
CALL = 50.0
WHILE_PASSES = 100
"""Number of passes of a ``while`` loop of the script that cost one point."""

_COMMAND = re.compile(r"/gazebo/(apply|set|clear)_\w+")
_STATE = re.compile(r"/gazebo/get_(joint|link|model)_\w+")
_TABLE = (
    (QUERY, "a query of the time, shutdown, connections, a parameter or a goal's state; a failed transform lookup"),
    (PUBLISH, "a published message"),
    (LOG, "a log line"),
    (CALL, "a service call"),
    (1 / WHILE_PASSES, "a pass of a while loop, or of a for loop over an endless iterator"),
)


def explain() -> str:
    """Return the table as text."""
    lines = [f"In lockstep a thread's turn ends when it waits, or has spent {BUDGET:g} points in one tick:"]
    return "\n".join([*lines, *(f"  {cost:>5g}  {what}" for cost, what in _TABLE)])


class GazeboCalls:
    """Ends the turn of a thread that reads a state again after it has sent a command.

    A control loop that alternates ``get_joint_properties`` and ``apply_joint_effort`` without waiting sees a new state
    in each iteration in Gazebo, whose steps are shorter than a call. Here it gets one iteration per tick: in a second
    one nothing would have moved, and its finite differences would be 0.
    """

    def __init__(self) -> None:
        self._commanded: dict[object, int] = {}

    def cost(self, service: str, thread: object, now: int) -> float:
        """Return the points of a call by a thread at ``now`` [ns]."""
        if _COMMAND.fullmatch(service):
            self._commanded[thread] = now
        elif self._commanded.get(thread) == now and _STATE.fullmatch(service):
            del self._commanded[thread]
            return BUDGET
        return CALL
