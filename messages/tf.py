"""tf2_msgs: transforms between frames."""

from collections.abc import Iterable, Iterator
from typing import ClassVar

from messages.base import Message
from messages.geometry import TransformStamped


class TFMessage(Message, frozen=True, kw_only=True):
    """Several transforms of one instant."""

    ROS_TYPE: ClassVar[str] = "tf2_msgs/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


SPLIT_BYTES = 48_000
"""Maximum bytes of the messages of ``split``, about 200 transforms, well below the limit of /tf."""
_BYTES = 192
"""A transform without its two names: field names, and nine numbers."""


def split(transforms: Iterable[TransformStamped]) -> Iterator[TFMessage]:
    """Any number of transforms in as many messages as it takes; none for none."""
    part, size = list[TransformStamped](), 0
    for each in transforms:
        bytes_ = _BYTES + len(each.header.frame_id.encode()) + len(each.child_frame_id.encode())
        if part and size + bytes_ > SPLIT_BYTES:
            yield TFMessage(transforms=tuple(part))
            part, size = [], 0
        part.append(each)
        size += bytes_
    if part:
        yield TFMessage(transforms=tuple(part))
