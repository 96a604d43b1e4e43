"""Measuring topics until it is enough: a report each second, and a last one at the end, also after Ctrl-C."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from deploy.live.clock import SimClock
from deploy.live.ends import Ends, absolute, topics
from deploy.live.listener import Heard, Listener
from deploy.live.output import note, say, say_json
from deploy.live.session import Session, session
from deploy.live.subject import await_subject, is_latched, type_of
from deploy.place import Place
from services.runtime.errors import EleaError
from services.runtime.graph import snapshot

PERIOD_S = 1.0
"""Wall time between two reports."""
_CLOCK_S = 0.5
"""Wall time that a sample without a stamp waits for the clock that tells when it was sent."""

INTERRUPTED = 130
"""Exit status of what was asked for a number of messages and interrupted before."""


@dataclass(frozen=True)
class Terms:
    """When to end (after ``count`` messages of each topic, 0 for never; after ``timeout`` [s]), whether to wait for a
    topic that nobody knows, and how to show it.
    """

    count: int = 0
    timeout: float | None = None
    wait: bool = False
    as_json: bool = False


class Meter(Protocol):
    """Measures one topic."""

    @property
    def received(self) -> int:
        """Messages so far."""
        ...

    def take(self, heard: Heard, clock: SimClock) -> None:
        """Take a sample; the clock has gone past the moment at which it was sent."""
        ...

    def clear(self) -> None:
        """Simulation time began anew."""
        ...

    def report(self) -> dict[str, Any]:
        """The figures, for JSON."""
        ...

    def text(self) -> str:
        """The figures, for a person."""
        ...


class _Channel:
    """A topic, its meter, and the samples whose time is not known yet."""

    def __init__(self, live: Session, name: str, meter: Meter, terms: Terms, graph: Mapping[str, Ends]) -> None:
        ends = await_subject(live, name, terms.wait, graph)
        latched = is_latched(ends)
        self.name, self.meter, self._count = name, meter, terms.count
        self.listener = Listener(live.transport, name, latched)
        live.reads(name, type_of(ends), "LATCHED" if latched else "SENSOR")
        self._pending: deque[tuple[Heard, float]] = deque()
        self._epoch: int | None = None
        self._told = -1

    @property
    def full(self) -> bool:
        """Whether it has what it was asked for."""
        return 0 < self._count <= self.meter.received

    def follow(self, clock: SimClock, at_once: bool = False) -> None:
        """Measure what has come, once the clock tells its time."""
        now = time.monotonic()
        self._pending.extend((heard, now) for heard in self.listener.take())
        while self._pending and not self.full:
            heard, came = self._pending[0]
            if not (at_once or clock.past(heard.sent) or now - came > _CLOCK_S):
                return
            if clock.now is not None and clock.epoch != self._epoch and heard.sent >= clock.since:
                if self._epoch is not None:
                    self.meter.clear()
                self._epoch = clock.epoch
            self._pending.popleft()
            self.meter.take(heard, clock)

    def news(self) -> bool:
        """Whether something came since the last call."""
        told, self._told = self._told, self.meter.received
        return told != self._told and self._told > 0


def measure(place: Place, role: str, names: Sequence[str], make: Callable[[str], Meter], terms: Terms) -> int:
    """Measure the topics with a meter each; the exit status. Raises EleaError when nothing came within the timeout."""
    wanted = list(dict.fromkeys(absolute(each) for each in names))
    with session(place, role) as live:
        graph = topics(snapshot(live.transport))
        clock = SimClock(live.transport)
        channels = [_Channel(live, name, make(name), terms, graph) for name in wanted]
        epoch, due = None, time.monotonic() + PERIOD_S
        for _ in live.turns(channels[0].listener.inlet, terms.timeout):
            clock.follow()
            if clock.now is not None and clock.epoch != epoch:
                if epoch is not None:
                    note(f"simulation time began anew (epoch {clock.epoch})")
                epoch = clock.epoch
            for each in channels:
                each.follow(clock)
            if all(each.full for each in channels):
                break
            if time.monotonic() >= due:
                due += PERIOD_S
                _tell(channels, terms.as_json, len(channels) > 1)
        clock.follow()
        for each in channels:
            each.follow(clock, at_once=True)
        _end(channels, terms)
        complete = all(each.full for each in channels)
        if live.stopping and terms.count and not complete:
            return INTERRUPTED
    silent = [each.name for each in channels if not each.meter.received]
    if terms.timeout is not None and (silent or (terms.count and not complete)):
        what = f"nothing came on {', '.join(silent)}" if silent else f"fewer than {terms.count} messages came"
        raise EleaError(f"{what} within {terms.timeout:g} s")
    return 0


def _tell(channels: Sequence[_Channel], as_json: bool, named: bool) -> None:
    for each in channels:
        if each.news():
            _show(each, as_json, named)
        elif not as_json:
            say(f"no new messages{f' on {each.name}' if named else ''}\n", flush=True)


def _end(channels: Sequence[_Channel], terms: Terms) -> None:
    """The last word on every topic, whether or not it was told already."""
    for each in channels:
        if each.meter.received:
            _show(each, terms.as_json, len(channels) > 1)


def _show(channel: _Channel, as_json: bool, named: bool) -> None:
    if as_json:
        say_json(channel.meter.report(), lines=True)
    else:
        say((f"{channel.name}\n" if named else "") + channel.meter.text(), flush=True)
