"""Sequence numbers are untrusted: forged ones silence no publisher, duplicates are dropped, and all are counted."""

from __future__ import annotations

import struct
import time

import pytest

from messages.base import MOST_COUNTED, encode
from messages.std import Bool
from messages.topics import E_STOP, Quality
from services.runtime.subscriber import Subscriber
from services.runtime.transport import sequences
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.sequences import MAX_GAP, RESYNC_S
from services.runtime.transport.wire import encoding, publisher_id

KEY = "tb3_0/e_stop"
ID = publisher_id("/panel", "1f", KEY)
SECOND = 10**9
HOUR = 3600 * SECOND


class SequenceHarness:
    """A subscriber, and samples for it with any number, source time and publisher id."""

    def __init__(self) -> None:
        bus = MemoryBus()
        self.source = Subscriber(E_STOP, "/tb3_0/e_stop", KEY, MemoryTransport(bus))
        self._outlet = MemoryTransport(bus).advertise(KEY, encoding(Bool.ROS_TYPE), Quality.LATCHED)

    def send(self, number: int, stamp: int, publisher: bytes = ID, payload: bytes = encode(Bool(data=True))) -> bool:
        """Publish a sample; return whether it was accepted."""
        self._outlet.put(payload, attachment=struct.pack("<qqB16s", number, stamp, 16, publisher))
        self.source.update()
        return bool(self.source.messages)

    @property
    def counts(self) -> tuple[int, int, int, int, int]:
        """The counts received, lost, refused, repeated and resynced."""
        told = self.source.health()
        return told.received, told.lost, told.refused, told.repeated, told.resynced


@pytest.fixture
def bus() -> SequenceHarness:
    return SequenceHarness()


def test_after_any_forged_sample_the_next_true_one_is_heard() -> None:
    now = time.time_ns()
    numbers = (1, 6, 7, 8, 100, 6 + MAX_GAP, 7 + MAX_GAP, 8 + MAX_GAP, 2**40, 2**62, 2**63 - 1)
    stamps = (-(2**63), 0, now - HOUR, now - 1, now + 10_000_000, now + SECOND, now + HOUR, 2**63 - 1)
    good, bad = encode(Bool(data=False)), b"\xc1garbage"
    for number in numbers:
        for stamp in stamps:
            for payload in (good, bad):
                bus = SequenceHarness()
                for own in range(1, 7):
                    assert bus.send(own, now - SECOND + own)
                bus.send(number, stamp, payload=payload)
                later = max(now, stamp + 1) if stamp < now + 100_000_000 else now
                assert bus.send(7, later), f"mute after number {number}, stamp {stamp - now:+} ns, {payload!r}"
                assert bus.send(8, later + 1)
                received, lost, refused, repeated, _ = bus.counts
                assert received + refused + repeated == 9, "every sample is counted"
                assert lost <= MAX_GAP + 1


def test_a_number_far_ahead_is_refused_with_a_reason(bus: SequenceHarness) -> None:
    now = time.time_ns()
    assert bus.send(5, now)
    assert not bus.send(2**63 - 1, now + 1)
    assert bus.counts == (1, 0, 1, 0, 0)
    assert "9223372036854775807 after 5" in bus.source.reason
    assert "1048576" in bus.source.reason
    assert bus.send(6 + MAX_GAP, now + 2), "as many may be missing"
    assert bus.counts == (2, MAX_GAP, 1, 0, 0)


def test_what_comes_twice_is_dropped_and_counted_whatever_was_forged_before(bus: SequenceHarness) -> None:
    """From a second path or a late cache: the same number and source time, or older ones."""
    now = time.time_ns()
    for number in range(1, 6):
        assert bus.send(number, now + number)
    assert not bus.send(5, now + 5)
    for number in (3, 4, 5, 1):
        assert not bus.send(number, now + number), "a burst by a second path"
    assert bus.counts == (5, 0, 0, 5, 0)
    assert bus.send(6, now + 6)


def test_a_publisher_that_counts_anew_under_its_old_id_is_heard_at_once(bus: SequenceHarness) -> None:
    now = time.time_ns()
    for number in range(1, 100):
        bus.send(number, now + number)
    assert [bus.send(number, now + 1000 + number) for number in (1, 2, 3)] == [True, True, True]
    assert bus.counts == (102, 0, 0, 0, 1)


def test_where_clocks_differ_numbers_that_go_on_growing_are_followed(
    bus: SequenceHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sender at 25 Hz whose clock is an hour behind, after a sample forged with this machine's time."""
    for first, ahead in ((7, 1000), (7, -HOUR), (MAX_GAP * 3, 0)):
        bus, clock = SequenceHarness(), [100.0]
        monkeypatch.setattr(sequences, "monotonic", lambda clock=clock: clock[0])
        now = time.time_ns()
        behind = now - HOUR if ahead >= 0 else now + HOUR
        assert bus.send(first - 1, behind)
        # A low number with a late stamp, or a high number: both are accepted as the publisher's.
        assert bus.send(1 if first > MAX_GAP else first + 500, now if ahead >= 0 else behind + HOUR)
        silent = 0
        for number in range(first, first + 20):
            clock[0] += 0.04
            if bus.send(number, behind + number):
                break
            silent += 1
        assert 0.04 * silent <= RESYNC_S + 0.04
        assert bus.send(number + 1, behind + number + 1)
        assert bus.source.health().resynced >= 1


def test_a_second_path_never_takes_over_while_the_first_goes_on(
    bus: SequenceHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [100.0]
    monkeypatch.setattr(sequences, "monotonic", lambda: clock[0])
    now = time.time_ns()
    for number in range(10, 200):
        clock[0] += 0.04
        assert bus.send(number, now + number)
        if number > 15:
            assert not bus.send(number - 5, now + number - 5)
    assert bus.counts == (190, 0, 0, 184, 0)


def test_counters_stay_where_a_count_ends(bus: SequenceHarness) -> None:
    bus.source.lost = MOST_COUNTED - 3
    now = time.time_ns()
    bus.send(1, now)
    bus.send(1000, now + 1)
    assert bus.source.health().lost == MOST_COUNTED


def test_a_refused_payload_is_not_lost_as_well(bus: SequenceHarness) -> None:
    now = time.time_ns()
    bus.send(1, now)
    bus.send(2, now + 1, payload=b"\xc1")
    bus.send(3, now + 2)
    assert bus.counts == (2, 0, 1, 0, 0)


def test_forged_ids_do_not_make_a_reader_forget_who_speaks(
    bus: SequenceHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sequences, "MAX_PUBLISHERS", 64)
    now = time.time_ns()
    quiet = b"quiet".ljust(16)
    assert bus.send(1, now, quiet)
    number = 0
    for forged in range(1000):
        if forged % 20 == 0:
            number += 1
            assert bus.send(number, now + number)
        bus.send(1, now, f"forged{forged}".encode().ljust(16))
    before = bus.counts
    assert not bus.send(number - 1, now + number - 1), "it is known still"
    assert bus.source.health().repeated == before[3] + 1
    assert bus.send(1, now, quiet), "who was silent longest was forgotten"
    judged = bus.source._sequences
    sizes = {len(judged.last), len(judged.stamps)}
    assert sizes == {64}
    assert max(len(judged._seen), len(judged._unexpected)) <= 64


def test_an_absurd_attachment_is_refused(bus: SequenceHarness) -> None:
    bus._outlet.put(encode(Bool(data=True)), attachment=bytes(1000))
    bus.source.update()
    assert (bus.source.messages, bus.source.refused, bus.source.foreign) == ([], 1, 0)
    assert "1000 bytes" in bus.source.reason
