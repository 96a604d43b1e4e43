"""A named request: what a service may be asked, with typed arguments and results."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from messages.base import Message

Q_co = TypeVar("Q_co", bound=Message, covariant=True)
R_co = TypeVar("R_co", bound=Message, covariant=True)


MAX_REQUEST_BYTES = 1 << 16
"""Bytes that a request may have, unless it says otherwise."""


@dataclass(frozen=True)
class Request(Generic[Q_co, R_co]):
    """A named request: its ROS name (relative, absolute or private), the records asked and replied.

    A request of more than ``largest`` bytes is refused unread.
    """

    name: str
    request_type: type[Q_co]
    response_type: type[R_co]
    about: str
    largest: int = MAX_REQUEST_BYTES
