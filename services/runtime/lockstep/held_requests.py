"""Requests that members make within their steps, carried out in an order that does not depend on the network.

If two members call the simulation in the same step, which one comes first differs between runs. So a member's request
is held until every due member has either finished its step or waits for a reply, too. Then all held requests are
carried out in the order of their nodes' names, and their members continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from services.runtime.lockstep.member_state import MemberState


class HeldRequests:
    """The held requests, at most one per member, since it blocks until the reply.

    A forged sender id can change the order within a step, as any request from outside can, and nothing else.
    """

    def __init__(self) -> None:
        self._held: dict[str, tuple[str, Callable[[], None]]] = {}

    def __bool__(self) -> bool:
        return bool(self._held)

    def hold(self, member: MemberState, carry_out: Callable[[], None]) -> bool:
        """Hold a request of a member; returns False if one of its requests is held already."""
        if member.session in self._held:
            return False
        self._held[member.session] = member.name, carry_out
        return True

    def release(self, unfinished: Iterable[MemberState], others: Iterable[MemberState] = ()) -> None:
        """Carry out the held requests if every unfinished member is waiting for a reply.

        Args:
            unfinished: The members that are due and have not finished their step.
            others: Members whose step ends at a later time: their requests stay held until then.
        """
        if not {member.session for member in unfinished} <= self._held.keys():
            return
        later = {member.session for member in others}
        ready = {each: held for each, held in self._held.items() if each not in later}
        self._held = {each: held for each, held in self._held.items() if each in later}
        for _, carry_out in sorted(ready.values(), key=lambda each: each[0]):
            carry_out()
