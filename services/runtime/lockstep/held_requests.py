"""Requests that members make within their steps, carried out in an order that does not depend on the network.

Two members that ask something of the simulation in the same step do so when they come to it: which of them is first
differs between runs. So a member's request waits until every member that is due has either finished its step or waits
for an answer, too. Then all that wait are carried out, by the names of their nodes, and their members go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from services.runtime.lockstep.member_state import MemberState


class HeldRequests:
    """The requests that wait, at most one of each member: it waits for the answer.

    A forged name beside a request can change the order of a step, as any request from outside can, and nothing else.
    """

    def __init__(self) -> None:
        self._held: dict[str, tuple[str, Callable[[], None]]] = {}

    def __bool__(self) -> bool:
        return bool(self._held)

    def hold(self, member: MemberState, carry_out: Callable[[], None]) -> bool:
        """Keep a request of a member; False when one of it waits already."""
        if member.session in self._held:
            return False
        self._held[member.session] = member.name, carry_out
        return True

    def release(self, unfinished: Iterable[MemberState], others: Iterable[MemberState] = ()) -> None:
        """Carry out the requests if all members whose steps are awaited wait for an answer.

        Args:
            unfinished: The members that are due and have not finished their step.
            others: Members whose step ends at a later time: their requests wait until then.
        """
        if not {member.session for member in unfinished} <= self._held.keys():
            return
        later = {member.session for member in others}
        ready = {each: held for each, held in self._held.items() if each not in later}
        self._held = {each: held for each, held in self._held.items() if each in later}
        for _, carry_out in sorted(ready.values(), key=lambda each: each[0]):
            carry_out()
