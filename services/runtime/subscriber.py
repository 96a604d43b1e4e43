"""Subscribers: check and count samples and snapshot them at the start of a tick, as the latest value or a stream."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Set
from itertools import chain, islice
from typing import Any, Generic, NamedTuple, TypeVar

from messages.base import DECODE_ERRORS, Message, raw_decoder, saturating_add
from messages.elea import InputHealth
from messages.names import key as key_of
from messages.std import Header
from messages.topics import Quality, Topic
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.transport.api import RawSubscriber, Sample, Transport
from services.runtime.transport.sequences import MAX_GAP, SequenceTracker, Verdict
from services.runtime.transport.wire import (
    ATTACHMENT_SIZE,
    FORMAT,
    MEMBER_BYTES,
    NODE_BYTES,
    SampleInfo,
    encoding,
    member_id,
    publisher_id,
    unpack_attachment,
)
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE

M = TypeVar("M", bound=Message)

QUEUE_SIZE = 1024
"""Samples kept between two updates; more than any topic carries in one tick of the slowest reader."""
EVENT_QUEUE_SIZE = 8192
"""The same for events, which arrive in bursts."""
QUEUE_BYTES = 1 << 26
"""Maximum bytes queued in one subscription: topics with large messages get shorter rings."""
MIN_QUEUE_SIZE, MIN_UNTYPED_QUEUE_SIZE = 4, 64
LARGE_TYPES = frozenset({"Image", "CompressedImage", "PointCloud2", "PointCloud", "OccupancyGrid", "MarkerArray"})
"""Types of ROS whose messages are usually large."""
LARGEST_ATTACHMENT = 256
"""Maximum bytes of a foreign attachment; samples with a longer one are refused."""

WAIT_BUDGET_S = 30.0
"""Wall time [s] that a lockstep tick waits in total for samples already sent; then they count as lost."""
LOOK_PERIOD_S = 2.0
"""Wall time [s] of such a wait between two checks of which publishers are still there."""


class WaitBudget:
    """The WAIT_BUDGET_S of one tick, shared by all subscribers; ``turn`` is called at each step of a wait.

    ``missed`` are the topics with samples that did not arrive. ``members`` returns the ids of the nodes that are
    there, None if they are unknown.
    """

    def __init__(
        self, turn: Callable[[], None] = lambda: None, members: Callable[[], Set[bytes] | None] | None = None
    ) -> None:
        self.missed: list[str] = []
        self._turn, self._members = turn, members
        self._deadline = self._look = 0.0

    def sleep(self) -> bool:
        """Sleep for 50 us; returns False if the budget is used up."""
        now = time.monotonic()
        if self._deadline == 0.0:
            self._deadline, self._look = now + WAIT_BUDGET_S, now + LOOK_PERIOD_S
        elif now > self._deadline:
            return False
        self._turn()
        time.sleep(0.00005)
        return True

    def gone(self, publishers: Collection[bytes]) -> list[bytes]:
        """Return the publishers whose nodes are gone; checks every LOOK_PERIOD_S, and returns none in between."""
        now = time.monotonic()
        if self._members is None or now < self._look:
            return []
        self._look = now + LOOK_PERIOD_S
        there = self._members()
        return [] if there is None else [each for each in publishers if each[:MEMBER_BYTES] not in there]


def queue_size(largest: int, event: bool = False, untyped: bool = False) -> int:
    """Return the ring size, in samples, for messages of at most ``largest`` bytes; a full ring overwrites the oldest.

    Messages of an unknown type are rarely as large as allowed, so an ``untyped`` reader has a longer ring.
    """
    return max(
        MIN_UNTYPED_QUEUE_SIZE if untyped else MIN_QUEUE_SIZE,
        min(EVENT_QUEUE_SIZE if event else QUEUE_SIZE, QUEUE_BYTES // largest),
    )


def foreign_queue_size(ros_type: str) -> int:
    """Return the ring size for a topic that is not in this project's table, so that its usual size is unknown."""
    return MIN_UNTYPED_QUEUE_SIZE if ros_type.rpartition("/")[2] in LARGE_TYPES else QUEUE_SIZE


