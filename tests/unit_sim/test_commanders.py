"""Who commands with which priority: the kind of a node is what the token of this life of it says, while it is there."""

from __future__ import annotations

from messages.geometry import Twist
from messages.names import key
from services.runtime.graph import Entity
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.wire import publisher_id
from services.sim.commanders import PRIORITIES, UNKNOWN, Commanders

TOPIC = "/tb3_0/cmd_vel"


def test_priority_is_that_of_the_tokens_in_sight_in_whatever_order_they_come() -> None:
    bus = MemoryBus()
    commanders, keys, stranger = Commanders(MemoryTransport(bus)), MemoryTransport(bus), MemoryTransport(bus)
    source = publisher_id("/keys", keys.session, key(TOPIC))

    def priority() -> int:
        list(commanders.gone())
        return commanders.find(source).priority

    publication = keys.token(Entity(keys.session, "pub", "/keys", TOPIC, Twist.ROS_TYPE).key)
    assert priority() == 1
    node = keys.token(Entity(keys.session, "node", "/keys", "teleop").key)
    assert priority() == PRIORITIES["teleop"], "it came after its publication"
    stranger.token(Entity(stranger.session, "node", "/keys", "waypoint").key)
    assert priority() == PRIORITIES["teleop"], "another session says nothing of this one"
    node.close()
    assert priority() == 1, "the kind goes with its token"
    publication.close()
    assert list(commanders.gone()) == [source]
    assert commanders.find(source) == UNKNOWN
    assert len(commanders._kinds) == 1
