"""Waiting for a roster: ready members, ended ones, and the end of the wait; waiting for all of its tokens."""

from __future__ import annotations

import pytest

from services.runtime.discovery import wait_for_nodes, wait_for_tokens
from services.runtime.node import Node
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import memory_node


def _ready(bus: MemoryBus, name: str, *, ticks: bool) -> Node:
    made = memory_node(bus, name).__enter__()
    if ticks:
        made.declare_stepping(20_000_000)
    else:
        made.declare_ready()
    return made


def test_those_that_tick_and_those_that_only_work_are_waited_for(bus: MemoryBus) -> None:
    looks: list[list[str]] = []
    coming = iter((("a", True), ("b", False)))

    def idle() -> None:
        name, ticks = next(coming)
        _ready(bus, name, ticks=ticks)

    assert (
        wait_for_nodes(MemoryTransport(bus), ["/a", "/b"], idle, on_wait=lambda absent, _: looks.append(absent)) == []
    )
    assert looks == [["/a", "/b"], ["/b"]]


def test_it_ends_without_those_that_have_ended_and_after_the_patience(bus: MemoryBus) -> None:
    _ready(bus, "a", ticks=True)
    ended: set[str] = set()

    def idle() -> None:
        ended.add("/b")

    assert wait_for_nodes(MemoryTransport(bus), ["/a", "/b"], idle, ended=lambda: ended) == ["/b"]
    assert wait_for_nodes(MemoryTransport(bus), ["/a", "/c"], lambda: None, patience_s=0.05) == ["/c"]


def test_the_patience_begins_anew_with_each_node_that_comes(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three nodes join, each after most of the time limit, on a fake clock."""
    now, coming = [0.0], iter("abc")

    class Clock:
        @staticmethod
        def monotonic() -> float:
            return now[0]

    def idle() -> None:
        now[0] += 0.9
        _ready(bus, next(coming), ticks=True)

    monkeypatch.setattr("services.runtime.discovery.time", Clock)
    assert wait_for_nodes(MemoryTransport(bus), ["/a", "/b", "/c"], idle, patience_s=1.0) == []


def test_tokens_are_complete_once_every_node_has_answered(bus: MemoryBus) -> None:
    nodes = [_ready(bus, name, ticks=True) for name in "abc"]
    answering, waits = [nodes[1], nodes[0]], [0]

    def idle() -> None:
        waits[0] += 1
        answering.pop(0).spin_once()

    wait_for_tokens(MemoryTransport(bus), ["/a", "/b", "/absent"], idle)
    assert waits == [2], "it asks /a and /b, and not /c, which does not answer"


def test_a_node_that_does_not_answer_is_waited_for_in_vain(bus: MemoryBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.runtime.discovery.TOKENS_TIMEOUT_S", 0.05)
    _ready(bus, "a", ticks=True)
    waits: list[None] = []
    wait_for_tokens(MemoryTransport(bus), ["/a"], lambda: waits.append(None))
    assert waits
