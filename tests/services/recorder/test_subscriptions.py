"""The recorder's subscriptions keep what arrives while the recorder gets no processor."""

from __future__ import annotations

from typing import Any

from messages.geometry import Twist
from messages.interfaces.records import find_record
from messages.sensor import Image, Range
from messages.topics import ODOM, TF, TF_STATIC, Quality, Topic
from services.recorder import RecorderParameters
from services.recorder.subscriptions import Subscriptions, TopicFilter
from services.runtime.transport.memory import MemoryBus
from tests.harness.cases import case
from tests.harness.memory_node import memory_node

BURST = 500
"""Messages, as a script sends in one callback or a robot in 20 s."""
LARGE_BURST = 40


def foreign(name: str, record: Any, quality: Quality = Quality.EVENT) -> Topic[Any]:
    return Topic(name, record, 0, quality, "")


def test_a_burst_is_kept_whatever_else_its_type_is_used_for() -> None:
    bus = MemoryBus()
    topics = {
        "/tf, though /tf_static has the same type and large messages": (TF, BURST),
        "a robot's odometry": (ODOM.of("r"), BURST),
        "numbers of a script": (foreign("/count", find_record("std_msgs/Int32")), BURST),
        "commands of a script under another name": (foreign("/drive", Twist), BURST),
        "a sonar of a script": (foreign("/range", Range, Quality.SENSOR), BURST),
        "images of a script, which may take 8 MB each": (foreign("/picture", Image), LARGE_BURST),
    }
    with memory_node(bus, "robot") as robot, memory_node(bus, "recorder") as node:
        publishers = {what: robot.advertise(topic) for what, (topic, _) in topics.items()}
        subscriptions = Subscriptions(node, TopicFilter(RecorderParameters(), node.identity.resolve))
        subscriptions.subscribe_existing()
        for what, (topic, count) in topics.items():
            for _ in range(count):
                publishers[what].publish(topic.record())
        node.update_subscribers()
        for what, (_, count) in topics.items():
            with case(what):
                source = subscriptions.by_topic[publishers[what].name]
                assert (len(source.messages), source.lost) == (count, 0)


def test_its_limits_on_size_are_those_of_the_type() -> None:
    bus = MemoryBus()
    with memory_node(bus, "robot") as robot, memory_node(bus, "recorder") as node:
        robot.advertise(TF)
        robot.advertise(foreign("/picture", Image))
        subscriptions = Subscriptions(node, TopicFilter(RecorderParameters(), node.identity.resolve))
        subscriptions.subscribe_existing()
        assert subscriptions.by_topic["/tf"].topic.largest == TF_STATIC.largest
        assert subscriptions.by_topic["/picture"].topic.largest == 1 << 23
