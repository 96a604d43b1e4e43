"""Topic statistics: rate, bandwidth and delay over a window of samples."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from deploy.interfaces import known_topic
from deploy.live.subscribers import ClockSubscriber, header_stamp
from services.runtime.subscriber import ReceivedSample

NS_PER_S = 1e9


class RateSample(NamedTuple):
    """One message: its simulation time [ns] (None if unknown) and wall time [ns], the number lost before it, and its
    size [bytes].
    """

    time: int | None
    sent_ns: int
    lost: int = 0
    size: int = 0


@dataclass(frozen=True)
class Rate:
    """Rate ``hz`` over ``span`` [s], from ``count`` messages including lost ones.

    The intervals are those between messages with no loss between them: shortest, longest and standard deviation [s].
    """

    hz: float
    span: float
    count: int
    shortest: float
    longest: float
    deviation: float


class SampleWindow:
    """The newest samples of one topic, at most ``length``; ``received`` and ``lost`` count from the start."""

    def __init__(self, length: int) -> None:
        self.samples: deque[RateSample] = deque(maxlen=length)
        self.received = self.lost = 0

    def add(self, sample: RateSample) -> None:
        """Add a sample; if its simulation time is earlier than the last by more than 1 s, a new window begins."""
        self.received += 1
        self.lost += sample.lost
        before = self.samples[-1].time if self.samples else None
        if before is not None and sample.time is not None and sample.time < before - NS_PER_S:
            self.samples.clear()
        self.samples.append(sample)

    def sim_rate(self) -> Rate | None:
        """Return the rate in simulation time. Samples without a time count between their
        neighbours, as lost ones do.
        """
        moments: list[tuple[int, int]] = []
        between = 0
        for each in self.samples:
            between += each.lost
            if each.time is None:
                between += 1
            else:
                moments.append((each.time, between))
                between = 0
        return compute_rate(moments)

    @property
    def untimed(self) -> int:
        """The number of samples without a simulation time."""
        return sum(each.time is None for each in self.samples)

    def wall_rate(self) -> Rate | None:
        """Return the rate by the senders' wall clocks."""
        return compute_rate([(each.sent_ns, each.lost) for each in self.samples])

    def sizes(self) -> tuple[float, int, int]:
        """Return mean, minimum and maximum size of a message [bytes]."""
        sizes = [each.size for each in self.samples] or [0]
        return sum(sizes) / len(sizes), min(sizes), max(sizes)


def compute_rate(moments: Sequence[tuple[int, int]]) -> Rate | None:
    """Return the rate of messages at ``moments``: (time [ns], number lost before it); None if they span no time.

    Messages after the first instant up to the last are counted, including lost ones. If several share an instant, the
    last instant may be incomplete and is left out; and messages lost before an instant may belong to it or to the one
    before, so the count then begins and ends where none was lost.
    """
    moments = sorted(moments)
    instants: dict[int, int] = {}
    gaps: dict[int, int] = {}
    for time, lost in moments:
        instants[time] = instants.get(time, 0) + 1 + lost
        gaps[time] = gaps.get(time, 0) + lost
    times = list(instants)
    if len(moments) > len(instants) and len(times) > 2:
        ends = [before for before, after in pairwise(times) if not gaps[after]]
        times = times[times.index(ends[0]) : times.index(ends[-1]) + 1] if len(ends) > 1 else times[:-1]
    if len(times) < 2:
        return None
    span = (times[-1] - times[0]) / NS_PER_S
    count = sum(instants[each] for each in times[1:])
    apart = [(b[0] - a[0]) / NS_PER_S for a, b in pairwise(moments) if not b[1]]
    mean = sum(apart) / len(apart) if apart else 0.0
    spread = math.sqrt(sum((each - mean) ** 2 for each in apart) / len(apart)) if apart else 0.0
    return Rate(count / span, span, count, min(apart, default=0.0), max(apart, default=0.0), spread)


class HzMeter:
    """Measures the rate in simulation time and wall time."""

    def __init__(self, name: str, window: int) -> None:
        self.name, self.window = name, SampleWindow(window)
        topic = known_topic(name)
        self.nominal_rate = topic.rate if topic is not None and topic.rate else None

    @property
    def received(self) -> int:
        """The number of messages so far."""
        return self.window.received

    def add(self, sample: ReceivedSample, clock: ClockSubscriber) -> None:
        self.window.add(RateSample(clock.sample_time(sample), sample.sent_ns, sample.lost, len(sample.payload)))

    def reset(self) -> None:
        self.window.samples.clear()

    def report(self) -> dict[str, Any]:
        window = self.window
        return {
            "topic": self.name,
            "promised": self.nominal_rate,
            "received": window.received,
            "lost": window.lost,
            "window": len(window.samples),
            "untimed": window.untimed,
            "simulated": _rate_fields(window.sim_rate()),
            "wall": _rate_fields(window.wall_rate()),
        }

    def text(self) -> str:
        window = self.window
        promise = f", promised {self.nominal_rate:g}" if self.nominal_rate else ""
        lines = [_format_rate("average rate", window.sim_rate(), f" by simulation time{promise}")]
        lines.append(_format_rate("average rate", window.wall_rate(), " by the wall clock"))
        return "".join(lines) + f"\twindow: {len(window.samples)} received: {window.received} lost: {window.lost}\n"