class Subscriber(Generic[M]):
    """One subscription. Its owner calls ``update`` once a tick; ``messages`` are then the new ones, oldest first.

    Refused samples (wrong type, undecodable, too large, implausible sequence number), repeated ones and lost ones (gaps
    in the numbers) are counted, never passed on; ``SequenceTracker`` has the rules. A sample without our attachment is
    foreign: it is accepted if it decodes.
    """

    def __init__(
        self,
        topic: Topic[M],
        name: str,
        key: str,
        transport: Transport,
        decode: Callable[[bytes], Any] | None = None,
        capacity: int | None = None,
        latched: bool | None = None,
        *,
        rare: bool = False,
        threaded: bool = False,
    ) -> None:
        """Subscribe.

        Args:
            topic: Defines type, quality and maximum size.
            name: The absolute name, for counts and log texts.
            key: The key on the network.
            transport: The network.
            decode: Decodes payloads of a type that this project does not know, ``bytes`` to keep them as they are; by
                default the decoder of the topic's record.
            capacity: Samples in the ring, by default that of ``queue_size``.
            latched: Whether to query the last samples of latched publishers, by default for a latched topic.
            rare: Have the network notify of samples, so that ``update`` costs nothing without any. For topics that
                rarely carry anything, and that no loop waits on.
            threaded: Whether a thread of its own waits for its samples.
        """
        self.topic, self.name, self.key = topic, name, key
        self.encoding = encoding(topic.record.ROS_TYPE)
        self._capacity = capacity or queue_size(topic.largest, topic.quality is Quality.EVENT, decode is not None)
        past = topic.quality is Quality.LATCHED if latched is None else latched
        self._rare, self.pending = rare, True
        """Whether ``update`` may find or change anything; always true, unless the subscription is ``rare``."""
        if threaded:
            self.raw: RawSubscriber = transport.subscribe_threaded(key, self._capacity, past)
        else:
            self.raw = transport.subscribe(key, self._capacity, past, self._on_sample if rare else None)
        self.messages: list[tuple[M, SampleInfo | None]] = []
        self.received = self.lost = self.refused = self.foreign = self.repeated = self.resynced = 0
        self.reason = ""
        self._largest = topic.largest
        self._only = member_id(topic.only, "")[:NODE_BYTES] if topic.only else b""
        self._by_ticks = topic.quality is not Quality.VITAL
        """Whether lockstep orders its samples. Heartbeats follow the wall clock; no member reports their numbers."""
        self._strict = topic.quality in (Quality.COMMAND, Quality.LATCHED)
        self._decode: Callable[[bytes], Any] = decode or raw_decoder(topic.record)
        self._sequences = SequenceTracker()
        self._last, self._stamps = self._sequences.last, self._sequences.stamps
        self._gaps: dict[tuple[bytes, int], int] = {}
        """How many samples were missing before each one just read, by publisher and number; summed if read twice."""
        self._deferred: dict[bytes, deque[tuple[M, SampleInfo, int]]] = {}
        """By publisher, the samples that its member has not reported yet, in the order of their numbers, each with the
        count of samples missing before it.
        """
        self._topic_bytes = publisher_id("", "", key)[MEMBER_BYTES:]

    def update(self, watermarks: Watermarks | None = None, budget: WaitBudget | None = None) -> None:
        """Read new samples. With ``watermarks`` (lockstep), defer members' samples until their senders report them."""
        if self._gaps:
            self._gaps.clear()
        fresh = self._drain() if self.pending else []
        if watermarks is None:
            if self._deferred:
                fresh = [*(entry[:2] for held in self._deferred.values() for entry in held), *fresh]
                self._deferred.clear()
            self.messages = fresh
            return
        if awaited := watermarks.required.get(self.key):
            self._wait_for_required(awaited, fresh, budget or WaitBudget())
        if fresh and (before := watermarks.skipped.get(self.key)):
            fresh = [each for each in fresh if each[1] is None or each[1].sequence > before.get(each[1].publisher, 0)]
        if not fresh and not self._deferred:
            self.messages = fresh
            return
        reached = watermarks.admitted_upto.get(self.key, {})
        ready: list[tuple[M, SampleInfo | None]] = []
        if self._deferred:
            for _, origin in fresh:
                if origin is not None:
                    self._drop_replaced(origin)
            self._admit_deferred(watermarks, reached, ready)
        for entry in fresh:
            origin = entry[1]
            if (
                self._by_ticks
                and origin is not None
                and (publisher := origin.publisher)[:MEMBER_BYTES] in watermarks.members
                and origin.sequence > (last := reached.get(publisher, 0))
            ):
                self._defer(entry[0], origin, last)
            else:
                ready.append(entry)
        if len(ready) > 1:
            ready.sort(key=_order)
        self.messages = ready

    def recv(self) -> M | None:
        """Return the next message or None, for loops that handle each message on arrival, without ticks."""
        self._gaps.clear()
        while (sample := self.raw.recv()) is not None:
            if (entry := self._decode_sample(sample)) is not None:
                return entry[0]
        return None

    def close(self) -> None:
        """End the subscription."""
        self.raw.close()

    def reject(self, reason: str) -> None:
        """Count a sample as refused; the owner calls this for one that decodes but has invalid content."""
        self.refused += 1
        self.reason = reason[:200]

    def health(self) -> InputHealth:
        """Return the counts for the node's health."""
        return InputHealth(
            topic=self.name,
            received=self.received,
            lost=self.lost,
            refused=self.refused,
            foreign=self.foreign,
            reason=self.reason,
            repeated=self.repeated,
            resynced=self.resynced,
        )

    def _drain(self) -> list[tuple[M, SampleInfo | None]]:
        """Read the queued samples, at most one ring's worth: a flood may fill it faster than it is read."""
        taken: list[tuple[M, SampleInfo | None]] = []
        if self._rare:
            # Cleared before reading: a sample that arrives meanwhile is read now or at the next update. Messages that
            # the last update returned, or that are deferred, need another update.
            self.pending = bool(self.messages or self._deferred)
        if (first := self.raw.recv()) is None:
            return taken
        decode_sample = self._decode_sample
        for sample in chain((first,), islice(iter(self.raw.recv, None), self._capacity - 1)):
            if (entry := decode_sample(sample)) is not None:
                taken.append(entry)
        if taken:
            self.pending = True
        return taken

    def _decode_sample(self, sample: Sample) -> tuple[M, SampleInfo | None] | None:
        """Return the message of a sample if it is new, on this topic's key and of its type; count gaps as lost.

        Reading key and type takes 2 us: it is done for each command, each foreign sample, and each that does not
        continue its publisher's numbers. The rest takes about 2 us for an Odometry.
        """
        payload, attachment, source = sample
        origin = unpack_attachment(attachment)
        follows = False
        if origin is not None:
            sequence, source_ns, _, publisher = origin
            last = self._last.get(publisher)
            follows = last is not None and sequence == last + 1
        if (not follows or self._strict) and not self._accept(source, origin):
            return None
        if origin is None:
            if len(attachment) > LARGEST_ATTACHMENT:
                self.reject(f"an attachment of {len(attachment)} bytes; ours has {ATTACHMENT_SIZE}")
                return None
            self.foreign += 1
        if len(payload) > self._largest:
            self._reject_payload(origin, follows, f"{len(payload)} bytes, the limit is {self._largest}")
            return None
        try:
            message = self._decode(payload)
        except DECODE_ERRORS as error:
            self._reject_payload(origin, follows, str(error))
            return None
        if follows:
            self._last[publisher], self._stamps[publisher] = sequence, source_ns
        elif origin is not None and not self._is_new(origin):
            return None
        self.received += 1
        return message, origin

    def _on_sample(self) -> None:
        """Note that a sample of a rare topic has arrived; called in a thread of the network."""
        self.pending = True

    def _is_new(self, origin: SampleInfo) -> bool:
        """Return whether to accept a valid sample that does not continue its publisher's numbers, and count it."""
        last = self._last.get(origin.publisher, 0)
        verdict = self._sequences.judge(origin)
        if verdict is Verdict.REPEATED:
            self.repeated += 1
            return False
        if verdict is Verdict.TOO_FAR:
            self.reject(f"number {origin.sequence} after {last}: at most {MAX_GAP} may be missing; is it forged?")
            return False
        if verdict is Verdict.GAP:
            missing = origin.sequence - last - 1
            at = origin.publisher, origin.sequence
            self._gaps[at] = self._gaps.get(at, 0) + missing
            self.lost = saturating_add(self.lost, missing)
        elif verdict is Verdict.RESYNCED:
            self.resynced += 1
        self._sequences.accept(origin)
        return True

    def _reject_payload(self, origin: SampleInfo | None, follows: bool, reason: str) -> None:
        """Refuse a payload. If its number was the next one due, it is skipped: not counted as lost, nor waited for."""
        self.reject(reason)
        if origin is not None and (follows or origin.publisher not in self._last):
            self._sequences.pass_over(origin.publisher, origin.sequence)

    def _accept(self, source: Any, origin: SampleInfo | None) -> bool:
        """Return whether a sample has this topic's own key and type, and comes from its only publisher, if it has one.

        A put to a wildcard reaches every topic that it matches, and each refuses it.
        """
        key, kind = self.raw.key(source), self.raw.encoding(source)
        if key != self.key:
            self.reject(f"sent to {key[:80]!r}, not to this topic alone")
        elif kind and kind != self.encoding:
            self.reject(f"expected {self.encoding}, got {kind[:80]}")
        elif self._only and (origin is None or origin.publisher[:NODE_BYTES] != self._only):
            self.reject(f"not from the node {self.topic.only}, which alone may publish it")
        else:
            return True
        return False

    def _wait_for_required(
        self, awaited: dict[bytes, int], fresh: list[tuple[M, SampleInfo | None]], budget: WaitBudget
    ) -> None:
        """Block until every required sample has arrived. Samples that do not arrive within the budget, or whose
        publisher is gone, count as lost.
        """
        lost: set[bytes] = set()
        while missing := [
            each for each, number in awaited.items() if self._last.get(each, 0) < number and each not in lost
        ]:
            lost.update(budget.gone(missing) if budget.sleep() else missing)
            fresh += self._drain()
        for publisher in lost:
            # The first number of a publisher without any sample is unknown, so at least one is lost.
            if (last := self._last.get(publisher)) is None:
                self.lost = saturating_add(self.lost, 1)
            elif last < awaited[publisher]:
                self.lost = saturating_add(self.lost, awaited[publisher] - last)
                self._sequences.give_up(publisher, awaited[publisher])
            else:
                continue  # it arrived at the last moment
            budget.missed.append(self.name)

    def _admit_deferred(
        self, watermarks: Watermarks, reached: dict[bytes, int], ready: list[tuple[M, SampleInfo | None]]
    ) -> None:
        """Admit deferred samples that their member has reported, and all those of nodes that are no longer members."""
        for publisher, held in list(self._deferred.items()):
            last = reached.get(publisher, 0) if publisher[:MEMBER_BYTES] in watermarks.members else held[-1][1].sequence
            while held and held[0][1].sequence <= last:
                ready.append(held.popleft()[:2])
            if held and watermarks.epoch_changed:
                for *_, missing in held:
                    self._retract(missing, "a member's number that it had not reported before the reset: is it forged?")
                held.clear()
            if not held:
                del self._deferred[publisher]

    def _defer(self, message: M, origin: SampleInfo, last: int) -> None:
        """Defer a member's sample until its number is reported; ``last`` is the last reported one."""
        publisher, number = origin.publisher, origin.sequence
        missing = self._gaps.pop((publisher, number), 0)
        if publisher[MEMBER_BYTES:] != self._topic_bytes:
            self._retract(missing, "under the id of a lockstep member, which does not publish this topic")
        elif number > last + self._capacity:
            self._retract(missing, f"number {number} of a lockstep member that has reported {last}: is it forged?")
        else:
            self._drop_replaced(origin)
            self._deferred.setdefault(publisher, deque()).append((message, origin, missing))

    def _drop_replaced(self, origin: SampleInfo) -> None:
        """Refuse deferred samples of the same publisher with this number or a higher one: they were forged, as the true
        numbers continue below them.
        """
        held = self._deferred.get(origin.publisher)
        while held and held[-1][1].sequence >= origin.sequence:
            missing = held.pop()[2]
            self._retract(missing, f"number {origin.sequence} came again from a lockstep member: was one forged?")

    def _retract(self, missing: int, reason: str) -> None:
        """Count an accepted sample as refused instead, and the samples missing before it as not lost."""
        self.received -= 1
        self.lost -= missing
        self.reject(reason)


