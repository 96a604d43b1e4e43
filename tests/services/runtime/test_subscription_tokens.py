"""A publisher knows its subscribers by their tokens, whenever the network's own notification arrives."""

from __future__ import annotations

import io

from messages.names import Identity
from messages.topics import ODOM, SCAN
from services.runtime.graph import Entity
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.subscription_tokens import SubscriptionTokens
from services.runtime.transport.memory import MemoryBus, MemoryTransport


def test_publishers_know_the_readers_that_have_announced_themselves() -> None:
    with MemoryTransport(MemoryBus()) as transport:
        node = Node(transport, Identity.of("sim", "/"), "sim", Log("/sim", out=io.StringIO()))
        tokens, heard = SubscriptionTokens(transport), list[tuple[str, bool]]()
        tokens.listener = lambda entity, alive: heard.append((entity.node, alive))
        odometry = node.advertise(ODOM, "/a/odom")

        def follow() -> tuple[bool, ...]:
            tokens.update()
            tokens.mark(node.publishers)
            return tuple(each.has_subscribers for each in node.publishers if each.name.startswith("/a"))

        assert follow() == (False,)
        held = [
            transport.declare_token(Entity("5e", "sub", reader, "/a/odom", ODOM.record.ROS_TYPE, "SENSOR").key)
            for reader in ("/one", "/two")
        ]
        assert follow() == (True,)
        assert heard == [("/one", True), ("/two", True)]
        held[0].close()
        assert follow() == (True,)
        scans = transport.declare_token(Entity("5e", "sub", "/one", "/a/scan", SCAN.record.ROS_TYPE, "SENSOR").key)
        assert follow() == (True,)
        node.advertise(SCAN, "/a/scan")
        assert follow() == (True, True), "a publication that begins after its reader"
        held[1].close()
        scans.close()
        assert follow() == (False, False)
        reading = MemoryTransport(transport.bus).subscribe(odometry.key, 4)
        assert follow() == (True, False), "a reader without a token, by the network's own hint"
        reading.close()
        assert follow() == (False, False)
