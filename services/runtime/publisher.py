"""Publishers: typed messages, numbered and attributed to their sender, sent at once or in bursts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from messages.base import Message, encode
from messages.elea import OutputHealth
from messages.topics import Quality, Topic
from services.runtime.transport.api import Transport
from services.runtime.transport.wire import encoding, pack_attachment, publisher_id

Put = Callable[..., Any]
"""``put(payload, attachment=…)`` of an outlet."""


class SendBuffer:
    """Collects samples between ``begin`` and ``flush``, and passes them on in order.

    ``held`` are the samples, None outside a burst; publishers read it directly, once for each message. A burst travels
    in few packets and wakes each reader once or twice, not once for each sample.
    """

    def __init__(self) -> None:
        self.held: list[tuple[Put, bytes, bytes]] | None = None

    def put(self, put: Put, payload: bytes, attachment: bytes) -> None:
        """Send a sample by the ``put`` of its outlet, or keep it for the burst."""
        if self.held is None:
            put(payload, attachment=attachment)
        else:
            self.held.append((put, payload, attachment))

    def begin(self) -> None:
        """Begin a burst; it ends by itself when the node's loop waits."""
        if self.held is None:
            self.held = []

    def flush(self) -> None:
        """Send the held samples, and further ones at once."""
        held, self.held = self.held, None
        for put, payload, attachment in held or ():
            put(payload, attachment=attachment)


M = TypeVar("M", bound=Message)


class Publisher(Generic[M]):
    """One publication; ``sent`` is the number of the last sample, ``reported`` the last one reported to lockstep.

    Samples wait in ``outbox`` while that holds a burst, commands in ``commands`` alone.
    """

    def __init__(
        self,
        topic: Topic[M],
        name: str,
        key: str,
        node: str,
        transport: Transport,
        outbox: SendBuffer | None = None,
        commands: SendBuffer | None = None,
    ) -> None:
        self.topic, self.name, self.key = topic, name, key
        self.publisher = publisher_id(node, transport.session, key)
        self.sent = self.reported = 0
        self.announced = False
        """Whether a node has announced that it reads this: ``SubscriptionTokens`` sets it, where they are followed."""
        self._record = topic.record
        quality = topic.quality
        if quality is Quality.COMMAND:
            # A command waits for no burst, or what holds it back would act later; but for those of its fellows, with
            # which it then shares packets.
            outbox, quality = commands, quality if commands is None else Quality.VITAL
        self._raw = transport.advertise(key, encoding(topic.record.ROS_TYPE), quality)
        self._put = self._raw.put
        self._outbox = SendBuffer() if outbox is None else outbox

    def publish(self, message: M) -> None:
        """Send ``message``; raises TypeError when it is not the topic's record."""
        if type(message) is not self._record:
            raise TypeError(f"{self.name} carries {self._record.__name__}, not {type(message).__name__}")
        self.publish_encoded(encode(message))

    def publish_encoded(self, payload: bytes, source_ns: int | None = None) -> None:
        """Publish an encoded record of the topic's type, at ``source_ns`` of the system clock: now by default."""
        self.sent = sent = self.sent + 1
        attachment = pack_attachment(sent, self.publisher, source_ns)
        if (held := self._outbox.held) is None:
            self._put(payload, attachment=attachment)
        else:
            held.append((self._put, payload, attachment))

    @property
    def has_subscribers(self) -> bool:
        """Whether the topic has subscribers; costly messages need not be made without."""
        return self.announced or self._raw.has_subscribers

    def close(self) -> None:
        """End the publication."""
        self._raw.close()

    def health(self) -> OutputHealth:
        """The count, as it is shown."""
        return OutputHealth(topic=self.name, sent=self.sent)
