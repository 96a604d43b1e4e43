"""The simulation's state of one member of lockstep."""

from __future__ import annotations

from dataclasses import dataclass, field

from services.runtime.lockstep.protocol import StepReport
from services.runtime.lockstep.watermarks import MAX_JUMP, Numbers
from services.runtime.step import STEP_NS
from services.runtime.transport.api import RawPublisher
from services.runtime.transport.wire import MEMBER_BYTES


@dataclass
class MemberState:
    """One member; ``sequence_numbers`` and ``announced`` are the numbers still to be sent to it.

    ``generation_sent`` is the generation of the member list sent to it last, ``answer`` its Done for the pending step.
    ``asked`` is the last Go or join that it has to answer, sent at ``asked_at`` (wall time). ``waited`` and
    ``unresponsive`` [s of wall time] are how long its step has been awaited, in all and since its last sign of life.
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
    """Epoch and tick of the last step granted to it."""
    answer: StepReport | None = None
    sequence_numbers: Numbers = field(default_factory=dict)
    announced: Numbers = field(default_factory=dict)
    sent: dict[bytes, int] = field(default_factory=dict)
    """By publisher, the last number that this member has reported."""

    def account(self, done: StepReport) -> str:
        """Record the numbers of a report; returns why they cannot be its own, empty if they can."""
        if done.greets and (done.period <= 0 or done.period % STEP_NS):
            return f"{self.node} asks to step every {done.period} ns, which is not a whole number of physics steps"
        numbers = {each: number for news in (done.marks, done.known) for each, number in _flat(news)}
        for publisher, number in numbers.items():
            if publisher[:MEMBER_BYTES] != self.id:
                return f"{self.node} reports the numbers of another node's publisher"
            last = self.sent.get(publisher, number if done.greets else 0)
            if not last <= number <= last + MAX_JUMP:
                return f"{self.node} reports number {number} of a publisher after {last}"
        self.sent.update(numbers)
        return ""


def _flat(news: Numbers) -> list[tuple[bytes, int]]:
    return [each for numbers in news.values() for each in numbers.items()]
