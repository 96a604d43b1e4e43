"""What the simulation knows of one member of its lockstep."""

from __future__ import annotations

from dataclasses import dataclass, field

from services.runtime.lockstep.protocol import StepReport
from services.runtime.lockstep.watermarks import MAX_JUMP, Numbers
from services.runtime.step import STEP_NS
from services.runtime.transport.api import RawPublisher
from services.runtime.transport.wire import MEMBER_BYTES


@dataclass
class MemberState:
    """One member: ``marks`` and ``known`` are what it has not been told yet.

    ``told`` is the generation of members it was told last, ``answer`` its Done for the step that is pending. ``asked``
    is the last Go or greeting that it has to answer, sent at ``asked_at`` (wall time). ``waited`` and ``silent`` [s of
    wall time] are how long its step has been waited for, all in all and since its last sign of life.
    """

    node: str
    session: str
    id: bytes
    raw: RawPublisher
    token: bytes
    nonce: bytes = b""
    period_ns: int = 0
    asked: bytes = b""
    asked_at: float = 0.0
    waited: float = 0.0
    unresponsive: float = 0.0
    active: bool = False
    generation_sent: int = -1
    last: tuple[int, int] = (-1, -1)
    """Epoch and tick of the last step that it was let take."""
    answer: StepReport | None = None
    sequence_numbers: Numbers = field(default_factory=dict)
    announced: Numbers = field(default_factory=dict)
    sent: dict[bytes, int] = field(default_factory=dict)
    """By publisher, the last number of which this member has told."""

    def account(self, done: StepReport) -> str:
        """Take note of the numbers that it tells of; why they cannot be its own, empty when they can."""
        if done.greets and (done.period <= 0 or done.period % STEP_NS):
            return f"{self.node} wants to step every {done.period} ns, which is not a whole number of physics steps"
        told = {each: number for news in (done.marks, done.known) for each, number in _flat(news)}
        for publisher, number in told.items():
            if publisher[:MEMBER_BYTES] != self.id:
                return f"{self.node} tells the numbers of another node's publisher"
            last = self.sent.get(publisher, number if done.greets else 0)
            if not last <= number <= last + MAX_JUMP:
                return f"{self.node} tells number {number} of a publisher after {last}"
        self.sent.update(told)
        return ""


def _flat(news: Numbers) -> list[tuple[bytes, int]]:
    return [each for numbers in news.values() for each in numbers.items()]
