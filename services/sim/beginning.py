"""The beginning of time: the simulation waits for the nodes of its fleet, and says whom it waits for."""

from __future__ import annotations

from messages.topics import FLEET_STATE
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.roster import gather
from services.sim import SimParameters

_ENDED = ("failed", "finished", "stopped")
"""States of a process that does not come back by itself."""

QUIET_S = 5.0
"""Wall time before the first line of the log about who is missing, and between two."""


def await_fleet(ctx: Context[SimParameters]) -> tuple[str, ...]:
    """Block until every node of the fleet is ready, with its parameters known, as far as they come.

    Returns:
        The nodes without which time begins: those that have ended, or that were not ready ``start_timeout`` after the
        last other became ready.

    Raises:
        BadInput: one of the absent nodes is required.
    """
    params, node = ctx.params, ctx.kernel
    roster = tuple(dict.fromkeys((*params.members, *params.awaits)))
    if not roster:
        return ()
    fleet = node.read(FLEET_STATE)
    ended: set[str] = set()

    def over() -> set[str]:
        fleet.admit()
        for state, _ in fleet.batch:
            ended.clear()
            ended.update(f"/{each.name}" for each in state.processes if each.state in _ENDED)
        return ended

    def tell(absent: list[str], waited: float) -> None:
        node.heart.note = f"time has not begun: waiting for {', '.join(absent)} since {waited:.0f} s"
        if waited > QUIET_S:
            node.log.warn(f"{node.heart.note}: did they start?", every=QUIET_S)

    node.heart.state = "waiting"
    absent = gather(node.transport, roster, ctx.idle, params.start_timeout, tell, over)
    node.heart.note = ""
    node.forget(fleet)
    over_by = {each: "has ended" if each in ended else "is not ready" for each in absent}
    told = ", ".join(f"{each} {how}" for each, how in over_by.items())
    if required := [each for each in absent if each in params.requires]:
        raise BadInput(
            f"time does not begin: {told}; waited until no other node came for {params.start_timeout:g} s, and the "
            f"fleet requires {', '.join(required)}: see ./elea logs"
        )
    if absent:
        node.log.warn(f"time begins without some nodes of the fleet: {told}; see ./elea logs")
    return tuple(absent)
