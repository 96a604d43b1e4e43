"""The player's publishers: one for each channel, and one for each further node on a latched channel."""

from __future__ import annotations

from typing import Any

from messages.records import unknown_record
from messages.topics import TOPICS, Topic
from services.bag.channel import RAW, Channel
from services.bag.reader import record_type
from services.player.playback import TimedMessage
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.wire import publisher_id


class Publishers:
    """The publishers of ``channels``; a late subscriber gets the last message of every recorded node, as in the run."""

    def __init__(self, node: Node, channels: list[Channel]) -> None:
        self._node = node
        self._topics = {channel: _topic(channel) for channel in channels}
        self._publishers = {(channel, b""): node.advertise(topic) for channel, topic in self._topics.items()}

    def __contains__(self, channel: Channel) -> bool:
        return channel in self._topics

    @property
    def publishers(self) -> list[Publisher[Any]]:
        """The first publisher of each channel."""
        return [self._publishers[channel, b""] for channel in self._topics]

    def publish(self, timed: TimedMessage) -> None:
        """Publish a message on its channel, by its sender's publisher."""
        output = self._publishers.get((timed.channel, timed.sender)) or self._add(timed.channel, timed.sender)
        if isinstance(timed.message, bytes):
            output.publish_encoded(timed.message)
        else:
            output.publish(timed.message)

    def _add(self, channel: Channel, sender: bytes) -> Publisher[Any]:
        """Add a publisher for another sender, with an id and sequence numbers of its own."""
        node, topic = self._node, self._topics[channel]
        name, key, own = node.identity.resolve(topic.name), node.identity.key(topic.name), node.identity.node
        made = Publisher(topic, name, key, own, node.transport, node.send_buffer)
        made.publisher = publisher_id(own, node.transport.session, f"{key} {sender.hex()}")
        node.publishers.append(made)
        self._publishers[channel, sender] = made
        return made


def _topic(channel: Channel) -> Topic[Any]:
    known = record_type(channel) if channel.encoding != RAW else None
    record = known if known is not None else unknown_record(channel.type)
    largest = max((each.largest for each in TOPICS if each.record is record), default=1 << 16)
    return Topic(channel.name, record, 0, channel.quality, "", largest)
