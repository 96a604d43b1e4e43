"""Waiting for a roster: ready members, ended ones, and the end of the wait."""

from __future__ import annotations

import pytest

from services.runtime.discovery import wait_for_nodes
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
