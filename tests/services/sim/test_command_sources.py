"""Priorities of command sources: a node's kind is that in the token of its current session, while it exists."""

from __future__ import annotations

from messages.geometry import Twist
from messages.names import key
from services.runtime.graph import Entity
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import publisher_id
from services.sim.command_sources import PRIORITIES, UNKNOWN_SOURCE, CommandSources

TOPIC = "/tb3_0/cmd_vel"


def test_priority_is_that_of_the_tokens_in_sight_in_whatever_order_they_come() -> None:
    bus = MemoryBus()
    commanders, keys, stranger = CommandSources(MemoryTransport(bus)), MemoryTransport(bus), MemoryTransport(bus)
    source = publisher_id("/keys", keys.session, key(TOPIC))

    def priority() -> int:
        list(commanders.lost_publishers())
        return commanders.find(source).priority

    publication = keys.declare_token(Entity(keys.session, "pub", "/keys", TOPIC, Twist.ROS_TYPE).key)
    assert priority() == 1
    node = keys.declare_token(Entity(keys.session, "node", "/keys", "teleop").key)
    assert priority() == PRIORITIES["teleop"], "it came after its publication"
    stranger.declare_token(Entity(stranger.session, "node", "/keys", "waypoint").key)
    assert priority() == PRIORITIES["teleop"], "another session says nothing of this one"
    node.close()
    assert priority() == 1, "the kind goes with its token"
    publication.close()
    assert list(commanders.lost_publishers()) == [source]
    assert commanders.find(source) == UNKNOWN_SOURCE
    assert len(commanders._kinds) == 1
