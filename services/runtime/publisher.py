"""Publishers: send typed messages with a sequence number and their sender's id, at once or in bursts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from messages.base import Message, encode
from messages.elea import OutputHealth
from messages.topics import Quality, Topic
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import encoding, pack_attachment, publisher_id

Put = Callable[..., Any]
"""``put(payload, attachment=…)`` of a raw publisher."""


class SendBuffer:
    """Collects samples between ``begin`` and ``flush``, and sends them in order.

    ``held`` are the samples, None outside a burst; publishers read it directly, once per message. A burst needs few
    packets and wakes each subscriber once or twice instead of once per sample.
    """

    def __init__(self) -> None:
        self.held: list[tuple[Put, bytes, bytes]] | None = None

    def put(self, put: Put, payload: bytes, attachment: bytes) -> None:
        """Send a sample with the ``put`` of its raw publisher, or hold it during a burst."""
        if self.held is None:
            put(payload, attachment=attachment)
        else:
            self.held.append((put, payload, attachment))

    def begin(self) -> None:
        """Begin a burst; it ends at ``flush``, at the latest when the node waits."""
        if self.held is None:
            self.held = []

    def flush(self) -> None:
        """Send the held samples and end the burst: further ones are sent at once."""
        held, self.held = self.held, None
        for put, payload, attachment in held or ():
            put(payload, attachment=attachment)


M = TypeVar("M", bound=Message)


class Publisher(Generic[M]):
    """One publication; ``sent`` is the number of the last sample, ``reported`` the last one reported to lockstep.

    During a burst, samples are held in ``send_buffer``; commands are held in ``command_buffer`` only.
    """

    def __init__(
        self,
        topic: Topic[M],
        name: str,
        key: str,
        node: str,
        transport: Transport,
        send_buffer: SendBuffer | None = None,
        command_buffer: SendBuffer | None = None,
    ) -> None:
        self.topic, self.name, self.key = topic, name, key
        self.publisher = publisher_id(node, transport.session, key)
        self.sent = self.reported = 0
        self.announced = False
        """Whether a node has declared a subscription; set by ``SubscriptionTokens.mark`` where tokens are followed."""
        self._record = topic.record
        quality = topic.quality
        if quality is Quality.COMMAND:
            # A burst would delay a command's effect, so it is held only for the commands of nodes in the same
            # process, with which it then shares packets.
            send_buffer, quality = command_buffer, quality if command_buffer is None else Quality.VITAL
        self._raw = transport.advertise(key, encoding(topic.record.ROS_TYPE), quality)
        self._put = self._raw.put
        self._send_buffer = SendBuffer() if send_buffer is None else send_buffer

    def publish(self, message: M) -> None:
        """Publish ``message``; raises TypeError if it is not of the topic's type."""
        if type(message) is not self._record:
            raise TypeError(f"{self.name} carries {self._record.__name__}, not {type(message).__name__}")
        self.publish_encoded(encode(message))

    def publish_encoded(self, payload: bytes, source_ns: int | None = None) -> None:
        """Publish an encoded record of the topic's type, sent at ``source_ns`` of the system clock (default: now)."""
        self.sent = sent = self.sent + 1
        attachment = pack_attachment(sent, self.publisher, source_ns)
        if (held := self._send_buffer.held) is None:
            self._put(payload, attachment=attachment)
        else:
            held.append((self._put, payload, attachment))

    @property
    def has_subscribers(self) -> bool:
        """Whether the topic has subscribers; without any, costly messages need not be created."""
        return self.announced or self._raw.has_subscribers

    def close(self) -> None:
        """End the publication."""
        self._raw.close()

    def health(self) -> OutputHealth:
        """Return the count of sent samples for the node's health."""
        return OutputHealth(topic=self.name, sent=self.sent)
