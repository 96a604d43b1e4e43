"""The supervisor's node: how long its links last, and how it waits for the last messages of nodes that have ended."""

from __future__ import annotations

import time
from typing import Any

import pytest

from deploy.supervisor import node as node_module
from deploy.supervisor.node import SupervisorNode, supervisor_node
from messages.base import encode
from messages.elea import Health
from messages.topics import CHECKS, HEALTH
from services.runtime.errors import TryAgain
from services.runtime.graph import token_pattern
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.zenoh_config import RELIABLE_S
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


def test_in_lockstep_its_links_last_as_long_as_those_of_the_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    class Opened(Exception):
        pass

    def open_transport(tree: dict[str, Any], settle_s: float) -> None:
        raise Opened(tree["transport"]["link"]["tx"]["lease"])

    monkeypatch.setattr(node_module, "ZenohTransport", open_transport)
    for lockstep, lease_s in ((False, 2), (True, RELIABLE_S)):
        with pytest.raises(Opened, match=f"^{lease_s * 1000}$"), supervisor_node("127.0.0.1:7447", lockstep=lockstep):
            raise AssertionError("it opened without a transport")


def test_it_knows_how_long_heartbeats_of_the_fleet_were_on_their_way() -> None:
    bus = MemoryBus()
    with (
        memory_node(bus, "supervisor") as node,
        memory_node(bus, "stranger") as stranger,
        memory_node(bus, "driver") as member,
    ):
        supervisor = SupervisorNode(node, members=["/driver"])
        for sender, name, ago_s in ((stranger, "/stranger", 900.0), (member, "/driver", 0.0), (member, "/driver", 7.0)):
            beat = encode(Health(node=name, pid=1))
            sender.advertise(HEALTH).publish_encoded(beat, time.time_ns() - round(ago_s * 1e9))
        assert len(supervisor.heartbeats()) == 3
        assert 7.0 <= supervisor.delay_s < 900.0
        assert supervisor.heartbeats() == []
        assert supervisor.delay_s == 0.0
