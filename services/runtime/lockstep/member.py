"""What the simulation knows of one member of its lockstep."""

from __future__ import annotations

from dataclasses import dataclass, field

from services.runtime.lockstep.marks import LARGEST_JUMP, Numbers
from services.runtime.lockstep.protocol import Done
from services.runtime.network.transport import Outlet
from services.runtime.network.wire import MEMBER_BYTES
from services.runtime.service import STEP_NS


@dataclass
class Member:
    """One member: ``marks`` and ``known`` are what it has not been told yet.

    ``told`` is the generation of members it was told last, ``answer`` its Done for the step that is pending. ``asked``
    is the last Go or greeting that it has to answer, sent at ``asked_at`` (wall time). ``waited`` and ``silent`` [s of
    wall time] are how long its step has been waited for, all in all and since its last sign of life.
    """

    node: str
    session: str
    id: bytes
    outlet: Outlet
    token: bytes
    nonce: bytes = b""
    period_ns: int = 0
    asked: bytes = b""
    asked_at: float = 0.0
    waited: float = 0.0
    silent: float = 0.0
    active: bool = False
    told: int = -1
    last: tuple[int, int] = (-1, -1)
    """Epoch and tick of the last step that it was let take."""
    answer: Done | None = None
    marks: Numbers = field(default_factory=dict)
    known: Numbers = field(default_factory=dict)
    sent: dict[bytes, int] = field(default_factory=dict)
    """By publisher, the last number of which this member has told."""

    def account(self, done: Done) -> str:
        """Take note of the numbers that it tells of; why they cannot be its own, empty when they can."""
        if done.greets and (done.period <= 0 or done.period % STEP_NS):
            return f"{self.node} wants to step every {done.period} ns, which is no whole number of physics steps"
        told = {each: number for news in (done.marks, done.known) for each, number in _flat(news)}
        for publisher, number in told.items():
            if publisher[:MEMBER_BYTES] != self.id:
                return f"{self.node} tells the numbers of another node's publisher"
            last = self.sent.get(publisher, number if done.greets else 0)
            if not last <= number <= last + LARGEST_JUMP:
                return f"{self.node} tells number {number} of a publisher after {last}"
        self.sent.update(told)
        return ""


def _flat(news: Numbers) -> list[tuple[bytes, int]]:
    return [each for numbers in news.values() for each in numbers.items()]
