"""What is measured of a topic: how often it comes, how many bytes, and how late."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection
from typing import Any

from deploy.live.clock import SimClock, stamp_of
from deploy.live.known import topic_of
from deploy.live.listener import Heard
from deploy.live.rates import Rate, Sample, Window


class HzMeter:
    """Messages per second of simulation time, and of the wall clock."""

    def __init__(self, name: str, window: int) -> None:
        self.name, self.window = name, Window(window)
        topic = topic_of(name)
        self.promised = topic.rate if topic is not None and topic.rate else None

    @property
    def received(self) -> int:
        """Messages so far."""
        return self.window.received

    def take(self, heard: Heard, clock: SimClock) -> None:
        self.window.add(Sample(clock.time_of(heard), heard.sent, heard.lost, len(heard.payload)))

    def clear(self) -> None:
        self.window.samples.clear()

    def report(self) -> dict[str, Any]:
        window = self.window
        return {
            "topic": self.name,
            "promised": self.promised,
            "received": window.received,
            "lost": window.lost,
            "window": len(window.samples),
            "untimed": window.untimed,
            "simulated": _fields(window.simulated()),
            "wall": _fields(window.wall()),
        }

    def text(self) -> str:
        window = self.window
        promise = f", promised {self.promised:g}" if self.promised else ""
        lines = [_line("average rate", window.simulated(), f" by simulation time{promise}")]
        lines.append(_line("average rate", window.wall(), " by the wall clock"))
        return "".join(lines) + f"\twindow: {len(window.samples)} received: {window.received} lost: {window.lost}\n"


class BwMeter:
    """Bytes of payload per second, what was lost among them."""

    def __init__(self, name: str, window: int) -> None:
        self.name, self._hz = name, HzMeter(name, window)

    @property
    def received(self) -> int:
        """Messages so far."""
        return self._hz.received

    def take(self, heard: Heard, clock: SimClock) -> None:
        self._hz.take(heard, clock)

    def clear(self) -> None:
        self._hz.clear()

    def report(self) -> dict[str, Any]:
        window = self._hz.window
        mean, least, most = window.sizes()
        simulated, wall = window.simulated(), window.wall()
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
        told = self.report()
        simulated, wall = told["bytes_per_simulated_s"], told["bytes_per_wall_s"]
        size, window = told["size"], told["window"]
        return (
            f"{_bytes(wall)}/s by the wall clock, {_bytes(simulated)}/s by simulation time, from {window} messages\n"
            f"\tMessage size mean: {_bytes(size['mean'])} min: {_bytes(size['min'])} max: {_bytes(size['max'])}"
            f" received: {told['received']} lost: {told['lost']}\n"
        )


class DelayMeter:
    """How old messages are when they arrive: by stamp and ``/clock`` in simulation time, and by the wall clock since
    they were sent.
    """

    def __init__(self, name: str, window: int) -> None:
        self.name, self.received, self.lost = name, 0, 0
        self._ages: deque[float] = deque(maxlen=window)
        self._ways: deque[float] = deque(maxlen=window)

    def take(self, heard: Heard, clock: SimClock) -> None:
        self.received += 1
        self.lost += heard.lost
        stamp, now = stamp_of(heard.payload), clock.at(heard.arrived)
        if stamp is not None and now is not None:
            self._ages.append((now - stamp) / 1e9)
        if heard.origin is not None:
            self._ways.append((heard.arrived - heard.sent) / 1e9)

    def clear(self) -> None:
        self._ages.clear()

    def report(self) -> dict[str, Any]:
        return {
            "topic": self.name,
            "received": self.received,
            "lost": self.lost,
            "since_stamp": _spread(self._ages),
            "since_sent": _spread(self._ways),
        }

    def text(self) -> str:
        lines = []
        for what, values, without in (
            ("since its stamp, by simulation time", self._ages, "the messages have no stamp, or there is no /clock"),
            ("since it was sent, by the wall clock", self._ways, "the sender is foreign and tells no time"),
        ):
            spread = _spread(values)
            lines.append(
                f"average delay {what}: {spread['mean']:.4f}\n\tmin: {spread['min']:.4f}s max: {spread['max']:.4f}s "
                f"std dev: {spread['deviation']:.5f}s window: {len(values)}\n"
                if spread
                else f"no delay {what}: {without}\n"
            )
        return "".join(lines)


def _line(what: str, rate: Rate | None, how: str) -> str:
    if rate is None:
        return f"no {what}{how}: fewer than two messages, or no clock\n"
    return (
        f"{what}: {rate.hz:.3f}{how}\n"
        f"\tmin: {rate.least:.3f}s max: {rate.most:.3f}s std dev: {rate.deviation:.5f}s over {rate.span:.2f}s\n"
    )


def _fields(rate: Rate | None) -> dict[str, float] | None:
    if rate is None:
        return None
    return {
        "hz": rate.hz,
        "span": rate.span,
        "count": rate.count,
        "min": rate.least,
        "max": rate.most,
        "deviation": rate.deviation,
    }


def _spread(values: Collection[float]) -> dict[str, float] | None:
    """Mean, extremes and standard deviation; None without values."""
    if not values:
        return None
    mean = sum(values) / len(values)
    deviation = math.sqrt(sum((each - mean) ** 2 for each in values) / len(values))
    return {"mean": mean, "min": min(values), "max": max(values), "deviation": deviation}


def _bytes(count: float | None) -> str:
    if count is None:
        return "? B"
    for unit, size in (("MB", 1e6), ("KB", 1e3)):
        if count >= size:
            return f"{count / size:.2f} {unit}"
    return f"{count:.0f} B"
