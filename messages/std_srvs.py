"""std_srvs: requests without arguments of their own."""

from typing import ClassVar

from messages.base import Message


class Empty(Message, frozen=True, kw_only=True):
    """A request that needs no argument."""

    ROS_TYPE: ClassVar[str] = "std_srvs/Empty"


class EmptyResponse(Message, frozen=True, kw_only=True):
    """A reply that says no more than that it is done."""

    ROS_TYPE: ClassVar[str] = "std_srvs/EmptyResponse"
