"""A loop whose inputs never run dry, because more comes for as long as it takes, still comes to its tick."""

from __future__ import annotations

from itertools import count

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.topics import CMD_VEL
from services.runtime.pacing import ClockPacer
from services.runtime.subscriber import QUEUE_SIZE, Subscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import pack_attachment, publisher_id
from tests.harness.memory_node import memory_node


def test_an_input_gives_what_its_ring_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    source = Subscriber(CMD_VEL, "/cmd_vel", "cmd_vel", MemoryTransport(MemoryBus()))
    numbers, sender = count(1), publisher_id("/a", "1", "cmd_vel")
    payload = encode(Twist())
    monkeypatch.setattr(source.raw, "key", lambda _: "cmd_vel")
    monkeypatch.setattr(source.raw, "encoding", lambda _: "")
    monkeypatch.setattr(source.raw, "recv", lambda: (payload, pack_attachment(next(numbers), sender), None))
    source.update()
    assert len(source.messages) == source.received == QUEUE_SIZE
    source.update()
    assert (source.received, source.lost) == (2 * QUEUE_SIZE, 0)


def test_a_flood_of_clocks_gives_a_tick() -> None:
    with memory_node(MemoryBus(), "a") as made:
        pacer = ClockPacer(made, 20_000_000)
        payload = encode(Clock())
        pacer.raw.recv = lambda: (payload, b"", None)  # type: ignore[method-assign]
        pacer.raw.key = lambda _: "clock"  # type: ignore[method-assign]
        pacer.raw.encoding = lambda _: ""  # type: ignore[method-assign]
        instant = pacer.next()
    assert instant is not None
    assert instant.time == 0
