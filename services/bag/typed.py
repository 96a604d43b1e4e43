"""Recorded messages as the records that they were, and the reasons why some cannot be had."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import msgspec

from messages.base import Message, WrongPayload
from messages.cdr.definition import BadDefinition, Definitions, parse
from messages.cdr.extras import EXTRAS, ROS_RECORDS, join
from messages.cdr.read import plain_reader, record_reader
from messages.names import BadName, validate
from messages.records import RECORDS
from services.bag.channel import BESIDE, CDR, RAW, SENDER, Channel, Sender
from services.bag.reading import Entry

_BESIDE = {each.ROS_TYPE: each for each in EXTRAS.values()} | {Sender.ROS_TYPE: Sender}
_OURS = {ros.ROS_TYPE: ours for ours, ros in ROS_RECORDS.items()}

Reader = Callable[[bytes], Any]


def record_of(channel: Channel) -> type[Message] | None:
    """The record that the messages of a channel become; None for types that are unknown here."""
    return _OURS.get(channel.type) or RECORDS.get(channel.type)


def unknown_record(ros_type: str) -> type[Message]:
    """A record without fields that stands for a type which is unknown here."""
    made = msgspec.defstruct("Unknown", [], bases=(Message,), namespace={"ROS_TYPE": ros_type}, frozen=True)
    assert issubclass(made, Message)
    return made


def beside(channel: Channel) -> bool:
    """Whether a channel holds what another one lacks."""
    ending = SENDER if channel.type == Sender.ROS_TYPE else BESIDE
    return channel.topic.endswith(ending) and channel.type in _BESIDE


def why_not_played(channel: Channel) -> str:
    """Why a channel cannot be put on the bus; empty when it can."""
    try:
        validate(channel.name)
    except BadName as error:
        return str(error)
    return why_not(channel)


def why_not(channel: Channel) -> str:
    """Why the messages of a channel cannot be read; empty when they can, or belong to another channel."""
    if channel.encoding == RAW and channel.type:
        return ""
    if channel.encoding != CDR:
        return f"its messages are encoded as {channel.encoding or 'nothing that is named'}, not as cdr"
    if not beside(channel) and record_of(channel) is None:
        return f"its type {channel.type or 'without a name'} is not one of this project"
    try:
        _types(channel)
    except BadDefinition as error:
        return f"its schema cannot be read: {error}"
    return ""


class Typed:
    """Gives the record of one entry after the other; what was recorded beside a message is put back into it."""

    def __init__(self) -> None:
        self._readers: dict[Channel, Reader] = {}
        self._beside: dict[str, tuple[int, int, Message]] = {}
        self._senders: dict[str, tuple[int, int, bytes]] = {}

    def message(self, entry: Entry) -> Message | None:
        """The record; None for what belongs to the message that follows. Raises WrongPayload.

        The channel must be one that ``why_not`` has nothing against.
        """
        channel = entry.channel
        read = self._readers.get(channel)
        if read is None:
            read = self._readers[channel] = _reader(channel)
        found: Message = read(entry.data)
        if isinstance(found, Sender):
            self._senders[channel.topic.removesuffix(SENDER)] = (entry.sequence, entry.log_time, found.node)
            return None
        if beside(channel):
            self._beside[channel.topic.removesuffix(BESIDE)] = (entry.sequence, entry.log_time, found)
            return None
        extra = self._beside.pop(channel.topic, None)
        belongs = extra is not None and extra[:2] == (entry.sequence, entry.log_time)
        return join(found, extra[2] if extra is not None and belongs else None)

    def sender(self, entry: Entry) -> bytes:
        """Which of several nodes on a latched topic has sent this message; empty for the first of them."""
        noted = self._senders.pop(entry.channel.topic, None)
        return noted[2] if noted is not None and noted[:2] == (entry.sequence, entry.log_time) else b""


def plain_of(channel: Channel) -> Reader:
    """A function from the data of a channel to plain values, whatever its type; raises WrongPayload."""
    if channel.encoding != CDR or channel.form != "ros2msg":
        raise WrongPayload(f"{channel.topic}: only CDR with a ros2msg schema can be read, not {channel.encoding}")
    try:
        return plain_reader(channel.type, _types(channel))
    except BadDefinition as error:
        raise WrongPayload(f"{channel.topic}: its schema cannot be read: {error}") from None


def _reader(channel: Channel) -> Reader:
    target = _BESIDE[channel.type] if beside(channel) else record_of(channel)
    assert target is not None
    return record_reader(ROS_RECORDS.get(target, target), _types(channel))


def _types(channel: Channel) -> Definitions:
    """The definition that the file itself holds: of another version of ROS, or of this project, perhaps."""
    if channel.form != "ros2msg":
        raise BadDefinition(f"it is written as {channel.form or 'nothing'}, not as ros2msg")
    return _parsed(channel.type, channel.schema)


_parsed = lru_cache(maxsize=256)(parse)