class BwMeter:
    """Measures the payload bandwidth [bytes/s], including lost messages."""

    def __init__(self, name: str, window: int) -> None:
        self.name, self._hz = name, HzMeter(name, window)

    @property
    def received(self) -> int:
        """The number of messages so far."""
        return self._hz.received

    def add(self, sample: ReceivedSample, clock: ClockSubscriber) -> None:
        self._hz.add(sample, clock)

    def reset(self) -> None:
        self._hz.reset()

    def report(self) -> dict[str, Any]:
        window = self._hz.window
        mean, least, most = window.sizes()
        simulated, wall = window.sim_rate(), window.wall_rate()
        return {
            "topic": self.name,
            "received": window.received,
            "lost": window.lost,
            "window": len(window.samples),
            "size": {"mean": mean, "min": least, "max": most},
            "bytes_per_simulated_s": None if simulated is None else mean * simulated.hz,
            "bytes_per_wall_s": None if wall is None else mean * wall.hz,
        }

    def text(self) -> str:
        figures = self.report()
        simulated, wall = figures["bytes_per_simulated_s"], figures["bytes_per_wall_s"]
        size, window = figures["size"], figures["window"]
        return (
            f"{_format_bytes(wall)}/s by the wall clock, {_format_bytes(simulated)}/s by simulation time, "
            f"from {window} messages\n"
            f"\tMessage size mean: {_format_bytes(size['mean'])} min: {_format_bytes(size['min'])}"
            f" max: {_format_bytes(size['max'])}"
            f" received: {figures['received']} lost: {figures['lost']}\n"
        )


class DelayMeter:
    """Measures the age of messages on arrival: in simulation time by stamp and ``/clock``, and in wall time since
    sending.
    """

    def __init__(self, name: str, window: int) -> None:
        self.name, self.received, self.lost = name, 0, 0
        self._ages: deque[float] = deque(maxlen=window)
        self._transit_times: deque[float] = deque(maxlen=window)

    def add(self, sample: ReceivedSample, clock: ClockSubscriber) -> None:
        self.received += 1
        self.lost += sample.lost
        stamp, now = header_stamp(sample.payload), clock.time_at(sample.received_ns)
        if stamp is not None and now is not None:
            self._ages.append((now - stamp) / 1e9)
        if sample.origin is not None:
            self._transit_times.append((sample.received_ns - sample.sent_ns) / 1e9)

    def reset(self) -> None:
        self._ages.clear()

    def report(self) -> dict[str, Any]:
        return {
            "topic": self.name,
            "received": self.received,
            "lost": self.lost,
            "since_stamp": _statistics(self._ages),
            "since_sent": _statistics(self._transit_times),
        }

    def text(self) -> str:
        lines = []
        for what, values, without in (
            ("since its stamp, by simulation time", self._ages, "the messages have no stamp, or there is no /clock"),
            (
                "since it was sent, by the wall clock",
                self._transit_times,
                "external publisher without a time of sending",
            ),
        ):
            spread = _statistics(values)
            lines.append(
                f"average delay {what}: {spread['mean']:.4f}\n\tmin: {spread['min']:.4f}s max: {spread['max']:.4f}s "
                f"std dev: {spread['deviation']:.5f}s window: {len(values)}\n"
                if spread
                else f"no delay {what}: {without}\n"
            )
        return "".join(lines)


def _format_rate(what: str, rate: Rate | None, how: str) -> str:
    if rate is None:
        return f"no {what}{how}: fewer than two messages, or no clock\n"
    return (
        f"{what}: {rate.hz:.3f}{how}\n"
        f"\tmin: {rate.shortest:.3f}s max: {rate.longest:.3f}s std dev: {rate.deviation:.5f}s over {rate.span:.2f}s\n"
    )


def _rate_fields(rate: Rate | None) -> dict[str, float] | None:
    if rate is None:
        return None
    return {
        "hz": rate.hz,
        "span": rate.span,
        "count": rate.count,
        "min": rate.shortest,
        "max": rate.longest,
        "deviation": rate.deviation,
    }


def _statistics(values: Collection[float]) -> dict[str, float] | None:
    """Return mean, minimum, maximum and standard deviation; None without values."""
    if not values:
        return None
    mean = sum(values) / len(values)
    deviation = math.sqrt(sum((each - mean) ** 2 for each in values) / len(values))
    return {"mean": mean, "min": min(values), "max": max(values), "deviation": deviation}


def _format_bytes(count: float | None) -> str:
    if count is None:
        return "? B"
    for unit, size in (("MB", 1e6), ("KB", 1e3)):
        if count >= size:
            return f"{count / size:.2f} {unit}"
    return f"{count:.0f} B"
