"""Measures topics, with a report each second and one at the end, also after Ctrl-C."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from deploy import INTERRUPTED
from deploy.live.connect import cli_node, spin
from deploy.live.output import write_json, write_note, write_text
from deploy.live.subscribers import ClockSubscriber
from deploy.live.topics import TopicEndpoints, absolute_name, group_by_topic, is_latched, topic_type, wait_for_topic
from services.runtime.errors import EleaError
from services.runtime.graph import snapshot
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.subscriber import ReceivedSample, UntypedSubscriber

REPORT_PERIOD_S = 1.0
"""Wall time between two reports."""
_CLOCK_TIMEOUT_S = 0.5
"""Wall time [s] for which a sample without a stamp waits for a later clock sample, to determine its time."""


@dataclass(frozen=True)
class MeasureOptions:
    """When to end (after ``count`` messages of each topic, 0 for never; after ``timeout`` [s]), whether to wait for an
    unknown topic, and the output format.
    """

    count: int = 0
    timeout: float | None = None
    wait: bool = False
    as_json: bool = False


class Meter(Protocol):
    """Measures one topic."""

    @property
    def received(self) -> int:
        """The number of messages so far."""
        ...

    def add(self, sample: ReceivedSample, clock: ClockSubscriber) -> None:
        """Add a sample; the clock has passed the time at which it was sent."""
        ...

    def reset(self) -> None:
        """Start again after a reset of simulation time."""
        ...

    def report(self) -> dict[str, Any]:
        """Return the figures for JSON."""
        ...

    def text(self) -> str:
        """Return the figures as text."""
        ...


class _MeasuredTopic:
    """A topic, its meter, and the samples whose simulation time is not known yet."""

    def __init__(
        self, live: LightNode, name: str, meter: Meter, options: MeasureOptions, graph: Mapping[str, TopicEndpoints]
    ) -> None:
        ends = wait_for_topic(live, name, options.wait, graph)
        latched = is_latched(ends)
        self.name, self.meter, self._count = name, meter, options.count
        self.listener = UntypedSubscriber(live.transport, name, latched)
        live.declare_subscription(name, topic_type(ends), "LATCHED" if latched else "SENSOR")
        self._pending: deque[tuple[ReceivedSample, float]] = deque()
        self._epoch: int | None = None
        self._reported = -1

    @property
    def is_complete(self) -> bool:
        """Whether it has the requested number of messages."""
        return 0 < self._count <= self.meter.received

    def update(self, clock: ClockSubscriber, at_once: bool = False) -> None:
        """Measure the new samples whose simulation time is known, or ``at_once`` all of them."""
        now = time.monotonic()
        self._pending.extend((sample, now) for sample in self.listener.drain())
        while self._pending and not self.is_complete:
            sample, came = self._pending[0]
            if not (at_once or clock.covers(sample.sent_ns) or now - came > _CLOCK_TIMEOUT_S):
                return
            if clock.now is not None and clock.epoch != self._epoch and sample.sent_ns >= clock.since:
                if self._epoch is not None:
                    self.meter.reset()
                self._epoch = clock.epoch
            self._pending.popleft()
            self.meter.add(sample, clock)

    def has_new(self) -> bool:
        """Return whether messages were measured since the last call."""
        before, self._reported = self._reported, self.meter.received
        return before != self._reported and self._reported > 0


def measure(
    address: NetworkAddress, role: str, names: Sequence[str], make: Callable[[str], Meter], options: MeasureOptions
) -> int:
    """Measure each topic with a meter; return the exit status. Raises EleaError if nothing arrived
    within the timeout.
    """
    wanted = list(dict.fromkeys(absolute_name(each) for each in names))
    with cli_node(address, role) as live:
        graph = group_by_topic(snapshot(live.transport))
        clock = ClockSubscriber(live.transport)
        channels = [_MeasuredTopic(live, name, make(name), options, graph) for name in wanted]
        epoch, due = None, time.monotonic() + REPORT_PERIOD_S
        for _ in spin(live, channels[0].listener.raw, options.timeout):
            clock.update()
            if clock.now is not None and clock.epoch != epoch:
                if epoch is not None:
                    write_note(f"simulation time was reset (epoch {clock.epoch})")
                epoch = clock.epoch
            for each in channels:
                each.update(clock)
            if all(each.is_complete for each in channels):
                break
            if time.monotonic() >= due:
                due += REPORT_PERIOD_S
                _report(channels, options.as_json, len(channels) > 1)
        clock.update()
        for each in channels:
            each.update(clock, at_once=True)
        _report_final(channels, options)
        complete = all(each.is_complete for each in channels)
        if live.stopping and options.count and not complete:
            return INTERRUPTED
    silent = [each.name for each in channels if not each.meter.received]
    if options.timeout is not None and (silent or (options.count and not complete)):
        what = (
            f"no message arrived on {', '.join(silent)}" if silent else f"fewer than {options.count} messages arrived"
        )
        raise EleaError(f"{what} within {options.timeout:g} s")
    return 0


def _report(channels: Sequence[_MeasuredTopic], as_json: bool, named: bool) -> None:
    for each in channels:
        if each.has_new():
            _show(each, as_json, named)
        elif not as_json:
            write_text(f"no new messages{f' on {each.name}' if named else ''}\n", flush=True)


def _report_final(channels: Sequence[_MeasuredTopic], options: MeasureOptions) -> None:
    """Show the final figures of every topic."""
    for each in channels:
        if each.meter.received:
            _show(each, options.as_json, len(channels) > 1)


def _show(channel: _MeasuredTopic, as_json: bool, named: bool) -> None:
    if as_json:
        write_json(channel.meter.report(), lines=True)
    else:
        write_text((f"{channel.name}\n" if named else "") + channel.meter.text(), flush=True)
