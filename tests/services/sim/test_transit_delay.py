"""The age of samples despite clock steps and drift, forged stamps, freezes and bursts, on simulated time.

A history defines when a publisher sends, the clock that stamps, and when its samples arrive, in order. Two conditions
must hold in each: a sample in transit for longer than the time-out is never accepted as fresh, and timely samples are
rejected for at most one time-out after an event.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import ceil, floor
from typing import Literal

import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from services.runtime.transport.wire import SampleInfo
from services.sim.transit_delay import MAX_SENDERS, TransitDelayEstimator

TIMEOUT = 0.25
TICK = 0.02
"""Interval [s] at which the simulation reads samples."""
NEAR = 0.05
"""Delays that differ by less [s] count as equal."""
HOUR = 3600.0
EPOCH = 1.7e9
"""Time of the wall clock at start [s]."""

Kind = Literal["step", "both", "local", "link", "sender", "silence", "forged"]


@dataclass(frozen=True)
class Event:
    """An event at ``at`` [s] of ``size`` [s]: a clock is stepped (the sender's, both, or the simulation's), samples
    wait on the link or in the sender, nothing is sent, or one stamp is forged.
    """

    at: float
    kind: Kind
    size: float


@dataclass
class History:
    """A sender's history; ``offset`` is its clock minus the simulation's [s], ``drift`` its rate error [s/s]."""

    seconds: float
    rate: float = 25.0
    events: tuple[Event, ...] = ()
    offset: float = 0.0
    drift: float = 0.0
    latency: tuple[float, float] = (0.001, 0.01)
    chance: random.Random = field(default_factory=lambda: random.Random(1))

    def of(self, *kinds: Kind) -> tuple[Event, ...]:
        """Return the events of these kinds."""
        return tuple(each for each in self.events if each.kind in kinds)

    def samples(self) -> Iterator[tuple[float, float, float, bool]]:
        """Yield each sample's sending time, arrival time and stamp [s], and whether the stamp is forged."""
        arrived, forged = 0.0, {each.at: each for each in self.of("forged")}
        pauses, steps, delays = self.of("silence", "sender"), self.of("step", "both"), self.of("link", "sender")
        ahead = sorted((each.at, each.at + each.size) for each in pauses)
        number, count = -1, ceil(self.seconds * self.rate)
        while (number := number + 1) < count:
            sent = number / self.rate
            while ahead and ahead[0][1] <= sent:
                ahead.pop(0)
            if ahead and ahead[0][0] <= sent and (ends := [end for begin, end in ahead if begin <= sent < end]):
                number = max(number, floor(max(ends) * self.rate) - 1)
                continue
            stamp = EPOCH + sent + self.offset + self.drift * sent + set_by(steps, sent)
            arrival = sent + self.chance.uniform(*self.latency)
            for each in delays:
                # A frozen sender delays its last half second, in its buffers; a stuck link delays all that is sent
                # meanwhile.
                begin = each.at if each.kind == "link" else each.at - 0.5
                if begin <= sent < each.at + each.size:
                    arrival = max(arrival, each.at + each.size)
            arrived = max(arrived, ceil(arrival / TICK) * TICK)
            due = next((at for at in forged if at <= sent), None)
            if due is not None:
                yield sent, arrived, stamp + forged.pop(due).size, True
            else:
                yield sent, arrived, stamp, False


def set_by(steps: tuple[Event, ...], at: float) -> float:
    """Return the sum [s] of the clock steps up to ``at`` [s]."""
    return sum(each.size for each in steps if each.at <= at)


class Receiver:
    """Estimates the ages of a history's samples, on the test's clocks."""

    def __init__(self, history: History) -> None:
        self.history, self.now, self.number = history, 0.0, 0
        self.steps = history.of("both", "local")
        self.ages = TransitDelayEstimator(self._wall, lambda: round(self.now * 1e9))

    def _wall(self) -> int:
        return round((EPOCH + self.now + set_by(self.steps, self.now)) * 1e9)

    def age(self, arrived: float, stamp: float) -> float:
        self.now, self.number = arrived, self.number + 1
        return self.ages.estimate(SampleInfo(self.number, round(stamp * 1e9), 16, b"p" * 16))


