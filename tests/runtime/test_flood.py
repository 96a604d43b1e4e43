"""A loop whose inputs never run dry, because more comes for as long as it takes, still comes to its tick."""

from __future__ import annotations

from itertools import count

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.topics import CMD_VEL
from services.runtime.inputs import CAPACITY, Input
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.wire import attach, publisher_id
from services.runtime.pacing import ClockPacer
from tests.runtime.bench import node


def test_an_input_gives_what_its_ring_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    source = Input(CMD_VEL, "/cmd_vel", "cmd_vel", MemoryTransport(MemoryBus()))
    numbers, sender = count(1), publisher_id("/a", "1", "cmd_vel")
    payload = encode(Twist())
    monkeypatch.setattr(source.inlet, "key", lambda _: "cmd_vel")
    monkeypatch.setattr(source.inlet, "encoding", lambda _: "")
    monkeypatch.setattr(source.inlet, "take", lambda: (payload, attach(next(numbers), sender), None))
    source.admit()
    assert len(source.batch) == source.received == CAPACITY
    source.admit()
    assert (source.received, source.lost) == (2 * CAPACITY, 0)


def test_a_flood_of_clocks_gives_a_tick() -> None:
    with node(MemoryBus(), "a") as made:
        pacer = ClockPacer(made, 20_000_000)
        payload = encode(Clock())
        pacer.inlet.take = lambda: (payload, b"", None)  # type: ignore[method-assign]
        pacer.inlet.key = lambda _: "clock"  # type: ignore[method-assign]
        pacer.inlet.encoding = lambda _: ""  # type: ignore[method-assign]
        instant = pacer.next()
    assert instant is not None
    assert instant.time == 0
