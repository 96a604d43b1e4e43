"""What the player publishes: one publication for each channel, and one for each further node that was latched on it."""

from __future__ import annotations

from typing import Any

from messages.topics import TOPICS, Topic
from services.bag.channel import RAW, Channel
from services.bag.typed import record_of, unknown_record
from services.player.playback import Cue
from services.runtime.network.wire import publisher_id
from services.runtime.node import Node
from services.runtime.outputs import Output


class Stage:
    """The publications for ``channels``. Who joins late gets the last message of every recorded node, as it was."""

    def __init__(self, node: Node, channels: list[Channel]) -> None:
        self._node = node
        self._topics = {channel: _topic(channel) for channel in channels}
        self._outputs = {(channel, b""): node.write(topic) for channel, topic in self._topics.items()}

    def __contains__(self, channel: Channel) -> bool:
        return channel in self._topics

    @property
    def outputs(self) -> list[Output[Any]]:
        """Those of all channels, one each."""
        return [self._outputs[channel, b""] for channel in self._topics]

    def play(self, cue: Cue) -> None:
        """Publish what a cue holds."""
        output = self._outputs.get((cue.channel, cue.sender)) or self._add(cue.channel, cue.sender)
        if isinstance(cue.message, bytes):
            output.publish_encoded(cue.message)
        else:
            output.publish(cue.message)

    def _add(self, channel: Channel, sender: bytes) -> Output[Any]:
        """Another publication of the same topic; its number series must not be mixed up with the first one's."""
        node, topic = self._node, self._topics[channel]
        name, key, own = node.identity.resolve(topic.name), node.identity.key(topic.name), node.identity.node
        made = Output(topic, name, key, own, node.transport, node.outbox)
        made.publisher = publisher_id(own, node.transport.session, f"{key} {sender.hex()}")
        node.outputs.append(made)
        self._outputs[channel, sender] = made
        return made


def _topic(channel: Channel) -> Topic[Any]:
    known = record_of(channel) if channel.encoding != RAW else None
    record = known if known is not None else unknown_record(channel.type)
    largest = max((each.largest for each in TOPICS if each.record is record), default=1 << 16)
    return Topic(channel.name, record, 0, channel.quality, "", largest)
