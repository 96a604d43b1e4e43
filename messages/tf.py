"""tf2_msgs: transforms between frames."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar, TypeVar

from messages.base import Message, encode
from messages.geometry import TransformStamped


class TFMessage(Message, frozen=True, kw_only=True):
    """Several transforms of one instant."""

    ROS_TYPE: ClassVar[str] = "tf2_msgs/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


SPLIT_BYTES = 48_000
"""Maximum bytes of the messages of ``split``, about 200 transforms, well below the limit of /tf."""
_BYTES = 192
"""A transform without its two names: field names, and nine numbers."""


T = TypeVar("T")


def transform_size(frame: str, child: str) -> int:
    """Bytes that are counted for a transform between two frames."""
    return _BYTES + len(frame.encode()) + len(child.encode())


def split(transforms: Iterable[TransformStamped]) -> Iterator[TFMessage]:
    """Any number of transforms in as many messages as it takes; none for none."""
    sized = ((each, transform_size(each.header.frame_id, each.child_frame_id)) for each in transforms)
    return (TFMessage(transforms=tuple(part)) for part in _parts(sized))


class EncodedSplit:
    """The same for transforms that are encoded, of the ``sizes`` that ``transform_size`` counts for them."""

    def __init__(self, sizes: Iterable[int]) -> None:
        parts = list(_parts(enumerate(sizes)))
        self._parts = [(_head(len(part)), slice(part[0], part[-1] + 1)) for part in parts]

    def join(self, transforms: Sequence[bytes]) -> list[bytes]:
        """The payloads of the messages of ``split``."""
        return [b"".join((head, *transforms[part])) for head, part in self._parts]


def _head(count: int) -> bytes:
    """What a message of ``count`` transforms begins with."""
    return encode({"transforms": (None,) * count})[:-count]  # None is one byte


def _parts(sized: Iterable[tuple[T, int]]) -> Iterator[list[T]]:
    part, total = list[T](), 0
    for each, size in sized:
        if part and total + size > SPLIT_BYTES:
            yield part
            part, total = [], 0
        part.append(each)
        total += size
    if part:
        yield part
