"""Unreachable nodes: only one that misses most others is reported, at the second check."""

from __future__ import annotations

import io

import pytest

from services.runtime.discovery import NodeDirectory, ReachabilityCheck, unreached
from services.runtime.graph import Entity
from services.runtime.log import Log
from services.runtime.transport.memory import MemoryBus, MemoryTransport

NODES = {Entity(f"{number:x}", "node", f"/n{number}").key for number in range(1, 6)}


def test_only_who_misses_most_of_the_others_is_cut_off() -> None:
    one, *rest = sorted(NODES)
    assert unreached(NODES, set()) == [f"/n{number}" for number in range(1, 6)]
    assert unreached(NODES, {one}) == ["/n2", "/n3", "/n4", "/n5"]
    assert unreached(NODES, set(rest)) == []
    assert unreached(NODES, NODES | {"more"}) == []
    assert unreached({one}, set()) == ["/n1"]
    assert unreached(set(), set()) == []


def test_it_is_told_at_the_second_look_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now, out = 0.0, io.StringIO()
    monkeypatch.setattr("services.runtime.discovery.time.monotonic", lambda: now)
    near, far = MemoryBus(), MemoryBus()
    with MemoryTransport(near) as router, MemoryTransport(far) as outside, MemoryTransport(near) as member:
        # Two buses with the router's directory on both: the outsider doesn't see the nodes behind the router.
        register, relayed = NodeDirectory(router), outside.serve("@elea/register")
        mine = outside.declare_token(Entity(outside.session, "node", "/stray").key)
        token = member.declare_token(Entity(member.session, "node", "/sim", "sim").key)
        reach = ReachabilityCheck(outside, Log("/stray", out=out))

        def look() -> str:
            """Check once, with the router's answer."""
            reach.update()
            asked = member.query_async("@elea/register", b"", 0.5)
            register.answer()
            [answer] = asked.poll() or ()
            while (query := relayed.recv()) is not None:
                query.reply(answer.payload)
            reach.update()
            return out.getvalue()

        assert look() == "", "the links may still come up"
        now = 2.5
        assert look() == ""
        now = 4.0
        assert "ERROR /stray: this node is cut off from 1 of the 1 nodes that the router knows (/sim)" in look()
        said = look()
        now = 20.0
        assert look() == said, "once"
        token.close()
        now = 60.0
        assert "INFO /stray: this node now reaches the 0 nodes" in look()
        mine.close()
