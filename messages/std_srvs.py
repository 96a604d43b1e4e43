"""std_srvs: requests without arguments."""

from typing import ClassVar

from messages.base import Message


class Empty(Message, frozen=True, kw_only=True):
    """A request without arguments."""

    ROS_TYPE: ClassVar[str] = "std_srvs/Empty"


class EmptyResponse(Message, frozen=True, kw_only=True):
    """An empty reply: the request was carried out."""

    ROS_TYPE: ClassVar[str] = "std_srvs/EmptyResponse"
