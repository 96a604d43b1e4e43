"""std_srvs: requests without arguments of their own."""

from typing import ClassVar

from messages.base import Message


class Empty(Message, frozen=True, kw_only=True):
    """A request that needs no argument."""

    ROS_TYPE: ClassVar[str] = "std_srvs/Empty"


class EmptyResponse(Message, frozen=True, kw_only=True):
    """A reply without content: the request was carried out."""

    ROS_TYPE: ClassVar[str] = "std_srvs/EmptyResponse"
