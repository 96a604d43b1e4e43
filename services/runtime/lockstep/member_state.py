"""The simulation's record of one lockstep member."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from services.runtime.lockstep.protocol import StepReport
from services.runtime.lockstep.watermarks import MAX_JUMP, Numbers
from services.runtime.step import STEP_NS
from services.runtime.transport.api import RawPublisher
from services.runtime.transport.wire import MEMBER_BYTES


@dataclass
class MemberState:
    """One member: a session and its nodes, several if they share a process.

    ``sequence_numbers``, ``announced`` and ``skipped`` are the numbers still to be sent to it. ``generation_sent`` is
    the generation of the member list last sent to it, ``answer`` its Done for the pending step. ``asked`` is the last
    Go or join that it has to answer, sent at ``asked_at`` (wall time). ``waited`` and ``unresponsive`` [s of wall time]
    are how long its step has been awaited, in total and since its last heartbeat.
    """

    ids: dict[str, bytes]
    """The ids of its nodes, by name."""
    session: str
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
    stepped_at: int = 0
    """Simulation time [ns] of that step."""
    answer: StepReport | None = None
    idle_until: int = 0
    """Simulation time [ns] before which it needs no step unless something is sent to it."""
    sequence_numbers: Numbers = field(default_factory=dict)
    announced: Numbers = field(default_factory=dict)
    skipped: Numbers = field(default_factory=dict)
    readers: dict[str, dict[str, None]] = field(default_factory=dict)
    """By key, the sessions of other members that have subscribed to it since this member's last step."""
    sent: dict[bytes, int] = field(default_factory=dict)
    """By publisher of its nodes, the last number that this member has reported."""

    @property
    def name(self) -> str:
        """The names of its nodes, for messages."""
        return ", ".join(self.ids)

    def has_work(self, time_ns: int, generation: int) -> bool:
        """Return whether it needs a step now: its idle time is over, something was sent to it, or members changed."""
        return (
            time_ns >= self.idle_until
            or bool(self.sequence_numbers or self.announced)
            or self.generation_sent != generation
        )

    def owns(self, publisher: bytes) -> bool:
        """Return whether a publisher belongs to one of its nodes."""
        return publisher[:MEMBER_BYTES] in self.ids.values()

    def release(self, nodes: Collection[str]) -> None:
        """Forget nodes that have ended, and their publishers."""
        self.ids = {node: number for node, number in self.ids.items() if node not in nodes}
        self.sent = {publisher: number for publisher, number in self.sent.items() if self.owns(publisher)}

    def account(self, done: StepReport) -> str:
        """Record the numbers of a report; returns why they are refused, empty if they are accepted."""
        if done.answers_join and (done.period <= 0 or done.period % STEP_NS):
            return f"{self.name} asks to step every {done.period} ns, which is not a whole number of physics steps"
        accepted: dict[bytes, int] = {}
        for news in (done.sequence_numbers, done.announced):
            for numbers in news.values():
                for publisher, number in numbers.items():
                    if (last := self.sent.get(publisher)) is None:
                        if not self.owns(publisher):
                            return f"{self.name} reports the numbers of another node's publisher"
                        last = number if done.answers_join else 0
                    if not last <= number <= last + MAX_JUMP:
                        return f"{self.name} reports number {number} of a publisher after {last}"
                    accepted[publisher] = number
        self.sent.update(accepted)
        return ""
