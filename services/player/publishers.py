"""What the player publishes: one publication for each channel, and one for each further node that was latched on it."""

from __future__ import annotations

from typing import Any

from messages.topics import TOPICS, Topic
from services.bag.channel import RAW, Channel
from services.bag.reader import record_type, unknown_record
from services.player.playback import TimedMessage
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.wire import publisher_id


class Publishers:
    """The publications for ``channels``. Who joins late gets the last message of every recorded node, as it was."""

    def __init__(self, node: Node, channels: list[Channel]) -> None:
        self._node = node
        self._topics = {channel: _topic(channel) for channel in channels}
        self._publishers = {(channel, b""): node.advertise(topic) for channel, topic in self._topics.items()}

    def __contains__(self, channel: Channel) -> bool:
        return channel in self._topics

    @property
    def publishers(self) -> list[Publisher[Any]]:
        """Those of all channels, one each."""
        return [self._publishers[channel, b""] for channel in self._topics]

    def publish(self, timed: TimedMessage) -> None:
        """Publish what a cue holds."""
        output = self._publishers.get((timed.channel, timed.sender)) or self._add(timed.channel, timed.sender)
        if isinstance(timed.message, bytes):
            output.publish_encoded(timed.message)
        else:
            output.publish(timed.message)

    def _add(self, channel: Channel, sender: bytes) -> Publisher[Any]:
        """Another publication of the same topic; its number series must not be mixed up with the first one's."""
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
