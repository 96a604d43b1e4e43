"""Simulation time as those who look on know it: from ``/clock``, and from the stamps in messages."""

from __future__ import annotations

from deploy.live.listener import Heard, Listener
from messages.base import Message, WrongPayload, decoder
from messages.rosgraph import Clock
from messages.std import Header, Time
from messages.topics import CLOCK
from services.runtime.clock_map import ClockMap
from services.runtime.network.transport import Transport

_KEPT = 4096
"""Clock messages that are remembered; at 50 Hz more than a minute."""


class _Stamped(Message, frozen=True, kw_only=True):
    """The part of a message that says when it was made: a header, that of its first transform, or the clock itself."""

    header: Header | None = None
    clock: Time | None = None
    transforms: tuple[_Headed, ...] = ()


class _Headed(Message, frozen=True, kw_only=True):
    header: Header = Header()


_read_stamp = decoder(_Stamped)
_read_clock = decoder(Clock)


def stamp_of(payload: bytes) -> int | None:
    """The simulation time [ns] that a message bears, whatever its type; None without a stamp, or with one of 0."""
    try:
        found = _read_stamp(payload)
    except WrongPayload:
        return None
    if found.header is not None:
        return found.header.stamp.ns or None
    if found.transforms:
        return found.transforms[0].header.stamp.ns or None
    return None if found.clock is None else found.clock.ns


class SimClock:
    """Follows ``/clock``; ``now`` [ns] is None until it was heard, ``epoch`` grows when time begins anew.

    ``since`` is the moment of the wall clock [ns] at which the present epoch was told.
    """

    def __init__(self, transport: Transport) -> None:
        self._listener = Listener(transport, CLOCK.name)
        self.inlet = self._listener.inlet
        self.now: int | None = None
        self.epoch = 0
        self.since = 0
        self.paused = False
        self._map = ClockMap(_KEPT)

    def follow(self) -> None:
        """Take what has come."""
        for heard in self._listener.take():
            try:
                clock = _read_clock(heard.payload)
            except WrongPayload:
                continue
            if clock.epoch != self.epoch:
                self._map.clear()
                self.since = heard.sent
            self.now, self.epoch, self.paused = clock.clock.ns, clock.epoch, clock.paused
            if heard.lost:
                self._map.lose()
            if self._map.add(heard.sent, clock.clock.ns):
                self.since = min(self.since, heard.sent)

    def past(self, moment: int) -> bool:
        """Whether a clock sent after this moment of the wall clock [ns] has come: then ``at`` is certain."""
        return self._map.past(moment)

    def at(self, moment: int) -> int | None:
        """The simulation time [ns] of a moment of the wall clock [ns]: of the last clock sent before it.

        None before the first one, and where one was lost that may have been sent before the moment.
        """
        return self._map.before(moment)

    def time_of(self, heard: Heard) -> int | None:
        """When a sample was made, ns: by its stamp, or by the clock as it stood when it was sent; None if unknown."""
        stamp = stamp_of(heard.payload)
        return self.at(heard.sent) if stamp is None else stamp
