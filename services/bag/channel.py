"""One topic in a bag: its name, its type, how its messages are encoded, and how they travelled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from messages.base import Message
from messages.cdr.definitions import definitions, long_type_name, text_of
from messages.topics import Quality

CDR, RAW = "cdr", "msgpack"
"""Encodings of messages: as ROS 2 has it; as they travelled, for types that are unknown here."""


class Raw(Message, frozen=True, kw_only=True):
    """How a payload of an unknown type is kept, so that ROS 2's tools read the rest of the bag."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Raw"
    type: str = ""
    data: bytes = b""


SIDECAR = "/_elea"
"""Ends the topic on which is recorded what ROS 2's type of another one lacks; hidden from ROS's own tools."""

SENDER_SIDECAR = "/_sender"
"""Ends the topic on which is recorded who sent what is latched, where several nodes do; hidden like the other one."""


class Sender(Message, frozen=True, kw_only=True):
    """The node that sent the message which follows, as bytes that stand for its name.

    The node that was the first on its topic is not noted.
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
    """A topic of a bag. ``type`` is written as ``nav_msgs/Odometry``; ``schema`` is its definition, if there is one.

    ``schema_encoding`` names the language of the schema: ``ros2msg``, or another one in bags of others.
    """

    topic: str
    type: str
    encoding: str = CDR
    schema: str = ""
    schema_encoding: str = "ros2msg"
    quality: Quality = Quality.SENSOR

    @property
    def name(self) -> str:
        """The topic's absolute name: in bags of others, ``cmd_vel`` stands for ``/cmd_vel``."""
        return self.topic if self.topic.startswith("/") else f"/{self.topic}"

    @property
    def ros_type(self) -> str:
        """The type as ROS 2 writes it: ``nav_msgs/msg/Odometry``."""
        return long_type_name(self.type)

    @property
    def stored(self) -> Channel:
        """The channel as it stands in the file: what travelled as MessagePack is wrapped in a ``Raw``."""
        return channel_of(self.topic, Raw, self.quality) if self.encoding == RAW else self

    @property
    def metadata(self) -> dict[str, str]:
        """What stands beside the channel in the file."""
        own = {"offered_qos_profiles": qos_text(self.quality), "elea_quality": self.quality.name}
        return own | {"elea_type": self.type} if self.encoding == RAW else own


def channel_of(topic: str, record: type[Message], quality: Quality) -> Channel:
    """The channel for a record."""
    return Channel(topic, record.ROS_TYPE, CDR, text_of(record.ROS_TYPE, definitions(record)), "ros2msg", quality)


def raw_channel(topic: str, type_name: str, quality: Quality) -> Channel:
    """The channel for messages of a type that is unknown here; they are kept as they travelled."""
    return Channel(topic, type_name, RAW, "", "", quality)


def qos_text(quality: Quality) -> str:
    """ROS 2's quality of service, as rosbag2 writes it: all is offered reliably, so that any subscriber may have it.

    What is latched is ``transient_local``.
    """
    latched = quality is Quality.LATCHED
    return _QOS.format(
        depth=1 if latched else 10,
        reliability="reliable",
        durability="transient_local" if latched else "volatile",
    )


def quality_of(metadata: dict[str, str]) -> Quality:
    """How the messages of a channel travelled; in bags of others, as far as their quality of service tells it."""
    name = metadata.get("elea_quality", "")
    if name in Quality.__members__:
        return Quality[name]
    offered = metadata.get("offered_qos_profiles", "")
    if _has_policy(offered, "durability", "transient_local", "1"):
        return Quality.LATCHED
    return Quality.SENSOR if _has_policy(offered, "reliability", "best_effort", "2") else Quality.EVENT


def _has_policy(offered: str, key: str, name: str, number: str) -> bool:
    """rosbag2 writes the names since version 9, and the numbers before it."""
    lines = [line.strip(" -") for line in offered.splitlines()]
    return f"{key}: {name}" in lines or f"{key}: {number}" in lines
