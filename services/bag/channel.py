"""One topic in a bag: its name, type, encoding and quality of service."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from messages.base import Message
from messages.cdr.definitions import definitions, long_type_name, text_of
from messages.topics import Quality

CDR, RAW = "cdr", "msgpack"
"""Message encodings: that of ROS 2, and that of the bus for types that Elea does not know."""


class Raw(Message, frozen=True, kw_only=True):
    """Wraps a payload of an unknown type, so that ROS 2's tools can read the rest of the bag."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Raw"
    type: str = ""
    data: bytes = b""


SIDECAR = "/_elea"
"""Suffix of the topic with the fields that a message's ROS 2 type lacks; ROS 2's tools hide such topics."""

SENDER_SIDECAR = "/_sender"
"""Suffix of the topic with the senders of a latched topic with several publishers; hidden as well."""


class Sender(Message, frozen=True, kw_only=True):
    """The sender of the message that follows; ``node`` is derived from its name.

    It is not recorded for messages of the first node on a topic.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/Sender"
    node: bytes = b""


_QOS = """\
- history: keep_last
  depth: {depth}
  reliability: {reliability}
  durability: {durability}
  deadline: {{sec: 9223372036, nsec: 854775807}}
  lifespan: {{sec: 9223372036, nsec: 854775807}}
  liveliness: automatic
  liveliness_lease_duration: {{sec: 9223372036, nsec: 854775807}}
  avoid_ros_namespace_conventions: false
"""


@dataclass(frozen=True)
class Channel:
    """A topic of a bag.

    ``type`` is written as ``nav_msgs/Odometry``; ``schema`` is its definition, if the bag has one, in the language
    ``schema_encoding``: ``ros2msg`` unless another program wrote the bag.
    """

    topic: str
    type: str
    encoding: str = CDR
    schema: str = ""
    schema_encoding: str = "ros2msg"
    quality: Quality = Quality.SENSOR

    @property
    def name(self) -> str:
        """The topic's absolute name: bags of other programs may have ``cmd_vel`` for ``/cmd_vel``."""
        return self.topic if self.topic.startswith("/") else f"/{self.topic}"

    @property
    def ros_type(self) -> str:
        """The type as ROS 2 writes it: ``nav_msgs/msg/Odometry``."""
        return long_type_name(self.type)

    @property
    def stored(self) -> Channel:
        """The channel as declared in the file: MessagePack payloads are wrapped in a ``Raw``."""
        return channel_of(self.topic, Raw, self.quality) if self.encoding == RAW else self

    @property
    def metadata(self) -> dict[str, str]:
        """The channel's metadata in the file."""
        own = {"offered_qos_profiles": qos_text(self.quality), "elea_quality": self.quality.name}
        return own | {"elea_type": self.type} if self.encoding == RAW else own


def channel_of(topic: str, record: type[Message], quality: Quality) -> Channel:
    """Return the channel for a record."""
    return Channel(topic, record.ROS_TYPE, CDR, text_of(record.ROS_TYPE, definitions(record)), "ros2msg", quality)


def raw_channel(topic: str, type_name: str, quality: Quality) -> Channel:
    """Return the channel for messages of a type that Elea does not know; their payloads are stored unchanged."""
    return Channel(topic, type_name, RAW, "", "", quality)


def qos_text(quality: Quality) -> str:
    """Return the ROS 2 quality of service as written by rosbag2: ``transient_local`` for latched topics.

    All topics are ``reliable``, so that every subscriber matches on playback.
    """
    latched = quality is Quality.LATCHED
    return _QOS.format(
        depth=1 if latched else 10,
        reliability="reliable",
        durability="transient_local" if latched else "volatile",
    )


def quality_of(metadata: dict[str, str]) -> Quality:
    """Return the quality of a channel's topic; in bags of other programs, derived from its ROS 2 quality of service."""
    name = metadata.get("elea_quality", "")
    if name in Quality.__members__:
        return Quality[name]
    offered = metadata.get("offered_qos_profiles", "")
    if _has_policy(offered, "durability", "transient_local", "1"):
        return Quality.LATCHED
    return Quality.SENSOR if _has_policy(offered, "reliability", "best_effort", "2") else Quality.EVENT


def _has_policy(offered: str, key: str, name: str, number: str) -> bool:
    """Return whether a profile has a policy; rosbag2 writes names since version 9, and numbers before."""
    lines = [line.strip(" -") for line in offered.splitlines()]
    return f"{key}: {name}" in lines or f"{key}: {number}" in lines
