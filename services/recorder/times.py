"""The two times of a recorded message: when it was there by the clock on the wall, and in simulation time."""

from __future__ import annotations

from messages.base import Message
from messages.rosgraph import Clock
from messages.std import Header
from messages.tf import TFMessage

NEAR_NS = 1_000_000_000
"""A stamp that is farther from the clock is not the time of the message."""


class Times:
    """Follows ``/clock``, message by message; without one, simulated time is that on the wall."""

    def __init__(self) -> None:
        self.clock: int | None = None

    def of(self, message: object, log_time: int, timed: bool) -> int:
        """The simulated time [ns] of a message: its stamp if it is near the clock, else the clock.

        ``timed`` tells whether there is a clock, though it may not have spoken yet.
        """
        if isinstance(message, Clock):
            self.clock = max(0, message.clock.ns)
        if self.clock is None:
            return 0 if timed else log_time
        stamp = stamp_of(message) if isinstance(message, Message) else None
        return stamp if stamp is not None and abs(stamp - self.clock) <= NEAR_NS and stamp >= 0 else self.clock


def arrival(source_ns: int | None, since: int, now: int) -> int:
    """When a message came, ns on the wall: when it was sent, within the span in which it must have come."""
    return now if source_ns is None else min(max(source_ns, since), now)


def stamp_of(message: Message) -> int | None:
    """The stamp [ns] in a message's header, or in that of its first transform."""
    if isinstance(message, TFMessage) and message.transforms:
        message = message.transforms[0]
    header = getattr(message, "header", None)
    return header.stamp.ns if isinstance(header, Header) else None
