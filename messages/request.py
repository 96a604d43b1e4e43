"""A service request type: its name, and the record types of request and response."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from messages.base import Message

Q_co = TypeVar("Q_co", bound=Message, covariant=True)
R_co = TypeVar("R_co", bound=Message, covariant=True)


MAX_REQUEST_BYTES = 1 << 16
"""Default maximum size of a request [bytes]."""


@dataclass(frozen=True)
class Request(Generic[Q_co, R_co]):
    """A service: its ROS name (relative, absolute or private) and the records of its request and response.

    A request of more than ``largest`` bytes is refused without decoding.
    """

    name: str
    request_type: type[Q_co]
    response_type: type[R_co]
    about: str
    largest: int = MAX_REQUEST_BYTES
