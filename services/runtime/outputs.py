"""What a node writes: typed messages, numbered and attributed to their publisher."""

from __future__ import annotations

from typing import Generic, TypeVar

from messages.base import Message, encode
from messages.elea import OutputHealth
from messages.topics import Quality, Topic
from services.runtime.network.transport import Transport
from services.runtime.network.wire import attach, encoding, publisher_id
from services.runtime.outbox import Outbox

M = TypeVar("M", bound=Message)


class Output(Generic[M]):
    """One publication; ``sent`` is the number of the last sample, ``marked`` the last one told to the lockstep."""

    def __init__(
        self,
        topic: Topic[M],
        name: str,
        key: str,
        node: str,
        transport: Transport,
        outbox: Outbox | None = None,
    ) -> None:
        self.topic, self.name, self.key = topic, name, key
        self.publisher = publisher_id(node, transport.session, key)
        self.sent = self.marked = 0
        self._record = topic.record
        self._outlet = transport.publish(key, encoding(topic.record.ROS_TYPE), topic.quality)
        # A command waits for no burst, or what holds it back would act later.
        self._put = self._outlet.put
        self._outbox = Outbox() if outbox is None or topic.quality is Quality.COMMAND else outbox

    def publish(self, message: M) -> None:
        """Send ``message``; raises TypeError when it is not the topic's record."""
        if type(message) is not self._record:
            raise TypeError(f"{self.name} carries {self._record.__name__}, not {type(message).__name__}")
        self.publish_encoded(encode(message))

    def publish_encoded(self, payload: bytes) -> None:
        """Send what is encoded already, as the topic's record or another one of its type."""
        self.sent = sent = self.sent + 1
        attachment = attach(sent, self.publisher)
        if (held := self._outbox.held) is None:
            self._put(payload, attachment=attachment)
        else:
            held.append((self._put, payload, attachment))

    @property
    def wanted(self) -> bool:
        """Whether anybody subscribes at present; what costs time to make may be left out when nobody does."""
        return self._outlet.wanted

    def close(self) -> None:
        """End the publication."""
        self._outlet.close()

    def health(self) -> OutputHealth:
        """The count, as it is shown."""
        return OutputHealth(topic=self.name, sent=self.sent)
