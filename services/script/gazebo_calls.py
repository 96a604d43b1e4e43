"""What Gazebo's services cost a script in lockstep, where the world stands still within a tick."""

from __future__ import annotations

import re

from services.script.budget import BUDGET, CALL

_COMMAND = re.compile(r"/gazebo/(apply|set|clear)_\w+")
_STATE = re.compile(r"/gazebo/get_(joint|link|model)_\w+")


class GazeboCalls:
    """Ends the turn of a thread that reads a state again after it has commanded something.

    A control loop without any wait, ``get_joint_properties`` and ``apply_joint_effort`` in turn, sees a new state in
    each round in Gazebo, whose steps are shorter than a call. Here it gets one round a tick: in a second one nothing
    would have moved, and its difference quotients would be 0.
    """

    def __init__(self) -> None:
        self._commanded: dict[object, int] = {}

    def cost(self, service: str, thread: object, now: int) -> float:
        """The points of a call of a thread at ``now`` [ns]."""
        if _COMMAND.fullmatch(service):
            self._commanded[thread] = now
        elif self._commanded.get(thread) == now and _STATE.fullmatch(service):
            del self._commanded[thread]
            return BUDGET
        return CALL