def judge(history: History, allowed: int | None = None) -> int:
    """Return how many timely samples were rejected. Fail if an old sample was accepted, if a sender was locked out for
    too long, or if more than ``allowed`` were rejected.
    """
    receiver, refused = Receiver(history), 0
    taken = before = 0.0
    gap = max(2 * TIMEOUT, 2 / history.rate) + 2 * TICK
    for sent, arrived, stamp, forged in history.samples():
        age = receiver.age(arrived, stamp)
        if forged:
            continue
        late = arrived - sent
        if late > TIMEOUT + NEAR + TICK:
            assert age > TIMEOUT, f"at {arrived} s a sample of {sent} s was taken for {age} s old"
        if sent - before > 1.5 / history.rate or late > 0.1:
            taken = arrived  # the flow was interrupted: the lock-out counts from here
        before = sent
        if age <= TIMEOUT:
            taken = arrived
        elif late <= 0.1:
            refused += 1
            assert arrived - taken <= gap, f"at {arrived} s the sender is locked out since {taken} s"
    assert allowed is None or refused <= allowed, refused
    return refused


def one(kind: Kind, size: float, rate: float = 25.0, **more: float) -> History:
    """Return a history of 10 s with an event at 4 s."""
    return History(10.0, rate, (Event(4.0, kind, size),), **more)


PROVED = 5
"""Number of samples at 25 Hz that confirm a new baseline."""
TABLE: dict[str, tuple[Callable[[], History], int]] = {
    "all is well": (lambda: History(60.0), 0),
    "the sender's clock is set back by 2 s": (lambda: one("step", -2.0), PROVED),
    "it is set ahead by 2 s": (lambda: one("step", 2.0), PROVED),
    "it is set back by less than the time-out": (lambda: one("step", -0.2), 0),
    "it is set ahead by less than the time-out": (lambda: one("step", 0.2), PROVED),
    "it is set back by a year": (lambda: one("step", -365 * 24 * HOUR), PROVED),
    "both clocks are set back, on one machine": (lambda: one("both", -2.0), 0),
    "both are set ahead": (lambda: one("both", HOUR), 0),
    "the simulation's clock alone is set back": (lambda: one("local", -2.0), PROVED),
    "the simulation's clock alone is set ahead": (lambda: one("local", 2.0), PROVED),
    "it is set back and ahead again": (
        lambda: History(20.0, events=(Event(4.0, "step", -2.0), Event(9.0, "step", 2.0))),
        2 * PROVED,
    ),
    "it is set back in six steps": (
        lambda: History(20.0, events=tuple(Event(4.0 + 2 * n, "step", -0.5) for n in range(6))),
        6 * PROVED,
    ),
    "a sender an hour ahead": (lambda: History(10.0, offset=HOUR), PROVED),
    "a sender an hour behind": (lambda: History(10.0, offset=-HOUR), PROVED),
    "a first stamp an hour ahead": (lambda: History(10.0, events=(Event(0.0, "forged", HOUR),)), 0),
    "a forged stamp in the middle, ahead": (lambda: one("forged", HOUR), 0),
    "a forged stamp in the middle, behind": (lambda: one("forged", -HOUR), 0),
    "the link is stuck for 3 s": (lambda: one("link", 3.0), 0),
    "the sender is frozen for 3 s": (lambda: one("sender", 3.0), 0),
    "the link is stuck again and again": (
        lambda: History(30.0, events=tuple(Event(2.0 + 4 * n, "link", 3.0) for n in range(6))),
        0,
    ),
    "the link is stuck as the sender begins": (lambda: History(10.0, events=(Event(0.0, "link", 3.0),)), 0),
    "a machine that sleeps for an hour, clocks and all": (
        lambda: History(HOUR + 20.0, events=(Event(4.0, "silence", HOUR), Event(4.0, "both", 8 * HOUR))),
        0,
    ),
    "a sender at 1 Hz whose clock is set back": (lambda: one("step", -2.0, 1.0), 1),
    "a sender at 1 Hz whose clock is set ahead": (lambda: one("step", HOUR, 1.0), 1),
    "a sender at 1 Hz an hour ahead": (lambda: History(10.0, 1.0, offset=HOUR), 1),
    "a sender at 1 Hz on a stuck link": (lambda: one("link", 3.0, 1.0), 0),
    "a sender at 5 Hz whose clock is set back": (lambda: one("step", -2.0, 5.0), 1),
    "a busy machine": (lambda: History(60.0, latency=(0.0, 0.15)), 0),
    "a machine that is busy for a while": (
        lambda: History(60.0, latency=(0.0, 0.02), events=tuple(Event(2.0 + n, "link", 0.2) for n in range(50))),
        0,
    ),
}


