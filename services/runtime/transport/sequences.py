"""Classifies samples by their sequence numbers as new, lost, repeated or forged, and counts refused ones."""

from __future__ import annotations

from enum import Enum
from time import monotonic, time_ns

from messages.elea import InputHealth
from services.runtime.transport.wire import SampleInfo

MAX_PUBLISHERS = 4096
"""Maximum publishers that one subscriber remembers; beyond that, one that has been silent for long is forgotten."""
MAX_GAP = 1 << 20
"""Maximum missing samples before a new one; a number further ahead is refused."""
AHEAD_NS = 100_000_000
"""Source times more than this [ns] ahead of this machine's clock are not trusted over others."""
RESYNC_S = 0.1
"""Wall time [s] for which unexpected numbers must grow until they are accepted; below every timeout."""


class Verdict(Enum):
    """The verdict on a sample by its sequence number."""

    NEXT = "the next of its publisher, or the first"
    GAP = "new, with samples lost before it"
    RESYNCED = "new, though its number says otherwise: the publisher restarted its numbers, or they were forged"
    REPEATED = "not new"
    TOO_FAR = "too far ahead"


class SequenceTracker:
    """Tracks the sequence numbers of a subscriber's publishers.

    Numbers grow by one from sample to sample. Any program on the network can send a sample under a publisher's id, so a
    number alone must not block the true publisher:

    - A number is recorded only once the payload was accepted: the caller calls ``judge``, and then ``accept``.
    - A number more than MAX_GAP ahead is refused.
    - A number that does not grow is a repetition (a second path, a latched value sent again), unless its source time
      is later than that of the last accepted sample: then it is new, and numbers continue from it. A last source time
      more than AHEAD_NS ahead of this machine's clock does not make a plausible one older.
    - Where source times do not help (machines with different clocks), numbers that grow for RESYNC_S, while the
      expected ones do not arrive, are accepted, as in RFC 3550, A.1.

    So after a forged sample, the next true one is accepted if clocks agree, and otherwise one within RESYNC_S or after
    the next period, whichever is longer. ``last`` is the last accepted number of each publisher.
    """

    def __init__(self) -> None:
        self.last: dict[bytes, int] = {}
        self.stamps: dict[bytes, int] = {}
        self._seen: dict[bytes, int] = {}
        self._unexpected: dict[bytes, tuple[int, float, int]] = {}

    def judge(self, origin: SampleInfo) -> Verdict:
        """Return the verdict on a sample by its number and source time, without recording them."""
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
        """Record the number of a refused sample, the next one or the first of its publisher, so that it is neither
        counted as lost as well nor waited for.

        Its source time is not recorded, so that a forged sample does not block the true one of the same number.
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
        """Return whether unexpected numbers have grown for RESYNC_S while no expected one was accepted."""
        now = monotonic()
        before, since, accepted = self._unexpected.get(publisher, (0, now, -1))
        if accepted != last or not before < sequence <= before + MAX_GAP:
            since = now
        elif now - since >= RESYNC_S:
            del self._unexpected[publisher]
            return True
        self._unexpected[publisher] = sequence, since, last
        return False

    def _forget_one(self) -> None:
        """Forget a publisher that has been silent for long, found without a time stamp for each sample.

        From the oldest on, each publisher whose number has changed since the last check gets a second chance.
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
        self._unexpected.pop(publisher, None)


_REASON = 200
"""Maximum characters of a reason."""


class RefusalCounter:
    """Counts the refused samples of a key without a Subscriber: lockstep's messages, and the clock of a pacer.

    The node's health lists it under ``name`` once a sample was refused.
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
        """Return the counts for the node's health."""
        return InputHealth(topic=self.name, received=self.received, refused=self.refused, reason=self.reason)
