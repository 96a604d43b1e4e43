"""Judges samples by their sequence numbers: which are new, lost, repeated or forged; and counts refused ones."""

from __future__ import annotations

from enum import Enum
from time import monotonic, time_ns

from messages.elea import InputHealth
from services.runtime.transport.wire import SampleInfo

MAX_PUBLISHERS = 4096
"""Publishers that one reader remembers; beyond that, the one silent longest is forgotten."""
MAX_GAP = 1 << 20
"""Samples that may be missing before the next one; a number further ahead is refused."""
AHEAD_NS = 100_000_000
"""A source time further ahead of this machine's clock than this is not believed where another one is."""
RESYNC_S = 0.1
"""Wall time for which numbers must grow beside those expected until they are followed; below every time-out."""


class Verdict(Enum):
    """The verdict on a sample by its sequence number."""

    NEXT = "the next of its publisher, or the first"
    GAP = "new, with samples lost before it"
    RESYNCED = "new, though its number says otherwise: the publisher restarted its numbers, or they were forged"
    REPEATED = "not new"
    TOO_FAR = "too far ahead"


class SequenceTracker:
    """Judges the numbers of a reader's publishers.

    Numbers grow by one from sample to sample. Any program on the network can send a sample in the name of a publisher,
    so a number alone must not silence the true publisher:

    - A number counts only once the payload was accepted: the caller judges, and then calls ``accept``.
    - A number more than MAX_GAP ahead is refused.
    - A number that does not grow is a repetition (a second path, a latched value sent again), unless its source time
      is later than that of the last sample accepted: then it is new, and its number is followed from here on. A last
      source time ahead of this machine's clock by more than AHEAD_NS does not count against one that is not.
    - Where source times do not help (machines with different clocks), numbers that grow for RESYNC_S, while the
      expected ones do not arrive, are followed, as in RFC 3550, A.1.

    So after a forged sample the next true one counts where clocks agree, and one within RESYNC_S or after the next
    period, whichever is longer, where they do not. ``last`` is the number last accepted from each publisher.
    """

    def __init__(self) -> None:
        self.last: dict[bytes, int] = {}
        self.stamps: dict[bytes, int] = {}
        self._seen: dict[bytes, int] = {}
        self._rivals: dict[bytes, tuple[int, float, int]] = {}

    def judge(self, origin: SampleInfo) -> Verdict:
        """The verdict on a sample by its number and source time; nothing is recorded yet."""
        sequence, stamp, _, publisher = origin
        last = self.last.get(publisher)
        if last is None or sequence == last + 1:
            return Verdict.NEXT
        if last < sequence <= last + 1 + MAX_GAP:
            return Verdict.GAP
        if sequence <= last:
            latest = self.stamps[publisher]
            believed = time_ns() + AHEAD_NS
            if stamp > latest or stamp <= believed < latest:
                return Verdict.RESYNCED
        if self._persists(publisher, sequence, last):
            return Verdict.RESYNCED
        return Verdict.REPEATED if sequence <= last else Verdict.TOO_FAR

    def accept(self, origin: SampleInfo) -> None:
        """Record the number and the source time of an accepted sample."""
        publisher = origin.publisher
        if publisher not in self.last and len(self.last) >= MAX_PUBLISHERS:
            self._forget_one()
        self.last[publisher] = origin.sequence
        self.stamps[publisher] = origin.source_ns

    def pass_over(self, publisher: bytes, sequence: int) -> None:
        """Record the number of a sample whose payload was refused, so that it is neither lost as well nor waited for:
        the next one of its publisher, or its first.

        Its source time is not recorded, so that a forged sample does not prevent the true one of the same number.
        """
        if publisher not in self.last:
            if len(self.last) >= MAX_PUBLISHERS:
                self._forget_one()
            self.stamps[publisher] = 0
        self.last[publisher] = sequence

    def give_up(self, publisher: bytes, sequence: int) -> None:
        """Continue after ``sequence``: earlier samples that arrive late are refused."""
        self.last[publisher] = sequence
        self.stamps[publisher] = time_ns()

    def _persists(self, publisher: bytes, sequence: int, last: int) -> bool:
        """Whether numbers beside the expected ones have grown for RESYNC_S, while no expected one was accepted."""
        now = monotonic()
        before, since, beside = self._rivals.get(publisher, (0, now, -1))
        if beside != last or not before < sequence <= before + MAX_GAP:
            since = now
        elif now - since >= RESYNC_S:
            del self._rivals[publisher]
            return True
        self._rivals[publisher] = sequence, since, last
        return False

    def _forget_one(self) -> None:
        """Forget a publisher that has been silent for long, found without a time for each sample.

        From the oldest on, each whose number has changed since the last look gets a second chance.
        """
        for publisher in list(self.last):
            number = self.last.pop(publisher)
            if self._seen.get(publisher) == number:
                break
            self._seen[publisher] = number
            self.last[publisher] = number
        else:
            publisher = next(iter(self.last))
            del self.last[publisher]
        del self.stamps[publisher]
        self._seen.pop(publisher, None)
        self._rivals.pop(publisher, None)


_REASON = 200
"""Characters of a reason that are kept."""


class RefusalCounter:
    """Counts the refused samples of a key without a subscriber: of lockstep's messages, and of the clock that paces.

    The node's health lists it under ``name`` once something was refused.
    """

    lost = repeated = resynced = foreign = 0

    def __init__(self, name: str) -> None:
        self.name = name
        self.received = self.refused = 0
        self.reason = ""

    def reject(self, reason: str) -> None:
        """Count a sample as refused."""
        self.refused += 1
        self.reason = "".join(each if each.isprintable() else "?" for each in reason[:_REASON])

    def health(self) -> InputHealth:
        """The counts, as they are shown."""
        return InputHealth(topic=self.name, received=self.received, refused=self.refused, reason=self.reason)