def test_histories() -> None:
    for name, (history, allowed) in TABLE.items():
        try:
            judge(history(), allowed)
        except AssertionError as error:
            raise AssertionError(f"{name}: {error}") from None


@pytest.mark.slow
def test_drift_of_a_day() -> None:
    """100 ppm make 8.64 s in a day; the sender is active for 40 s of each half hour."""
    for drift in (1e-4, -1e-4):
        pauses = tuple(Event(n * HOUR / 2 + 40.0, "silence", HOUR / 2 - 40.0) for n in range(48))
        judge(History(24 * HOUR, 25.0, pauses, drift=drift), 48 * PROVED)
        judge(History(HOUR, 25.0, drift=drift), 0)


@pytest.mark.slow
def test_a_day_of_drift_at_a_low_rate() -> None:
    for drift in (1e-4, -1e-4):
        judge(History(24 * HOUR, 0.5, drift=drift), 0)


KINDS = st.sampled_from(("step", "both", "local", "link", "sender", "silence", "forged"))


@st.composite
def histories(draw: st.DrawFn) -> History:
    """Draw a history with two seconds between events: a freeze can't be told from a simultaneous step of its size."""
    at, events = 2.5, []
    rate = draw(st.sampled_from((1.0, 4.0, 5.0, 7.0, 10.0, 25.0, 50.0)))
    for kind in draw(st.lists(KINDS, max_size=8)):
        if kind in ("link", "sender", "silence"):
            size = draw(st.floats(0.3, 30.0 if kind == "silence" else 6.0))
        else:
            size = draw(st.sampled_from((-1.0, 1.0))) * draw(st.floats(0.001, 10.0) | st.floats(10.0, 1e8))
        events.append(Event(at, kind, size))
        at += 2.5 + 2 / rate + (size if kind in ("link", "sender", "silence") else 0.0)
    return History(
        at,
        rate,
        tuple(events),
        offset=draw(st.floats(-2 * HOUR, 2 * HOUR) | st.just(0.0)),
        drift=draw(st.floats(-1e-4, 1e-4)),
        latency=(0.001, draw(st.floats(0.002, 0.02))),
        chance=random.Random(draw(st.integers(0, 2**16))),
    )


@pytest.mark.slow
@seed(20240611)
@settings(max_examples=300, deadline=None, derandomize=False, database=None)
@given(histories())
def test_mixtures(history: History) -> None:
    judge(history)


def test_who_was_silent_for_longest_is_forgotten_first() -> None:
    now = 0
    ages = TransitDelayEstimator(lambda: now, lambda: now)

    def age(publisher: int) -> float:
        return ages.estimate(SampleInfo(1, 0, 16, publisher.to_bytes(16, "big")))

    for publisher in range(MAX_SENDERS + 1):
        age(publisher)
        age(0)
    assert len(ages._senders) == MAX_SENDERS
    assert (0).to_bytes(16, "big") in ages._senders
    assert (1).to_bytes(16, "big") not in ages._senders


def test_two_readers_of_one_sample_see_one_age() -> None:
    receiver = Receiver(History(1.0, offset=HOUR))
    verdicts = []
    for sent, arrived, stamp, _ in receiver.history.samples():
        first = receiver.age(arrived, stamp)
        receiver.number -= 1
        assert receiver.age(arrived, stamp) <= first, sent
        verdicts.append(first <= TIMEOUT)
    assert verdicts == sorted(verdicts)
    assert verdicts[-1]