def _order(entry: tuple[Message, SampleInfo | None]) -> tuple[bytes, bytes, int]:
    """Sort key of sender (a hash of its name), topic and number: the same order in every run, whatever the timing."""
    origin = entry[1]
    if origin is None:
        return b"", b"", 0
    return origin.publisher[:NODE_BYTES], origin.publisher[MEMBER_BYTES:], origin.sequence


class ReceivedSample(NamedTuple):
    """A sample of any type; ``type`` is the ROS type that its sender states, or empty; times in ns of the wall clock.

    ``lost`` is the number of its publisher's samples missing before it.
    """

    payload: bytes
    origin: SampleInfo | None
    type: str
    received_ns: int
    lost: int

    @property
    def sent_ns(self) -> int:
        """Send time [ns] by the sender's clock; for a foreign sender, the time of arrival."""
        return self.received_ns if self.origin is None else self.origin.source_ns


class UntypedSubscriber(Subscriber[Message]):
    """A subscription outside a node, to a topic whose type is not known in advance."""

    def __init__(
        self, transport: Transport, name: str, latched: bool = False, capacity: int = EVENT_QUEUE_SIZE
    ) -> None:
        topic = Topic(name, Message, 0, Quality.LATCHED if latched else Quality.SENSOR, "", LARGEST_MESSAGE)
        super().__init__(topic, name, key_of(name), transport, bytes, capacity)

    def drain(self) -> Iterator[ReceivedSample]:
        """Yield the new samples, oldest first."""
        while (sample := self.raw.recv()) is not None:
            lost = self.lost
            entry: tuple[Any, SampleInfo | None] | None = self._decode_sample(sample)
            if entry is not None:
                form, _, type_name = self.raw.encoding(sample[2]).partition(";")
                stated = type_name if form == FORMAT else ""
                yield ReceivedSample(*entry, stated, time.time_ns(), self.lost - lost)

    def _accept(self, source: Any, origin: SampleInfo | None) -> bool:
        """Accept samples of every type."""
        return True


