"""The supervisor's node: the last messages of nodes that have ended are waited for."""

from __future__ import annotations

import pytest

from deploy.supervisor.node import SupervisorNode
from messages.topics import CHECKS
from services.runtime.errors import TryAgain
from services.runtime.graph import token_pattern
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import memory_node


def test_the_end_waits_for_members_also_where_the_network_does_not_list_them_in_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bus, looks = MemoryBus(), 0
    transport = MemoryTransport(bus)
    with (
        memory_node(bus, "supervisor", transport=transport) as node,
        memory_node(bus, "stranger") as stranger,
        memory_node(bus, "judge") as member,
    ):
        stranger.advertise(CHECKS)
        member.advertise(CHECKS)

        def all_tokens(pattern: str, timeout: float = 1.0) -> list[str]:
            nonlocal looks
            looks += 1
            if looks == 1:
                raise TryAgain("the network did not list its nodes")
            if looks == 3:
                member.transport.close()
            return transport.tokens(pattern)

        monkeypatch.setattr(transport, "all_tokens", all_tokens)
        SupervisorNode(node, members=["/judge"]).drain()
        assert looks == 3
        assert transport.tokens(token_pattern("pub", "/stranger", CHECKS.name)), "who is no member is not waited for"
