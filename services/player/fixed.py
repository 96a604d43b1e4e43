"""Fixed frames of a bag that does not tell its senders apart: who joins late needs those of all, not the last one's."""

from __future__ import annotations

from messages.geometry import TransformStamped
from messages.tf import TFMessage


class FixedFrames:
    """Joins ``/tf_static`` by the frames that it places, as everybody knows them who has heard it from the start."""

    def __init__(self) -> None:
        self._placed: dict[str, TransformStamped] = {}

    def joined(self, message: TFMessage) -> TFMessage:
        """The message with all frames of those before it; what it says of a frame itself counts."""
        self._placed |= {each.child_frame_id.removeprefix("/"): each for each in message.transforms}
        return TFMessage(transforms=tuple(self._placed.values()))
