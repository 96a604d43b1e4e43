"""tf2_msgs: transforms between frames."""

from typing import ClassVar

from messages.base import Message
from messages.geometry import TransformStamped


class TFMessage(Message, frozen=True, kw_only=True):
    """Several transforms of one instant."""

    ROS_TYPE: ClassVar[str] = "tf2_msgs/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()
