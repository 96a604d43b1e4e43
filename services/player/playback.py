"""The messages of a bag as they are to be played: decoded, placed in time, cut to the span that is asked for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from messages.base import Message, WrongPayload
from messages.rosgraph import Clock
from messages.tf import TFMessage
from messages.topics import TF_STATIC
from services.bag.channel import RAW, Channel
from services.bag.reading import Bag
from services.bag.timeline import Moment, Timeline
from services.bag.typed import Typed
from services.player.choice import Choice
from services.player.fixed import FixedFrames

LATEST_NS = (2**31 - 1) * 10**9
"""The last time that a ``builtin_interfaces/Time`` has, in the year 2038."""


class Cue(NamedTuple):
    """A message and its moment; of a type that is unknown here, it is the payload itself.

    ``sender`` tells the nodes apart that sent on one latched topic; it is empty for the first of them.
    """

    moment: Moment
    channel: Channel
    message: Message | bytes
    sender: bytes = b""


class Playback:
    """Reads ``bag`` again and again.

    ``unread`` counts what was no message of its type, ``untimed`` what bears a time that ``/clock`` cannot tell.
    """

    def __init__(self, bag: Bag, choice: Choice, start: float, duration: float) -> None:
        self._bag, self._choice = bag, choice
        self._start, self._end = round(start * 1e9), round((start + duration) * 1e9) if duration else None
        self._passed = False
        self.unread: Counter[str] = Counter()
        self.untimed: Counter[str] = Counter()

    def cues(self) -> Iterator[Cue]:
        """The chosen messages from ``start`` on, with what was latched until then before them."""
        latched: dict[tuple[Channel, bytes], Cue] = {}
        first: Moment | None = None
        for cue in self._all():
            if self._end is not None and cue.moment.position > self._end:
                break
            if cue.moment.position < self._start:
                if cue.channel.quality.name == "LATCHED":
                    latched[cue.channel, cue.sender] = cue
                continue
            if first is None:
                first = cue.moment
                yield from (each._replace(moment=first) for each in latched.values())
            yield cue
        if first is None and self._passed:
            yield from latched.values()

    def _all(self) -> Iterator[Cue]:
        timeline, typed, fixed = Timeline(), Typed(), FixedFrames()
        chosen, needed = set(self._choice.played), {*self._choice.played, *self._choice.beside}
        for entry in self._bag.entries():
            if entry.publish_time > LATEST_NS:
                self.untimed[entry.channel.name] += 1
                continue
            if entry.channel not in needed:
                self._passed = timeline.place(entry.publish_time).position >= self._start
                continue
            message: Message | bytes | None = entry.data
            if entry.channel.encoding != RAW:
                try:
                    message = typed.message(entry)
                except WrongPayload:
                    self.unread[entry.channel.name] += 1
                    continue
            epoch = message.epoch if isinstance(message, Clock) else None
            moment = timeline.place(entry.publish_time, epoch)
            if message is None or entry.channel not in chosen:
                continue
            if isinstance(message, TFMessage) and entry.channel.name == TF_STATIC.name and not self._bag.ours:
                message = fixed.joined(message)
            yield Cue(moment, entry.channel, message, typed.sender(entry))
