"""tf2_msgs: transforms between frames."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar, TypeVar

from messages.base import Message, encode
from messages.geometry import TransformStamped


class TFMessage(Message, frozen=True, kw_only=True):
    """Several transforms with the same stamp."""

    ROS_TYPE: ClassVar[str] = "tf2_msgs/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


SPLIT_BYTES = 48_000
"""Maximum size [bytes] of a message of ``split``: about 200 transforms, well below the limit of /tf."""
_BYTES = 192
"""Size [bytes] of a transform without its two frame names: field names and nine numbers."""


T = TypeVar("T")


def transform_size(frame: str, child: str) -> int:
    """Return the size [bytes] that is assumed for a transform between two frames."""
    return _BYTES + len(frame.encode()) + len(child.encode())


def split(transforms: Iterable[TransformStamped]) -> Iterator[TFMessage]:
    """Split transforms into messages of at most SPLIT_BYTES each; none for no transforms."""
    sized = ((each, transform_size(each.header.frame_id, each.child_frame_id)) for each in transforms)
    return (TFMessage(transforms=tuple(part)) for part in _parts(sized))


class EncodedSplit:
    """The same for encoded transforms, with their ``sizes`` by ``transform_size``."""

    def __init__(self, sizes: Iterable[int]) -> None:
        parts = list(_parts(enumerate(sizes)))
        self._parts = [(_head(len(part)), slice(part[0], part[-1] + 1)) for part in parts]

    def join(self, transforms: Sequence[bytes]) -> list[bytes]:
        """Return the payloads of the messages of ``split``."""
        return [b"".join((head, *transforms[part])) for head, part in self._parts]


def _head(count: int) -> bytes:
    """Return the leading bytes of a message of ``count`` transforms."""
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