class Latest(Generic[M]):
    """The newest message of a topic, as of the start of the tick."""

    def __init__(self, source: Subscriber[M], now: Callable[[], int]) -> None:
        self._source, self._now = source, now
        self.latched = source.topic.quality is Quality.LATCHED
        self.value: M | None = None
        self.info: SampleInfo | None = None
        self._stamp = 0

    def refresh(self) -> None:
        """Update from the subscriber's last batch."""
        if self._source.messages:
            self.value, self.info = self._source.messages[-1]
            header = getattr(self.value, "header", None)
            self._stamp = header.stamp.ns if isinstance(header, Header) else self._now()

    def clear(self) -> None:
        """Forget the value."""
        self.value = self.info = None

    @property
    def age(self) -> float:
        """Simulation time [s] since the message's stamp, or since its arrival if it has none; inf without a message."""
        return (self._now() - self._stamp) / 1e9 if self.value is not None else float("inf")

    def fresh(self, seconds: float) -> M | None:
        """Return the value, or None if it is older than ``seconds`` of simulation time."""
        return self.value if self.value is not None and self.age <= seconds else None


class Stream(Generic[M]):
    """Every message of a topic, in order."""

    def __init__(self, source: Subscriber[M]) -> None:
        self._source = source
        self.latched = source.topic.quality is Quality.LATCHED
        self._messages: list[M] = []

    def refresh(self) -> None:
        """Add the subscriber's new messages."""
        self._messages += [message for message, _ in self._source.messages]
        excess = len(self._messages) - QUEUE_SIZE
        if excess > 0:
            self._source.lost = saturating_add(self._source.lost, excess)
            del self._messages[:excess]

    def clear(self) -> None:
        """Forget all messages."""
        self._messages = []

    def drain(self) -> list[M]:
        """Return the messages since the last call, oldest first."""
        messages, self._messages = self._messages, []
        return messages
